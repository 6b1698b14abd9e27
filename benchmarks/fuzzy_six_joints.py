"""Fuzzy rules of all six joints and the wrench for all six components, against the machine's own structure.

The machine is the KR240-2 as its file says: six constant springs. So the parametric model is right, and what
fuzzy rules leave is the price of knowing nothing of it (seed 003, 3.3.3, proposes a gray box instead).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.identification.identify import identify
from beamstiff.identification.models.fuzzy import fit_fuzzy, fit_fuzzy_correction
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.model.protocol import Model, StructuralModel

SIGMA = 3e-5  # m and rad
MIDDLE, HALF = np.array([0.0, -0.9, 1.3, 0.0, 0.6, 0.0]), np.array([0.6, 0.3, 0.3, 0.5, 0.5, 0.5])  # rad
LOAD = np.array([900.0, 900.0, 900.0, 200.0, 200.0, 200.0])  # N, N m


@dataclass(frozen=True)
class Left:
    """Share of displacements and of rotations, root mean square, that a model leaves on fresh poses."""

    name: str
    readings: int
    rules: int
    position: float
    rotation: float


def rows(robot: Robot, count: int, seed: int, noise: float = SIGMA) -> Measurements:
    """Return readings in random postures under random wrenches."""
    random = np.random.default_rng(seed)
    q, wrench = MIDDLE + HALF * random.uniform(-1, 1, (count, 6)), LOAD * random.normal(size=(count, 6))
    names = [variable.name for variable in robot.actuated]
    still = make_measurements(names, q, tcp=robot.tcp, wrench=wrench)
    seen = predict_displacements(robot, still) + noise * random.standard_normal((count, 6))
    known = {"sigma_position": SIGMA, "sigma_rotation": SIGMA}
    return make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=seen, **known)


def study(counts: tuple[int, ...] = (200, 600)) -> list[Left]:
    """Return what each model leaves."""
    robot = load_robot("kr240-2")
    fresh, found = rows(robot, 500, 99, noise=0.0), []
    for count in counts:
        table = rows(robot, count, 1)
        fuzzy = fit_fuzzy(robot, table).model
        gray = fit_fuzzy_correction(robot, table).model
        models: list[tuple[str, Model, int]] = [
            ("fuzzy", fuzzy.extrapolating(), fuzzy.system.premises.count),
            ("gray box", gray.extrapolating(), gray.system.premises.count),
            ("parametric", StructuralModel(identify(robot, table, folds=0).robot), 0),
        ]
        for name, model, rules in models:
            gap = model.predict(fresh.q, fresh.wrench) - fresh.displacement
            share = [
                float(np.sqrt((gap[:, part] ** 2).mean() / (fresh.displacement[:, part] ** 2).mean()))
                for part in (slice(0, 3), slice(3, 6))
            ]
            found.append(Left(name, count, rules, share[0], share[1]))
    return found
