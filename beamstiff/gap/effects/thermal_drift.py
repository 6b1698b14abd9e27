"""`thermal-drift`: the reading drifts with time or temperature, loaded or not."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.gap.baseline import Baseline, nominal_pose
from beamstiff.gap.effects.effect import Effect, Quantity, Scales, Shape, stated_scale
from beamstiff.gap.effects.geometry_error import pose_change
from beamstiff.gap.effects.outside import campaign, clock, since_pose
from beamstiff.se3 import Array

DRIFT = 1e-4  # m over the campaign
TURN = 1e-4  # rad over the campaign
WARMTH = 2e-5  # m/K
GROWTH = 1e-4  # over the campaign: steel that warms by 8 K
WARM = 5.0  # K, over which zeros and lengths go by the sizes above
EXPANSION = 1.2e-5  # 1/K, of steel
DECAYS = (0.1, 0.3, 1.0)  # of the campaign's duration
LAGS = (0.0, 0.05, 0.2)  # of the campaign's duration, by which the machine follows its temperature
TURNING = ("linear", "warming up within 0.3")


def _components(baseline: Baseline) -> list[str | None]:
    rows = baseline.rows
    timed = bool(np.isfinite(rows.time).all() and np.ptp(rows.time) > 0)
    warmed = bool(np.isfinite(rows.temperature).all() and np.ptp(rows.temperature) > 0)
    return [None] if timed or warmed or baseline.stated is not None else []


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:  # noqa: ARG001
    fitted, stated = baseline.fit.rows, baseline.stated is not None
    time = clock(baseline)
    shared = not baseline.absolute and fitted.shared_unloaded
    courses = {"linear": time - 0.5}
    courses |= {f"warming up within {decay:g}": 1 - np.exp(-time / decay) for decay in DECAYS}
    result: list[Shape] = []
    parts = _parts(baseline)
    if stated or not shared:
        result += _in_time(baseline, courses, "")
        result += _by_part(parts, {name: courses[name] for name in TURNING}, "")
    if stated or shared:  # what drifted before the unloaded reading of a posture is in both readings
        since = {name: since_pose(baseline, course) for name, course in courses.items()}
        result += _in_time(baseline, since, ", since the unloaded reading")
        result += _by_part(parts, {name: since[name] for name in TURNING}, ", since the unloaded reading")
    if stated or (np.isfinite(fitted.temperature).all() and np.ptp(fitted.temperature) > 0):
        for lag in LAGS:
            warmth = lagged(baseline, lag)
            label = "temperature" if lag == 0 else f"temperature, lagging by {lag:g}"
            if stated or not shared:
                result.append(Shape(label, _along(warmth), _named("expansion", "m/K", WARMTH)))
                result.append(_turned(baseline, label, warmth))
                result.append(_grown(baseline, f"growing with {label}", warmth))
                result += _by_part(parts, {label: warmth / WARM}, "")
            if stated or shared:
                change = since_pose(baseline, warmth)
                label = f"{label}, since the unloaded reading"
                result.append(Shape(label, _along(change), _named("expansion", "m/K", WARMTH)))
                result.append(_turned(baseline, label, change))
                result.append(_grown(baseline, f"growing with {label}", change))
                result += _by_part(parts, {label: change / WARM}, "")
    return result


def _in_time(baseline: Baseline, courses: dict[str, Array], since: str) -> list[Shape]:
    """Return drifts that follow courses (N,) of the time: each, any mixture, and turning with it."""
    result = [
        Shape(f"{name}{since}", _along(course), _named("drift", "m", DRIFT), weight=0.5)
        for name, course in courses.items()
    ]
    names = [name.replace(" ", "_") for name in courses]
    drifts = tuple(item for name in names for item in _named(f"drift_{name}", "m", 0.5 * DRIFT))
    turns = tuple(
        item for name in TURNING for item in _named(f"turn_{name.replace(' ', '_')}", "rad", 0.5 * TURN)
    )
    every = np.concatenate([_along(course) for course in courses.values()], -1)
    turning = [_turning(baseline, courses[name]) for name in TURNING]
    growing = np.concatenate(
        [_growing(baseline, course) for course in courses.values()]
        + [_lengthening(baseline, course) for course in courses.values()],
        -1,
    )
    growths = (
        *(Quantity(f"growth_{name}", "1", 0.5 * GROWTH) for name in names),
        *(Quantity(f"lengthening_{name}", "m", 0.5 * DRIFT) for name in names),
    )
    return [
        *result,
        Shape(f"any course{since}", every, drifts),
        Shape(f"any course, turning{since}", np.concatenate([every, *turning], -1), (*drifts, *turns)),
        Shape(f"growing{since}", growing, growths),
        Shape(
            f"growing and turning{since}",
            np.concatenate([growing, *turning], -1),
            (*growths, *turns),
        ),
    ]


def _parts(baseline: Baseline) -> dict[str, dict[str, Array]]:
    """Return how the nominal pose (N, 6) changes with each joint's zero, and with each length of a link."""
    robot = baseline.nominal
    names = {
        "zero": [item.name for item in robot.actuated],
        "length": [
            f"{frame.name}.{name}"
            for frame in robot.frames
            for name in ("d", "r")
            if isinstance(getattr(frame, name), float) and getattr(frame, name) != 0.0
        ],
    }
    found: dict[str, dict[str, Array]] = {}
    for what, some in names.items():
        found[what] = {}
        for name in some:
            with suppress(BeamstiffError):  # a loop that cannot close otherwise
                found[what][name] = pose_change(baseline, name)
    return found


def _by_part(parts: dict[str, dict[str, Array]], courses: dict[str, Array], since: str) -> list[Shape]:
    """Return drifts in which each joint's zero, or each link's length, follows the courses (N,) by itself."""
    result = []
    for what, changes in parts.items():
        if not changes:
            continue
        label = " and ".join(courses)
        columns = [change * course[:, None] for course in courses.values() for change in changes.values()]
        size = TURN if what == "zero" else DRIFT
        unit = "rad" if what == "zero" else "m"
        names = [f"{what}_{name}_{course}".replace(" ", "_") for course in courses for name in changes]
        quantities = tuple(Quantity(name, unit, size) for name in names)
        result.append(Shape(f"every {what}, {label}{since}", np.stack(columns, -1), quantities, weight=0.5))
    return result


def lagged(baseline: Baseline, lag: float) -> Array:
    """Return the temperature less its mean (N,), followed with a first-order lag, a share of the time."""
    rows, time = baseline.rows, clock(baseline)
    warmth: Array = np.nan_to_num(rows.temperature - _mean_temperature(baseline))
    if lag == 0:
        return warmth
    result, order = np.zeros_like(warmth), np.argsort(time, kind="stable")
    state, before = float(warmth[order[0]]), float(time[order[0]])
    for row in order.tolist():
        gain = 1 - float(np.exp(-(time[row] - before) / lag))
        state, before = state + gain * (float(warmth[row]) - state), float(time[row])
        result[row] = state
    return result


def _mean_temperature(baseline: Baseline) -> float:
    stated, warmth = stated_scale(baseline, "temperature"), baseline.fit.rows.temperature
    if stated is not None:
        return stated
    return float(warmth.mean()) if np.isfinite(warmth).all() else 0.0


def _scales(baseline: Baseline, component: str | None) -> Scales:  # noqa: ARG001
    return {**asdict(campaign(baseline)), "temperature": _mean_temperature(baseline)}


def _named(what: str, unit: str, size: float) -> tuple[Quantity, ...]:
    return tuple(Quantity(f"{what}_{axis}", unit, size) for axis in "xyz")


def _along(course: Array) -> Array:
    """Return the displacement (N, 6, 3) along x, y and z that follows a course (N,)."""
    result = np.zeros((len(course), 6, 3))
    result[:, [0, 1, 2], [0, 1, 2]] = course[:, None]
    return result


def _growing(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 1) of growing away from the base, following a course (N,)."""
    position = nominal_pose(baseline.nominal, baseline.rows)[0]
    result: Array = course[:, None, None] * np.concatenate([position, 0.0 * position], axis=1)[..., None]
    return result


def _lengthening(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 1) of links that lengthen, along the way from the base to the point."""
    position = nominal_pose(baseline.nominal, baseline.rows)[0]
    reach = np.maximum(np.linalg.norm(position, axis=1, keepdims=True), 1e-9)
    result: Array = _growing(baseline, course) / reach[:, None]
    return result


def _grown(baseline: Baseline, name: str, warmth: Array) -> Shape:
    return Shape(name, _growing(baseline, warmth), (Quantity("growth", "1/K", EXPANSION),), weight=0.5)


def _turned(baseline: Baseline, label: str, warmth: Array) -> Shape:
    columns = np.concatenate([_along(warmth), _turning(baseline, warmth)], -1)
    quantities = (*_named("expansion", "m/K", WARMTH), *_named("turn", "rad/K", TURN * WARMTH / DRIFT))
    return Shape(f"{label}, turning", columns, quantities, weight=0.5)


def _turning(baseline: Baseline, course: Array) -> Array:
    """Return the displacement (N, 6, 3) of turning about the base axes, following a course (N,)."""
    axes = np.broadcast_to(np.eye(3), (len(course), 3, 3))
    position = nominal_pose(baseline.nominal, baseline.rows)[0]
    result: Array = course[:, None, None] * np.concatenate(
        [np.cross(axes, position[:, :, None], axis=1), axes], axis=1
    )
    return result


EFFECT = Effect(
    name="thermal-drift",
    family="measurement",
    meaning="The reading drifts with time or temperature, whatever the load.",
    components=_components,
    shapes=_shapes,
    separation="re-measure the reference pose now and then",
    look_alikes=("outliers",),
    sources="5 to 50 um/K, engineering estimate",
    scales=_scales,
    place="readings",
)
