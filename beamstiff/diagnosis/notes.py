"""What limits the conclusions, in one sentence each."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import chi2

from beamstiff.diagnosis.effects.torque_laws import turning_drives
from beamstiff.diagnosis.inference.library import ALL_DRIVES, ALL_REVERSED
from beamstiff.diagnosis.residual.baseline import Baseline, fitted_names
from beamstiff.diagnosis.residual.outlier_screening import Screened
from beamstiff.diagnosis.residual.repeats import DIGITS, repeats
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.errors import listed
from beamstiff.measure.table import MEASURED, Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

OFF = 1.5  # a claimed noise is wrong by more than this factor
FEW_POSES = 5
FEW_VALUES = 30
SURE = 0.001  # probability of what repeats show by chance
OF_ALL_AXES = "is it that of all three axes (divide it by 1.7), or two sigma (by 2)?"
MASSLESS = (
    "the robot file has no masses: gravity cannot load its drives, and what the robot's own weight bends is "
    "taken for other causes; give it masses, estimates are enough"
)


def notes(screened: Screened, white: Whitened) -> Iterator[str]:
    """Yield what a reader should know of the data whatever the verdict, beside the doubts of its tables."""
    baseline, rows = screened.baseline, screened.baseline.rows
    poses = np.unique(rows.pose).size
    yield from chosen_for(baseline.nominal)
    yield from undetermined_at(baseline)
    if white.freedom < FEW_VALUES:
        plural = "s"[: white.freedom != 1]
        yield f"only {white.freedom} value{plural} beyond those fitted: no confident verdict is possible"
    elif poses < FEW_POSES:
        yield f"only {poses} posture{'s' * (poses > 1)}: the result may not hold in others"
    if not baseline.claimed:
        yield "the table states no noise: it was estimated together with the effects"
    else:
        for name, factor in zip(("position", "rotation"), screened.noise.tolist(), strict=True):
            if factor > OFF or factor < 1.0 / OFF:
                asks = f", which counts per axis: {OF_ALL_AXES}" if factor < 1.0 else ""
                yield f"the noise of the {name}s is {factor:.2g} times the stated noise{asks}"
    if screened.below_claim:
        yield (
            "the rows scatter by less than a third of the stated noise, as simulated rows do: effects "
            "smaller than the stated noise are ignored"
        )
    yield from _of_repeats(screened)
    yield from unloaded(baseline)
    if rows.wrench.any():
        force = rows.wrench[:, :3]
        values = np.linalg.svd(force / max(float(np.linalg.norm(force)), 1e-300), compute_uv=False)
        if (values > 0.05).sum() < 3:
            yield "the forces do not span all directions: the result does not hold in directions without load"
        loads = force if force.any() else rows.wrench[:, 3:]
        sizes = np.linalg.norm(loads, axis=1)
        if np.ptp(sizes[sizes > 0]) < 0.05 * sizes.max():
            yield "one load level only: nonlinear effects can hardly show"


def notes_of_verdict(
    screened: Screened, verdict: str, scale: float, off: Array | None = None
) -> Iterator[str]:
    """Yield what limits a verdict of one cause, or two.

    `verdict`: name of the effect, ``none`` or ``unknown``.
    `scale`: of the noise that the verdict leaves, against the sigma counted with.
    `off`: (N, 6); how far each row is from what the verdict says, m and rad.
    """
    if verdict == "unknown":
        yield (
            "the cause may also be in the table: joint columns in another order, loads or readings in "
            "another frame, another tool"
        )
    if verdict == "none" and screened.baseline.claimed and scale > OFF:
        yield (
            f"the residual is {scale:.2g} times the assumed noise: either that noise is wrong, or an effect "
            "acts that these rows cannot show"
        )
    if count := len(screened.outliers):
        rows = screened.baseline.rows
        places = [
            rows.place(row) if off is None else f"{rows.place(row)} ({off_by(rows, row, off[row])})"
            for row in screened.outliers.tolist()
        ]
        yield f"left out as {'outliers' if count > 1 else 'an outlier'}: {listed(places, 3)}"


def off_by(rows: Measurements, row: int, off: Array) -> str:
    """Return, in words, along which axis a row is off the most, and by how much, of (6,), m and rad.

    Rotations where no position was measured, or none is off.
    """
    off = np.abs(np.nan_to_num(off))
    at = int(off[:3].argmax()) if off[:3].any() else 3 + int(off[3:].argmax())
    along = MEASURED[rows.kind][at] if np.isnan(rows.direction[row]).all() else "the reading"
    return f"{along} off by {1e3 * off[at]:#.3g} {'mm' if at < 3 else 'mrad'}"


def unloaded(baseline: Baseline) -> Iterator[str]:
    """Yield what rows without a load leave unseen."""
    if baseline.rows.wrench.any():
        if massless(baseline) and turning_drives(baseline.nominal):
            yield MASSLESS
        return
    if not baseline.absolute:
        yield "no row carries a load: no compliance can show"
    elif not weightless(baseline):
        yield "no row carries a load: only compliance under the machine's own weight can show"
    else:
        yield (
            "no row carries a load, and the robot weighs nothing: sag under its weight looks like an "
            "angle-curve or geometry-error; give it `masses`, estimates are enough"
        )


def weightless(baseline: Baseline) -> bool:
    """Return whether neither a load nor a weight that the robot file knows acts in absolute rows."""
    return massless(baseline) and not baseline.rows.wrench.any()


def massless(baseline: Baseline) -> bool:
    """Return whether absolute rows are of a robot that weighs nothing in its file, though gravity acts."""
    places = (*baseline.places.joints.values(), *baseline.places.links.values())
    heavy = any(place.dead.any() for place in places)
    return baseline.absolute and any(baseline.nominal.gravity) and not heavy


def unstated_loads(baseline: Baseline) -> float:
    """Return how far readings of one posture lie apart in one direction though no load is stated, m; or 0.

    Loads that a table does not state move all postures much the same way. Noise, and friction in joints that
    are moved at random, move them in directions without a common mean: of n of them, three times n times the
    squared mean over the mean square is about chi-squared with three degrees of freedom.
    """
    rows = baseline.rows
    if rows.wrench.any() or not baseline.absolute:
        return 0.0
    names = np.unique(rows.point, return_inverse=True)[1][:, None]
    states = np.concatenate([np.round(rows.q, DIGITS), names], axis=1)
    state = np.unique(states, axis=0, return_inverse=True)[1]
    whole = baseline.used[:, :3].all(axis=1)
    apart = []
    for own in (np.flatnonzero((state.reshape(-1) == at) & whole) for at in range(state.max() + 1)):
        if own.size > 1:
            apart.append(baseline.measured[own[1:], :3].mean(axis=0) - baseline.measured[own[0], :3])
    if not apart:
        return 0.0
    mean = np.mean(apart, axis=0)
    noise = 2.0 * OFF**2 * float((baseline.sigma[whole, :3] ** 2).sum(axis=1).mean())
    square = max(float(np.mean(np.square(apart).sum(axis=1))), noise)
    common = 3.0 * len(apart) * float(mean @ mean) / square
    return float(np.linalg.norm(mean)) if chi2.sf(common, 3) < SURE else 0.0


def chosen_for(robot: Robot) -> Iterator[str]:
    """Yield what is fitted of a robot that does not name it."""
    if robot.identify:
        return
    if names := fitted_names(robot):
        yield (
            f"robot {robot.name!r} names nothing under `identify:`: the stiffness of its "
            f"joints about or along their axes is fitted: {listed(names, 12)}"
        )
    else:
        yield (
            f"robot {robot.name!r}: all drives are rigid in this file, so that no stiffness is fitted; give "
            "them start values: beamstiff convert IN --joint-stiffness '1e6 N*m/rad' --out OUT"
        )


def order_taken(baseline: Baseline, named: set[str]) -> Iterator[str]:
    """Yield that the order of absolute rows is taken for that of measuring, where it decides.

    `named`: effects that are named, or ``unknown``: what a wrong order hides looks like nothing known.
    """
    decides = not named.isdisjoint({"approach-direction", "target-slip", "unknown"})
    if decides and baseline.absolute and np.isnan(baseline.rows.time).any():
        yield (
            "not every row has a time t: rows are taken as measured in the order of the table. If they were "
            "sorted or shuffled since, approach-direction and target-slip are missed or wrong"
        )


def undetermined_at(baseline: Baseline) -> Iterator[str]:
    """Yield where rigid parts of loops leave directions open in which no effect can be tested."""
    by_reason: dict[str, list[str]] = {}
    for name, why in baseline.places.held.items():
        by_reason.setdefault(why, []).append(name)
    for why, names in by_reason.items():
        yield f"{listed(names, 12)}: not all directions can be tested there: {why}"


def _of_repeats(screened: Screened) -> Iterator[str]:
    found = repeats(screened.baseline)
    if not found.freedom.any():
        yield "no state was measured twice: the data alone cannot separate noise from model error"
        return
    for kind, (name, factor, unit) in enumerate((("position", 1e3, "mm"), ("rotation", 1e3, "mrad"))):
        # against the claim, which the baseline's sigma no longer is
        ratio = found.noise[kind] * screened.noise[kind]
        if screened.baseline.claimed and found.likely[kind] < SURE and not 1 / OFF < ratio < OFF:
            yield f"repeats scatter {ratio:.2g} times as much as the stated {name} noise"
        if found.steady[kind] < SURE:
            yield f"repeated {name}s drift by {3600 * factor * found.drift[kind]:.2g} {unit} an hour"


def in_words(keys: Sequence[str]) -> str:
    """Return effects, ``effect:component`` each, in words; names with spaces in quotation marks.

    >>> in_words(["backlash:q2", "thermal-drift:null", "joint-compliance:null"])
    'backlash at q2, thermal-drift, joint-compliance of all joints'
    """
    words = []
    for key in keys:
        effect, _, name = key.partition(":")
        place = f" at {quoted(name)}" if name not in ("", "null") else ""
        words.append(f"{effect} of all joints" if key in (ALL_DRIVES, ALL_REVERSED) else effect + place)
    return ", ".join(words)


def quoted(name: str) -> str:
    """Return a name as a sentence holds it.

    >>> quoted("link2"), quoted("upper arm")
    ('link2', '"upper arm"')
    """
    return f'"{name}"' if any(sign.isspace() or sign == "," for sign in name) else name
