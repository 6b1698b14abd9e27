"""`thermal-drift`: measured positions drift with time or temperature, loaded or not."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace

import numpy as np

from beamstiff.diagnosis.effects.cycles import HARMONICS, cycle_of, waves
from beamstiff.diagnosis.effects.drift_basis import LAGS, any_course, lagged, mean_temperature, steady, usual
from beamstiff.diagnosis.effects.drifts import (
    DRIFT,
    TURN,
    along,
    by_part,
    growing,
    of_the_tool_alone,
    of_the_whole,
    parts_of,
    turning,
)
from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape, named
from beamstiff.diagnosis.effects.external import clock, clock_of, first_of_pose, since_pose
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

WARMTH = 2e-5  # m/K
WARM = 5.0  # K, over which zeros and lengths go by the sizes above
EXPANSION = 1.2e-5  # 1/K, of steel
TURNING = ("linear", "warming up within 0.3")
WAVES = ("sine", "cosine")
FEWER = 4  # modes of any course that every part follows
NONE: Mapping[str, Array] = {}
SHORT = 30.0  # spread of what has drifted since the unloaded reading, a small part of the campaign ago


def _components(baseline: Baseline) -> list[str | None]:
    rows = baseline.rows
    timed = bool(np.isfinite(rows.time).all() and np.ptp(rows.time) > 0)
    warmed = bool(np.isfinite(rows.temperature).all() and np.ptp(rows.temperature) > 0)
    return [None] if timed or warmed or baseline.stated is not None else []


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    fitted, stated = baseline.fit.rows, baseline.stated is not None
    time = np.clip(clock(baseline), 0.0, 1.0)  # how a drift went on after the campaign nobody saw: it stays
    shared = not baseline.absolute and fitted.shared_unloaded
    courses = usual(time)
    modes, begun = any_course(time), steady(baseline)
    result: list[Shape] = []
    parts = parts_of(baseline)
    # a zero, a length or a tool that was off before positions were measured is an error, not a drift
    ahead = {name: course for name, course in begun.items() if name != "before"}
    if stated or not shared:
        common, any_own = (_from_the_start(law, time) for law in (usual, any_course))
        result += _in_time(baseline, courses, modes, "", begun)
        result += _of_parts(baseline, parts, common, any_own, "", ahead)
    if stated or shared:  # what drifted before the unloaded reading of a posture is in both readings
        since = {name: since_pose(baseline, course) for name, course in courses.items()}
        moved = {name: since_pose(baseline, mode) for name, mode in modes.items()}
        short = _in_time(baseline, since, moved, ", since the unloaded reading")
        short += _of_parts(baseline, parts, since, moved, ", since the unloaded reading")
        result += [replace(one, prior_factor=SHORT, realistic=one.prior_factor) for one in short]
    if stated or (np.isfinite(fitted.temperature).all() and np.ptp(fitted.temperature) > 0):
        warmth = {
            "temperature" if lag == 0 else f"temperature, lagging by {lag:g}": lagged(baseline, lag)
            for lag in LAGS
        }
        if stated or not shared:
            result += _with_warmth(baseline, parts, warmth, "", begun, ahead)
        if stated or shared:
            change = {name: since_pose(baseline, course) for name, course in warmth.items()}
            short = _with_warmth(baseline, parts, change, ", since the unloaded reading")
            result += [replace(one, prior_factor=SHORT, realistic=one.prior_factor) for one in short]
    return [*result, *_cycling(baseline, shared)]


def by_temperature(shape: Shape) -> bool:
    """Return whether a drift follows the temperature, which comes again, and not the time of a campaign."""
    return "temperature" in shape.name


def _from_the_start(law: Callable[[Array], dict[str, Array]], time: Array) -> dict[str, Array]:
    """Return courses (N,) that are zero when the campaign starts."""
    start = law(np.zeros(1))
    return {name: course - start[name] for name, course in law(time).items()}


def _cycling(baseline: Baseline, shared: bool) -> list[Shape]:
    """Return drifts to and fro, as heaters and coolers make that switch on and off."""
    cycle = cycle_of(baseline, shared)
    if cycle.count == 0:
        return []
    counts = cycle.count * np.array(HARMONICS)
    result: list[Shape] = []
    for since in ("", ", since the unloaded reading"):
        if baseline.stated is None and bool(since) != shared:
            continue
        found = waves(clock(baseline), counts, first_of_pose(baseline) if since else None)
        begun = {} if since else steady(baseline)
        turned = [
            (turning(baseline, found[:, 0, side]), named(f"turn_{name}", "rad", TURN))
            for side, name in enumerate(WAVES)
        ]
        still = [(along(course), named(f"drift_{name}", "m", DRIFT)) for name, course in begun.items()]
        for label, harmonics in (("one wave", HARMONICS[:1]), ("cycle", HARMONICS)):
            drifts = [
                (along(found[:, at, side]), named(f"drift_{name}_{times}", "m", DRIFT / times**2))
                for at, times in enumerate(harmonics)
                for side, name in enumerate(WAVES)
            ]
            for ending, more in (("", []), (", turning", turned)):
                terms, weight = [*drifts, *still, *more], 0.5 / cycle.choices
                name = f"{label}{ending}{since}"
                result.append(Shape.of(name, *terms, weight=weight, data_selected=True))
    return result


def _in_time(
    baseline: Baseline,
    courses: dict[str, Array],
    modes: dict[str, Array],
    since: str,
    begun: Mapping[str, Array] = NONE,
) -> list[Shape]:
    """Return drifts that follow courses (N,) of the time: each, any mixture, and turning with it."""
    single = [
        Shape(f"{name}{since}", along(course), named("drift", "m", DRIFT), weight=0.5)
        for name, course in courses.items()
    ]
    return [*single, *of_the_whole(baseline, {**modes, **begun}, "any course", since)]


def _of_parts(
    baseline: Baseline,
    parts: dict[str, dict[str, Array]],
    courses: dict[str, Array],
    modes: dict[str, Array],
    since: str,
    begun: Mapping[str, Array] = NONE,
) -> list[Shape]:
    """Return drifts in which each part, or the tool, follows courses (N,) of the time by itself."""
    common = {**{name: courses[name] for name in TURNING}, **begun}
    few = {**dict(list(modes.items())[:FEWER]), **begun}
    result = [by_part({what: parts[what]}, common, " and ".join(TURNING), since) for what in parts]
    return [
        *result,
        *([by_part(parts, few, "any course", since)] if parts else []),
        *of_the_tool_alone(baseline, {**modes, **begun}, "any course", since),
    ]


def _with_warmth(
    baseline: Baseline,
    parts: dict[str, dict[str, Array]],
    warmth: dict[str, Array],
    since: str,
    begun: Mapping[str, Array] = NONE,
    ahead: Mapping[str, Array] = NONE,
) -> list[Shape]:
    """Return drifts that follow the temperature less its mean, with each lag (N,), and with any.

    The whole has what had `begun` as well, its parts what had `ahead`.
    """
    result = []
    for name, course in warmth.items():
        label = f"{name}{since}"
        drift = (along(course), named("expansion", "m/K", WARMTH))
        turn = (turning(baseline, course), named("turn", "rad/K", TURN * WARMTH / DRIFT))
        growth = (growing(baseline, course), (Quantity("growth", "1/K", EXPANSION),))
        result += [
            Shape.of(label, drift),
            Shape.of(f"{label}, turning", drift, turn, weight=0.5),
            Shape.of(f"growing with {label}", growth, weight=0.5),
            *(by_part({what: parts[what]}, {name: course / WARM}, name, since) for what in parts),
        ]
    share = {name: course / WARM for name, course in warmth.items()}
    label = "temperature, with any lag"
    result += of_the_whole(baseline, share | dict(begun), label, since)
    own = share | dict(ahead)
    result += of_the_tool_alone(baseline, own, label, since)
    return [*result, *([by_part(parts, own, label, since)] if parts else [])]


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    shared = not baseline.absolute and baseline.fit.rows.shared_unloaded
    cycles = cycle_of(baseline, shared).count
    found: Normalisation = {**asdict(clock_of(baseline)), "temperature": mean_temperature(baseline)}
    return found | ({"cycles": cycles} if cycles else {})


EFFECT = Effect(
    name="thermal-drift",
    family="measurement",
    meaning="Measured positions drift with time or temperature, whatever the load.",
    components=_components,
    shapes=_shapes,
    separation="measure the reference pose again from time to time",
    look_alikes=("outliers",),
    sources="5 to 50 um/K, engineering estimate",
    scales=_normalisation,
    place="readings",
)
