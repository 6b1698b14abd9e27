"""The gray box fitted to displacements: fuzzy corrections of a parametric model's joint compliances."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from beamstiff.identification.models.configuration import Begin, Varying, begin_with, fit_varying
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy_compliance import inputs_of
from beamstiff.model.fuzzy_correction import FuzzyCorrection
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition, equal_parts
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

WORTH = 6.0  # by how much one more set must raise the logarithm of the evidence: many are tried
MOST_RULES = 36
NEAR = 0.4  # share of an input's range over which the corrections of rules are alike


@dataclass(frozen=True, eq=False)
class CorrectionFit:
    """A fitted gray box."""

    model: FuzzyCorrection
    varying: Varying  # what the fit says of the conclusions
    # numbers of sets of the inputs as the structure grew, with the logarithm of the evidence
    sets: tuple[tuple[tuple[int, ...], float], ...]


def fit_fuzzy_correction(
    robot: Robot, table: Measurements, parameters: Sequence[str] | None = None
) -> CorrectionFit:
    """Fit fuzzy corrections of joint compliances to measured displacements.

    Sets are added input by input, one or two at a time (a wave shows with three only), while the evidence
    grows; the conclusions are shrunk towards no correction
    (see `beamstiff.identification.models.configuration`), so that no test set is needed.

    `table`: displacements, loaded minus unloaded. `parameters`: springs that may vary; default
    ``robot.identify``.
    """
    start = begin_with(robot, table, parameters)
    names = table.variables
    x = inputs_of(names, names, table.q)
    trained = np.stack([x.min(axis=0), x.max(axis=0)], axis=1)
    premises = equal_parts(names, trained, [1] * len(names))
    best = _fit(start, premises, x)
    grown = [(premises.sets, best.evidence)]
    while True:
        tried = []
        for at, more in product(np.flatnonzero(np.ptp(trained, axis=1) > 0), (1, 2)):
            sets = [count + more * (one == at) for one, count in enumerate(premises.sets)]
            if np.prod(sets) <= MOST_RULES:
                partition = equal_parts(names, trained, sets)
                tried.append((_fit(start, partition, x), partition))
        if not tried:
            break
        found, partition = max(tried, key=lambda one: one[0].evidence)
        if found.evidence < best.evidence + WORTH:
            break
        best, premises = found, partition
        grown.append((premises.sets, best.evidence))
    system = FuzzySystem(premises, best.change, premises.firing(x).max(axis=0))
    model = FuzzyCorrection(start.robot, start.parameters, start.compliance, system)
    return CorrectionFit(model, best, tuple(grown))


def _fit(start: Begin, premises: Partition, x: Array) -> Varying:
    corners, span = premises.corners(), np.ptp(premises.trained, axis=1)
    apart = (corners[:, None] - corners) / (NEAR * np.where(span > 0, span, 1.0))
    alike = np.exp(-0.5 * (apart**2).sum(axis=2)) + 1e-6 * np.eye(len(corners))
    return fit_varying(start.problem, premises.firing(x), start.compliance, alike)
