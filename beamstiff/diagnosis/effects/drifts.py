"""What drifts along a course (N,): the point, the machine about its base, its tool, its target, its parts."""

from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np

from beamstiff.diagnosis.effects.effect import Quantity, Shape, Term, named
from beamstiff.diagnosis.effects.external import shift_alone, tool_axes
from beamstiff.diagnosis.effects.geometry_error import fixed, pose_change
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

DRIFT = 1e-4  # m over the campaign
TURN = 1e-4  # rad over the campaign
GROWTH = 1e-4  # over the campaign: steel that warms by 8 K


def along(course: Array) -> Array:
    """Return the displacement (N, 6, 3) along x, y and z."""
    return shift_alone(course[:, None, None] * np.eye(3))


def turning(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 3) of turning about the base axes."""
    axes = np.broadcast_to(np.eye(3), (len(course), 3, 3))
    turned = np.cross(axes, baseline.described[0][:, :, None], axis=1)
    return np.asarray(course[:, None, None] * np.concatenate([turned, axes], axis=1))


def growing(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 1) of growing away from the base."""
    return course[:, None, None] * shift_alone(baseline.described[0][..., None])


def lengthening(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 1) of links that lengthen, along the way from the base to the point."""
    reach = np.maximum(np.linalg.norm(baseline.described[0], axis=1, keepdims=True), 1e-9)
    return np.asarray(growing(baseline, course) / reach[:, None])


def of_the_tool(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 3) along the axes of the tool, as of a spindle that warms up."""
    return shift_alone(course[:, None, None] * tool_axes(baseline))


def turned_over(change: Array) -> Array:
    """Return the rotation (N, 6, c) alone that has the axes of a displacement without rotation."""
    return np.roll(change, 3, axis=1)


def of_the_whole(baseline: Baseline, courses: Mapping[str, Array], label: str, since: str) -> list[Shape]:
    """Return drifts of the whole machine, each any mixture of courses (N,)."""
    drifts = _each(courses, along, "drift", "m", DRIFT)
    turns = _each(courses, lambda course: turning(baseline, course), "turn", "rad", TURN)
    names = [_word(name) for name in courses]
    grown, longer = (
        np.concatenate([way(baseline, course) for course in courses.values()], -1)
        for way in (growing, lengthening)
    )
    growths = [
        (grown, named("growth", "1", GROWTH, names)),
        (longer, named("lengthening", "m", DRIFT, names)),
    ]
    found = {
        label: [drifts],
        f"{label}, turning": [drifts, turns],
        f"growing, {label}": growths,
        f"growing and turning, {label}": [*growths, turns],
    }
    if _turns_are_read(baseline):  # and may drift by themselves: a target turns on its holder
        spins = _each(courses, lambda course: turned_over(along(course)), "target_turn", "rad", TURN)
        found |= {
            f"{label}, target turning": [drifts, spins],
            f"growing, {label}, target turning": [*growths, spins],
        }
    return [Shape.of(f"{name}{since}", *terms) for name, terms in found.items()]


def of_the_tool_alone(
    baseline: Baseline, courses: Mapping[str, Array], label: str, since: str
) -> list[Shape]:
    """Return drifts of the tool, each any mixture of courses (N,)."""

    def turned(course: Array) -> Array:
        return turned_over(of_the_tool(baseline, course))

    drifts = _each(courses, lambda course: of_the_tool(baseline, course), "tool_drift", "m", DRIFT)
    result = [Shape.of(f"tool, {label}{since}", drifts)]
    if _turns_are_read(baseline):
        turns = _each(courses, turned, "tool_turn", "rad", TURN)
        result.append(Shape.of(f"tool, {label}, turning{since}", drifts, turns))
    return result


def _turns_are_read(baseline: Baseline) -> bool:
    return baseline.stated is not None or bool(baseline.fit.used[:, 3:].any())


def _each(
    courses: Mapping[str, Array], change: Callable[[Array], Array], what: str, unit: str, size: float
) -> Term:
    """Return what a drift changes that follows any mixture of courses (N,)."""
    columns = np.concatenate([change(course) for course in courses.values()], -1)
    return columns, named(what, unit, size, [f"{_word(name)}_{axis}" for name in courses for axis in "xyz"])


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
    terms: list[Term] = []
    for what, changes in parts.items():
        size, unit = (DRIFT, "m") if what == "length" else (TURN, "rad")
        for course_name, course in courses.items():
            for name, change in changes.items():
                own = Quantity(_word(f"{what}_{name}_{course_name}"), unit, size)
                terms.append((change * course[:, None], (own,)))
    return Shape.of(f"every {' and '.join(parts)}, {label}{since}", *terms, weight=0.5)


def _word(name: str) -> str:
    return name.replace(" ", "_").replace(",", "")
