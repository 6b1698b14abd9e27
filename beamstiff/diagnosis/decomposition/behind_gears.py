"""What encoders behind the gears say of the drives: the difference of both readings is each joint's own slip.

An encoder behind the gear of q2 reads ``q2_link = q2 + s(q, torque) + zero + noise``: wind-up, play,
friction and the curve of the gear by themselves, whatever else bends. So each form of an effect that turns
the joint is fitted to the differences alone, ``BIC = n log(S / n) + k log n``, effects taken in one after
another, among them a curve of once and twice a turn that the second encoder may have itself (eccentricity).
The odds of each, beside the others, are tempered and become the prior for the positions of the tool, which
are other readings (Bayes, one after the other).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logit

from beamstiff.diagnosis.decomposition.fit import bic
from beamstiff.diagnosis.decomposition.forms import REPEATED, Form
from beamstiff.diagnosis.decomposition.open_model import OpenModel, orthonormal
from beamstiff.diagnosis.effects.torque_laws import axis_at, component_of
from beamstiff.diagnosis.prior import TEMPERING, Prior
from beamstiff.measure.arrays import Integers
from beamstiff.se3 import Array

LEAST = 10  # readings of a joint's second encoder, below which they say nothing
OWN_ORDERS = (
    1,
    2,
)  # of the second encoder's own curve: eccentricity, and two reading heads that are not opposite
OWN = "its own curve"
OWN_LIKELY = 0.15  # as likely as a curve of the drive
LARGEST = 0.1  # rad or m: no gear slips so much; then sign, unit or joint of the column is another
ALONG = 0.01  # of a column, that may lie across the joint's own motion: axes move a little in a calibration
SLIGHT = 1e-4  # least probability that is handed on: what one kind of reading excludes another may show


@dataclass(frozen=True)
class Behind:
    """What a joint's second encoder says.

    Attributes
    ----------
    component : str
    rms : float, rad or m
        Of the difference to the drive's reading, the mean of each table taken out.
    turns : bool
        Whether the joint is revolute.
    probability : dict of str to float
        Of each effect at the joint, and of the second encoder's own curve (`OWN`); empty where the readings
        do not belong together.
    """

    component: str
    rms: float
    turns: bool
    probability: dict[str, float]

    @property
    def text(self) -> str:
        """What it says in words."""
        unit = "mrad" if self.turns else "mm"
        start = (
            f"the encoder behind {self.component} differs from the drive's by {1e3 * self.rms:.2g} {unit} RMS"
        )
        if not self.probability:
            return f"{start}: not used, no gear slips so much; check the sign, unit and joint of the column"
        shown = {name: share for name, share in self.probability.items() if share > 0.5}
        found = [f"{name} ({100 * share:.0f} %)" for name, share in shown.items()]
        return f"{start}: {', '.join(found) or 'no effect shows, beside the wind-up of a spring'}"


def behind_gears(model: OpenModel, forms: Sequence[Form], prior: Prior) -> list[Behind]:
    """Return what the second encoders of the rows say; nothing where there are none."""
    return list(_each(model, forms, prior))


def informed(prior: Prior, said: Sequence[Behind]) -> Prior:
    """Return the prior after the second encoders were read."""
    given = {
        f"{effect}:{one.component}": float(np.clip(value, SLIGHT, 1.0 - SLIGHT))
        for one in said
        for effect, value in one.probability.items()
        if effect != OWN
    }
    return replace(prior, measured={**prior.measured, **given})


def _each(model: OpenModel, forms: Sequence[Form], prior: Prior) -> Iterator[Behind]:
    rows, robot = model.baseline.rows, model.baseline.nominal
    for joint in robot.joints:
        component = component_of(robot, joint)
        if joint.variable not in rows.variables or component != joint.variable:
            continue
        at = rows.variables.index(joint.variable)
        axis = axis_at(model.baseline, component)
        size = np.linalg.norm(axis.shift, axis=1)
        read = np.flatnonzero(np.isfinite(rows.link[:, at]) & (size > 0.0))
        if len(read) < LEAST:
            continue
        run = rows.run[read]
        difference = _around_mean(rows.link[read, at] - rows.q[read, at], run, axis.turns)
        rms = float(np.sqrt(np.mean(difference**2)))
        if rms > LARGEST:
            yield Behind(component, rms, axis.turns, {})
            continue
        columns: dict[str, list[Array]] = {}
        for form in forms:
            slip = (form.shape.columns * axis.shift[:, :, None]).sum(axis=1)[read] / size[read, None] ** 2
            across = form.shape.columns[read] - axis.shift[read][:, :, None] * slip[:, None]
            whole = np.abs(form.shape.columns[read]).max(initial=0.0)
            if form.component == component and np.abs(across).max(initial=0.0) <= ALONG * whole:
                columns.setdefault(form.effect, []).append(_centred(slip, run))
        if axis.turns:
            turn = rows.q[read, at][:, None] * np.array(OWN_ORDERS)
            columns[OWN] = [_centred(np.concatenate([np.sin(turn), np.cos(turn)], axis=1), run)]
        wind = np.zeros((len(read), 0))
        if 0.0 < axis.stiffness < np.inf:  # its compliance is fitted beside any cause
            wind = _centred((axis.load + axis.dead)[read][:, None], run)
        likely = {name: OWN_LIKELY if name == OWN else prior.expected(name, component) for name in columns}
        yield Behind(component, rms, axis.turns, probabilities(difference, wind, columns, likely))


def probabilities(
    value: Array, wind: Array, columns: Mapping[str, Sequence[Array]], likely: Mapping[str, float]
) -> dict[str, float]:
    """Return the probability of each effect beside the others that show, by name.

    The differences `value` (n,), fitted beside `wind` (n, k).
    """
    value = _beside(value[:, None], wind)[:, 0]
    forms = {name: [_beside(one, wind) for one in some] for name, some in columns.items()}

    def best_of(names: Sequence[str]) -> float:
        return _best(value, [forms[name] for name in names], [name in REPEATED for name in names])

    chosen: list[str] = []
    while True:
        now = best_of(chosen)
        gain = {
            name: logit(likely[name]) + 0.5 * (now - best_of([*chosen, name])) / TEMPERING
            for name in forms
            if name not in chosen
        }
        best = max(gain, key=gain.__getitem__, default="")
        if not best or gain[best] <= 0.0:
            break
        chosen.append(best)
    others = {name: [one for one in chosen if one != name] for name in forms}
    return {
        name: float(expit(logit(likely[name]) + 0.5 * (best_of(rest) - best_of([*rest, name])) / TEMPERING))
        for name, rest in others.items()
    }


def _best(value: Array, effects: Sequence[Sequence[Array]], repeated: Sequence[bool]) -> float:
    """Return the BIC of effects, each in its best form (n, c) after those before; some in several forms."""
    fitted = np.zeros((len(value), 0))
    best = score(value, fitted)
    for some, again in zip(effects, repeated, strict=True):
        best = np.inf
        for _ in range(len(some) if again else 1):
            tried = [np.concatenate([fitted, one], axis=1) for one in some]
            scores = [score(value, one) for one in tried]
            if min(scores) >= best:
                break
            best, fitted = min(scores), tried[int(np.argmin(scores))]
    return best


def score(value: Array, columns: Array) -> float:
    """Return the criterion of a fit of columns (n, c) to values (n,)."""
    basis = orthonormal(columns)
    left = value - basis @ (basis.T @ value)
    return float(bic(float(left @ left), basis.shape[1], len(value), 0.0))


def _around_mean(angle: Array, run: Integers, turns: bool) -> Array:
    """Return differences about the mean of each table, of angles the short way round."""
    result = angle.copy()
    for one in np.unique(run):
        own = run == one
        if turns:
            mean = np.angle(np.exp(1j * angle[own]).mean())
            result[own] = np.angle(np.exp(1j * (angle[own] - mean)))
    return _centred(result[:, None], run)[:, 0]


def _centred(values: Array, run: Integers) -> Array:
    """Return values (n, c) without the mean of each table: nobody knows the zero of a second encoder."""
    result = values.copy()
    for one in np.unique(run):
        result[run == one] -= values[run == one].mean(axis=0)
    return result


def _beside(columns: Array, fitted: Array) -> Array:
    """Return what fitted columns (n, k) leave of columns (n, c)."""
    basis = orthonormal(fitted)
    return np.asarray(columns - basis @ (basis.T @ columns))
