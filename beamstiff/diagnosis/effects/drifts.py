"""What drifts along a course (N,): the point, the machine about its base, its tool, its target, its parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np

from beamstiff.diagnosis.effects.effect import Quantity, Shape
from beamstiff.diagnosis.effects.external import tool_axes
from beamstiff.diagnosis.effects.geometry_error import fixed, pose_change
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

DRIFT = 1e-4  # m over the campaign
TURN = 1e-4  # rad over the campaign
GROWTH = 1e-4  # over the campaign: steel that warms by 8 K


def along(course: Array) -> Array:
    """Return the displacement (N, 6, 3) along x, y and z."""
    result = np.zeros((len(course), 6, 3))
    result[:, [0, 1, 2], [0, 1, 2]] = course[:, None]
    return result


def turning(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 3) of turning about the base axes."""
    axes = np.broadcast_to(np.eye(3), (len(course), 3, 3))
    position = baseline.described[0]
    result: Array = course[:, None, None] * np.concatenate(
        [np.cross(axes, position[:, :, None], axis=1), axes], axis=1
    )
    return result


def growing(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 1) of growing away from the base."""
    position = baseline.described[0]
    result: Array = course[:, None, None] * np.concatenate([position, 0.0 * position], axis=1)[..., None]
    return result


def lengthening(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 1) of links that lengthen, along the way from the base to the point."""
    position = baseline.described[0]
    reach = np.maximum(np.linalg.norm(position, axis=1, keepdims=True), 1e-9)
    result: Array = growing(baseline, course) / reach[:, None]
    return result


def of_the_tool(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 3) along the axes of the tool, as of a spindle that warms up."""
    axes = course[:, None, None] * tool_axes(baseline)
    return np.concatenate([axes, 0.0 * axes], axis=1)


def turned_over(change: Array) -> Array:
    """Return the rotation (N, 6, c) alone that has the axes of a displacement without rotation."""
    return np.roll(change, 3, axis=1)


def named(what: str, unit: str, size: float) -> tuple[Quantity, ...]:
    """Return the parameters of a drift along, or about, x, y and z."""
    return tuple(Quantity(f"{what}_{axis}", unit, size) for axis in "xyz")


def of_the_whole(baseline: Baseline, courses: Mapping[str, Array], label: str, since: str) -> list[Shape]:
    """Return drifts of the whole machine, each any mixture of courses (N,)."""
    every, drifts = _each(courses, along, "drift", "m", DRIFT)
    about, turns = _each(courses, lambda course: turning(baseline, course), "turn", "rad", TURN)
    names = [_word(name) for name in courses]
    ways = (growing, lengthening)
    grown = np.concatenate([way(baseline, course) for way in ways for course in courses.values()], -1)
    growths = (
        *(Quantity(f"growth_{name}", "1", GROWTH) for name in names),
        *(Quantity(f"lengthening_{name}", "m", DRIFT) for name in names),
    )
    found = {
        label: (every, drifts),
        f"{label}, turning": (np.concatenate([every, about], -1), (*drifts, *turns)),
        f"growing, {label}": (grown, growths),
        f"growing and turning, {label}": (np.concatenate([grown, about], -1), (*growths, *turns)),
    }
    if _turns_are_read(baseline):  # and may drift by themselves: a target turns on its holder
        target, spins = _each(courses, lambda course: turned_over(along(course)), "target_turn", "rad", TURN)
        found |= {
            f"{label}, target turning": (np.concatenate([every, target], -1), (*drifts, *spins)),
            f"growing, {label}, target turning": (np.concatenate([grown, target], -1), (*growths, *spins)),
        }
    return [Shape(f"{name}{since}", columns, quantities) for name, (columns, quantities) in found.items()]


def of_the_tool_alone(
    baseline: Baseline, courses: Mapping[str, Array], label: str, since: str
) -> list[Shape]:
    """Return drifts of the tool, each any mixture of courses (N,)."""
    tool, drifts = _each(courses, lambda course: of_the_tool(baseline, course), "tool_drift", "m", DRIFT)
    result = [Shape(f"tool, {label}{since}", tool, drifts)]
    if _turns_are_read(baseline):
        seat, turns = _each(
            courses, lambda course: turned_over(of_the_tool(baseline, course)), "tool_turn", "rad", TURN
        )
        both = np.concatenate([tool, seat], -1)
        result.append(Shape(f"tool, {label}, turning{since}", both, (*drifts, *turns)))
    return result


def _turns_are_read(baseline: Baseline) -> bool:
    return baseline.stated is not None or bool(baseline.fit.used[:, 3:].any())


def _each(
    courses: Mapping[str, Array], change: Callable[[Array], Array], what: str, unit: str, size: float
) -> tuple[Array, tuple[Quantity, ...]]:
    """Return what a drift changes that follows any mixture of courses (N,), and its parameters."""
    columns = np.concatenate([change(course) for course in courses.values()], -1)
    names = [_word(name) for name in courses]
    return columns, tuple(item for name in names for item in named(f"{what}_{name}", unit, size))


def parts_of(baseline: Baseline) -> dict[str, dict[str, Array]]:
    """Return how the nominal pose (N, 6) changes with each joint's zero, each link's length and its tilt."""
    robot = baseline.nominal
    names = {
        "zero": [item.name for item in robot.actuated],
        "length": [
            f"{frame.name}.{name}"
            for frame in robot.frames
            for name in ("d", "r")
            if fixed(robot, frame, name)
        ],
        # a link that is warm on one side bends, and tilts the axis that it carries
        "tilt": [f"{frame.name}.alpha" for frame in robot.frames if fixed(robot, frame, "alpha") is not None],
    }
    found: dict[str, dict[str, Array]] = {}
    for what, some in names.items():
        found[what] = {}
        for name in some:
            with suppress(BeamstiffError):  # a loop that cannot close otherwise
                found[what][name] = pose_change(baseline, name)
    return {what: changes for what, changes in found.items() if changes}


def by_part(
    parts: Mapping[str, Mapping[str, Array]], courses: Mapping[str, Array], label: str, since: str
) -> Shape:
    """Return the drift in which each part, a zero, a length or a tilt, follows the courses (N,) by itself."""
    columns, quantities = [], []
    for what, changes in parts.items():
        for course_name, course in courses.items():
            for name, change in changes.items():
                size, unit = (DRIFT, "m") if what == "length" else (TURN, "rad")
                columns.append(change * course[:, None])
                quantities.append(Quantity(_word(f"{what}_{name}_{course_name}"), unit, size))
    kinds = " and ".join(parts)
    return Shape(f"every {kinds}, {label}{since}", np.stack(columns, -1), tuple(quantities), weight=0.5)


def _word(name: str) -> str:
    return name.replace(" ", "_").replace(",", "")
