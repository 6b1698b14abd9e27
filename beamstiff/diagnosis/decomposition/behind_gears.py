"""What encoders behind the gears say of the drives: the difference of both readings is each joint's own slip.

An encoder behind the gear of q2 reads ``q2_link = q2 + s(q, torque) + zero + noise``: wind-up, play, friction
and the curve of the gear by themselves, whatever else bends. So each form of an effect at a joint is fitted
to the differences alone, ``BIC = n log(S / n) + k log n - 2 log prior``, beside a curve of once and twice a
turn that the second encoder may have itself (eccentricity), and beside nothing. The tempered probabilities
are the prior for the positions of the tool, which are other readings (Bayes, one after the other).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.decomposition.forms import REPEATED, Form
from beamstiff.diagnosis.decomposition.open_model import OpenModel, orthonormal
from beamstiff.diagnosis.decomposition.selection import bic
from beamstiff.diagnosis.effects.torque_laws import axis_at, component_of
from beamstiff.diagnosis.prior import TEMPERING, Prior
from beamstiff.se3 import Array

LEAST = 10  # readings of a joint's second encoder, below which they say nothing
OWN_ORDERS = (
    1,
    2,
)  # of the second encoder's own curve: eccentricity, and two reading heads that are not opposite
SLIGHT = 1e-4  # least probability that is handed on: what one kind of reading excludes another may show


@dataclass(frozen=True)
class Behind:
    """What a joint's second encoder says.

    Attributes
    ----------
    component : str
    rms : float, rad or m
        Of the difference to the drive's reading, its mean taken out.
    turns : bool
        Whether the joint is revolute.
    probability : dict of str to float
        Of each effect at the joint; "" is the second encoder itself or nothing.
    """

    component: str
    rms: float
    turns: bool
    probability: dict[str, float]

    @property
    def text(self) -> str:
        """What it says in words."""
        effect = max(self.probability, key=self.probability.__getitem__)
        share = 100 * self.probability[effect]
        said = f"{effect} ({share:.0f} %)" if effect else "noise, or that encoder's own curve"
        size = f"{1e3 * self.rms:.2g} {'mrad' if self.turns else 'mm'} RMS"
        return f"the encoder behind {self.component} differs from the drive's by {size}: {said}"


def behind_gears(model: OpenModel, forms: Sequence[Form], prior: Prior) -> list[Behind]:
    """Return what the second encoders of the rows say; nothing where there are none."""
    return list(_each(model, forms, prior))


def informed(prior: Prior, said: Sequence[Behind]) -> Prior:
    """Return the prior after the second encoders were read."""
    given = {
        f"{effect}:{one.component}": float(np.clip(value, SLIGHT, 1.0 - SLIGHT))
        for one in said
        for effect, value in one.probability.items()
        if effect
    }
    return replace(prior, given={**prior.given, **given})


def _each(model: OpenModel, forms: Sequence[Form], prior: Prior) -> Iterator[Behind]:
    rows, robot = model.baseline.rows, model.baseline.nominal
    for joint in robot.joints:
        if joint.variable not in rows.variables:
            continue
        at, component = rows.variables.index(joint.variable), component_of(robot, joint)
        difference = rows.link[:, at] - rows.q[:, at]
        axis = axis_at(model.baseline, component)
        shift = axis.shift
        square = (shift**2).sum(axis=1)
        read = np.flatnonzero(np.isfinite(difference) & (square > 0.0))
        if len(read) < LEAST:
            continue
        value = _centred(difference[read])
        columns: dict[str, list[Array]] = {}
        for form in forms:
            if form.component == component:
                slip = (form.shape.columns * shift[:, :, None]).sum(axis=1) / np.maximum(square, 1e-300)[
                    :, None
                ]
                columns.setdefault(form.effect, []).append(_centred(slip[read]))
        soft = 0.0 < axis.stiffness < np.inf  # its compliance is fitted beside any cause
        wind = _centred((axis.load + axis.dead)[read][:, None] if soft else np.zeros((len(read), 0)))
        value = _beside(value[:, None], wind)[:, 0]
        columns = {effect: [_beside(one, wind) for one in some] for effect, some in columns.items()}
        turn = rows.q[read, at][:, None] * np.array(OWN_ORDERS)
        own = _beside(_centred(np.concatenate([np.sin(turn), np.cos(turn)], axis=1)), wind)
        likely = {effect: prior.expected(effect, component) for effect in columns}
        rest = max(1.0 - sum(likely.values()), SLIGHT)
        scores = {effect: _best(value, some, effect) for effect, some in columns.items()}
        scores[""] = min(_score(value, own[:, :0]), _score(value, own))
        logs = {e: np.log(likely.get(e, rest)) - 0.5 * score / TEMPERING for e, score in scores.items()}
        most = max(logs.values())
        weights = {effect: float(np.exp(log - most)) for effect, log in logs.items()}
        total = sum(weights.values())
        rms = float(np.sqrt(np.mean(value**2)))
        yield Behind(
            component, rms, axis.turns, {effect: weight / total for effect, weight in weights.items()}
        )


def _best(value: Array, some: Sequence[Array], effect: str) -> float:
    """Return the least BIC of an effect's forms (n, c); of some kinds one after another is taken in."""
    best, chosen = np.inf, np.zeros((len(value), 0))
    for _ in range(len(some) if effect in REPEATED else 1):
        tried = [np.concatenate([chosen, one], axis=1) for one in some]
        scores = [_score(value, one) for one in tried]
        if min(scores) >= best:
            break
        best, chosen = min(scores), tried[int(np.argmin(scores))]
    return best


def _score(value: Array, columns: Array) -> float:
    left = value
    if columns.shape[1]:
        left = value - columns @ np.linalg.lstsq(columns, value, rcond=1e-9)[0]
    return float(bic(float(left @ left), columns.shape[1], len(value), 0.0))


def _beside(columns: Array, fitted: Array) -> Array:
    """Return what fitted columns (n, k) leave of columns (n, c)."""
    basis = orthonormal(fitted)
    return np.asarray(columns - basis @ (basis.T @ columns))


def _centred(values: Array) -> Array:
    """Return values without their mean: nobody knows the zero of a second encoder."""
    return np.asarray(values - values.mean(axis=0))
