"""`thermal-drift`: the reading drifts with time or temperature, loaded or not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import lru_cache

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.gap.baseline import Baseline, nominal_pose
from beamstiff.gap.effects.cycles import HARMONICS, cycle_of, waves
from beamstiff.gap.effects.effect import Effect, Quantity, Scales, Shape, stated_scale
from beamstiff.gap.effects.geometry_error import pose_change
from beamstiff.gap.effects.outside import campaign, clock, first_of_pose, since_pose
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
WAVES = (1, 2, 3)  # half waves over the campaign, as of a hall that warms and cools
MODES, FEWER = 5, 4  # of any course: of the whole, and of every part
NONE: Mapping[str, Array] = {}
SHORT = 30.0  # spread of what has drifted since the unloaded reading, a small part of the campaign ago


def _components(baseline: Baseline) -> list[str | None]:
    rows = baseline.rows
    timed = bool(np.isfinite(rows.time).all() and np.ptp(rows.time) > 0)
    warmed = bool(np.isfinite(rows.temperature).all() and np.ptp(rows.temperature) > 0)
    return [None] if timed or warmed or baseline.stated is not None else []


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:  # noqa: ARG001
    fitted, stated = baseline.fit.rows, baseline.stated is not None
    time = clock(baseline)
    shared = not baseline.absolute and fitted.shared_unloaded
    courses = _courses(time)
    modes, begun = _modes(time), _begun(baseline)
    result: list[Shape] = []
    parts = _parts(baseline)
    if stated or not shared:
        result += _in_time(baseline, courses, modes, "", begun)
        result += _of_parts(parts, courses, modes, "", begun)
    if stated or shared:  # what drifted before the unloaded reading of a posture is in both readings
        since = {name: since_pose(baseline, course) for name, course in courses.items()}
        moved = {name: since_pose(baseline, mode) for name, mode in modes.items()}
        short = _in_time(baseline, since, moved, ", since the unloaded reading")
        short += _of_parts(parts, since, moved, ", since the unloaded reading")
        result += [replace(one, spread=SHORT, realistic=one.spread) for one in short]
    if stated or (np.isfinite(fitted.temperature).all() and np.ptp(fitted.temperature) > 0):
        warmth = {
            "temperature" if lag == 0 else f"temperature, lagging by {lag:g}": lagged(baseline, lag)
            for lag in LAGS
        }
        if stated or not shared:
            result += _with_warmth(baseline, parts, warmth, "", begun)
        if stated or shared:
            change = {name: since_pose(baseline, course) for name, course in warmth.items()}
            short = _with_warmth(baseline, parts, change, ", since the unloaded reading")
            result += [replace(one, spread=SHORT, realistic=one.spread) for one in short]
    return [*result, *_cycling(baseline, shared)]


def _cycling(baseline: Baseline, shared: bool) -> list[Shape]:
    """Return drifts to and fro, as heaters and coolers make that switch on and off."""
    cycle = cycle_of(baseline, shared)
    if cycle.count == 0:
        return []
    counts = cycle.count * np.array(HARMONICS)
    result = []
    for since in ("", ", since the unloaded reading"):
        if baseline.stated is None and bool(since) != shared:
            continue
        found = waves(clock(baseline), counts, first_of_pose(baseline) if since else None)
        drifts: list[Array] = []
        names: list[Quantity] = []
        for at, harmonic in enumerate(HARMONICS):
            for side, name in enumerate(("sine", "cosine")):
                drifts.append(_along(found[:, at, side]))
                names += _named(f"drift_{name}_{harmonic}", "m", DRIFT / harmonic**2)
        if not since and (baseline.stated is not None or not baseline.absolute):
            drifts.append(_along(_begun(baseline)["begun"]))
            names += _named("drift_begun", "m", DRIFT)
        turning = [_turning(baseline, found[:, 0, side]) for side in range(2)]
        turns = [item for name in ("sine", "cosine") for item in _named(f"turn_{name}", "rad", TURN)]
        weight = 0.5 / cycle.choices
        result += [
            Shape(f"cycle{since}", np.concatenate(drifts, -1), tuple(names), weight=weight, tuned=True),
            Shape(
                f"cycle, turning{since}",
                np.concatenate([*drifts, *turning], -1),
                (*names, *turns),
                weight=weight,
                tuned=True,
            ),
        ]
    return result


def _begun(baseline: Baseline) -> dict[str, Array]:
    """Return the course (N,) of what had drifted when the first unloaded reading was taken.

    Of absolute positions it is no drift but the frame's place, or a geometry error.
    """
    if baseline.absolute and baseline.stated is None:
        return {}
    return {"begun": np.full(len(baseline.rows), 0.0 if baseline.absolute else 1.0)}


def _courses(time: Array) -> dict[str, Array]:
    """Return the courses (N,) that are common, of the time in campaigns."""
    result = {"linear": time - 0.5}
    return result | {f"warming up within {decay:g}": 1 - np.exp(-time / decay) for decay in DECAYS}


def _table(time: Array) -> Array:
    """Return courses (N, m) of which any is a mixture."""
    waves = [np.cos(np.pi * k * time) for k in WAVES]
    return np.stack([*_courses(time).values(), *waves], -1)


def _modes(time: Array) -> dict[str, Array]:
    """Return the main modes (N,) of any course, at times in campaigns: their mean is no drift."""
    mean, mixture = _mixture()
    return {f"mode {k + 1}": mode for k, mode in enumerate(((_table(time) - mean) @ mixture).T)}


@lru_cache
def _mixture() -> tuple[Array, Array]:
    """Return the mean of the courses (m,) and what mixes them into their main modes, (m, MODES).

    As for `Following`: a course drawn from the family is as large (RMS) as a linear one.
    """
    table = _table(np.linspace(0.0, 1.0, 101))
    mean = table.mean(axis=0)
    size = table.std(axis=0)
    _, _, right = np.linalg.svd((table - mean) / size, full_matrices=False)
    sign = np.where(right @ np.cos(np.arange(right.shape[1])) < 0, -1.0, 1.0)[:MODES]
    mixture: Array = sign * right[:MODES].T * size[0] / np.sqrt(right.shape[1]) / size[:, None]
    return mean, mixture


def _in_time(
    baseline: Baseline,
    courses: dict[str, Array],
    modes: dict[str, Array],
    since: str,
    begun: Mapping[str, Array] = NONE,
) -> list[Shape]:
    """Return drifts that follow courses (N,) of the time: each, any mixture, and turning with it."""
    single = [
        Shape(f"{name}{since}", _along(course), _named("drift", "m", DRIFT), weight=0.5)
        for name, course in courses.items()
    ]
    return [*single, *_whole(baseline, {**modes, **begun}, "any course", since)]


def _whole(baseline: Baseline, courses: dict[str, Array], label: str, since: str) -> list[Shape]:
    """Return drifts of the whole machine that follow any mixture of courses (N,)."""
    names = [name.replace(" ", "_").replace(",", "") for name in courses]

    def all_of(change: Callable[[Array], Array]) -> Array:
        return np.concatenate([change(course) for course in courses.values()], -1)

    drifts = tuple(item for name in names for item in _named(f"drift_{name}", "m", DRIFT))
    turns = tuple(item for name in names for item in _named(f"turn_{name}", "rad", TURN))
    growths = (
        *(Quantity(f"growth_{name}", "1", GROWTH) for name in names),
        *(Quantity(f"lengthening_{name}", "m", DRIFT) for name in names),
    )
    every, turning = all_of(_along), all_of(lambda course: _turning(baseline, course))
    growing = np.concatenate(
        [
            all_of(lambda course: _growing(baseline, course)),
            all_of(lambda course: _lengthening(baseline, course)),
        ],
        -1,
    )
    return [
        Shape(f"{label}{since}", every, drifts),
        Shape(f"{label}, turning{since}", np.concatenate([every, turning], -1), (*drifts, *turns)),
        Shape(f"growing, {label}{since}", growing, growths),
        Shape(
            f"growing and turning, {label}{since}",
            np.concatenate([growing, turning], -1),
            (*growths, *turns),
        ),
    ]


def _of_parts(
    parts: dict[str, dict[str, Array]],
    courses: dict[str, Array],
    modes: dict[str, Array],
    since: str,
    begun: Mapping[str, Array] = NONE,
) -> list[Shape]:
    """Return drifts in which each part follows courses (N,) of the time by itself."""
    common = {**{name: courses[name] for name in TURNING}, **begun}
    few = {**dict(list(modes.items())[:FEWER]), **begun}
    result = [_by_part({what: parts[what]}, common, " and ".join(TURNING), since) for what in parts]
    return [*result, *([_by_part(parts, few, "any course", since)] if parts else [])]


def _with_warmth(
    baseline: Baseline,
    parts: dict[str, dict[str, Array]],
    warmth: dict[str, Array],
    since: str,
    begun: Mapping[str, Array] = NONE,
) -> list[Shape]:
    """Return drifts that follow the temperature less its mean, with each lag (N,), and with any."""
    result = []
    for name, course in warmth.items():
        label = f"{name}{since}"
        result += [
            Shape(label, _along(course), _named("expansion", "m/K", WARMTH)),
            _turned(baseline, label, course),
            _grown(baseline, f"growing with {label}", course),
            *(_by_part({what: parts[what]}, {name: course / WARM}, name, since) for what in parts),
        ]
    share = {**{name: course / WARM for name, course in warmth.items()}, **begun}
    result += _whole(baseline, share, "temperature, with any lag", since)
    return [*result, *([_by_part(parts, share, "temperature, with any lag", since)] if parts else [])]


def _parts(baseline: Baseline) -> dict[str, dict[str, Array]]:
    """Return how the nominal pose (N, 6) changes with each joint's zero, each link's length and its tilt."""
    robot = baseline.nominal
    names = {
        "zero": [item.name for item in robot.actuated],
        "length": [
            f"{frame.name}.{name}"
            for frame in robot.frames
            for name in ("d", "r")
            if isinstance(getattr(frame, name), float) and getattr(frame, name) != 0.0
        ],
        # a link that is warm on one side bends, and tilts the axis that it carries
        "tilt": [f"{frame.name}.alpha" for frame in robot.frames if isinstance(frame.alpha, float)],
    }
    found: dict[str, dict[str, Array]] = {}
    for what, some in names.items():
        found[what] = {}
        for name in some:
            with suppress(BeamstiffError):  # a loop that cannot close otherwise
                found[what][name] = pose_change(baseline, name)
    return {what: changes for what, changes in found.items() if changes}


def _by_part(parts: dict[str, dict[str, Array]], courses: dict[str, Array], label: str, since: str) -> Shape:
    """Return the drift in which each part, a zero, a length or a tilt, follows the courses (N,) by itself."""
    columns, quantities = [], []
    for what, changes in parts.items():
        for course_name, course in courses.items():
            for name, change in changes.items():
                own = f"{what}_{name}_{course_name}".replace(" ", "_").replace(",", "")
                size, unit = (DRIFT, "m") if what == "length" else (TURN, "rad")
                columns.append(change * course[:, None])
                quantities.append(Quantity(own, unit, size))
    kinds = " and ".join(parts)
    return Shape(f"every {kinds}, {label}{since}", np.stack(columns, -1), tuple(quantities), weight=0.5)


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
    shared = not baseline.absolute and baseline.fit.rows.shared_unloaded
    cycles = cycle_of(baseline, shared).count
    found: Scales = {**asdict(campaign(baseline)), "temperature": _mean_temperature(baseline)}
    return found | ({"cycles": cycles} if cycles else {})


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
