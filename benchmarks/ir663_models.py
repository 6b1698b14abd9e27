"""The IR-663 with its ball screws, and models that do not know of them (seed 003, 3.3 and table 5).

The machine is `ir663-screws` or `ir663-screws-beams` (its slider-cranks' lengths are ours); the parametric
model is `ir663`, with constant springs about axes 2 and 8 as in the paper. As there: 63 poses in the plane,
300, 600, 900 and 1100 N along x and z, all models fitted to the 900 N alone and judged by all rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.identification.models.side_by_side import Models, Options, fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

POSES = 63
LOADS = (300.0, 600.0, 900.0, 1100.0)  # N
SIGMA = 35e-6 / np.sqrt(3.0)  # m, of a component: the paper's mean difference is 35 um
ACROSS, UP = np.linspace(1.25, 2.25, 9), np.linspace(0.85, 2.15, 7)  # m: the paper's grid
MODELS = ("parametric", "fuzzy", "grid", "gray box", "gaussian process")
# table 5: RMS, largest norm by load, mm
PAPER = {
    "parametric": {
        300.0: (0.082, 0.142),
        600.0: (0.093, 0.184),
        900.0: (0.122, 0.282),
        1100.0: (0.136, 0.371),
    },
    "fuzzy": {300.0: (0.064, 0.138), 600.0: (0.052, 0.160), 900.0: (0.057, 0.144), 1100.0: (0.084, 0.183)},
}
PAPER_ALL = {"parametric": 0.110, "fuzzy": 0.065}


@dataclass(frozen=True)
class Both:
    """The same poses of the model and of the machine.

    Attributes
    ----------
    model, machine : (P, 2) arrays
        Actuated variables of either.
    on_grid : int
        How many of them are the paper's; the rest of its grid is out of reach, and drawn near it instead.
    """

    model: Array
    machine: Array
    on_grid: int


def poses(model: Robot, machine: Robot, seed: int = 0) -> Both:
    """Return the poses of the paper's grid that both reach, and more at random up to its number."""
    grid = np.stack([*np.meshgrid(ACROSS, [0.0], UP)], axis=-1).reshape(-1, 3)
    q, r = _reached(model, machine, grid)
    found, random = len(q), np.random.default_rng(seed)
    while len(q) < POSES:
        at = random.uniform([1.1, 0.0, 0.6], [2.4, 0.0, 2.15], (40, 3))
        more_q, more_r = _reached(model, machine, at)
        q, r = np.concatenate([q, more_q]), np.concatenate([r, more_r])
    return Both(q[:POSES], r[:POSES], found)


def _reached(model: Robot, machine: Robot, at: Array) -> tuple[Array, Array]:
    one, other = (
        inverse_geometry(compile_kinematics(robot), at, tolerance=1e-7, restarts=10)
        for robot in (model, machine)
    )
    both = one.reached & other.reached
    return one.q[both], other.q[both]


def campaign(machine: str, seed: int = 0) -> tuple[Robot, Measurements, Both]:
    """Return the parametric model's robot, the readings with its joint variables, and the poses."""
    model, true = load_robot("ir663"), load_robot(machine)
    both = poses(model, true)
    loads = np.zeros((2 * len(LOADS), 6))
    loads[: len(LOADS), 0] = loads[len(LOADS) :, 2] = np.negative(LOADS)
    wrench = np.tile(loads, (POSES, 1))
    names = [variable.name for variable in true.actuated]
    rows = make_measurements(names, np.repeat(both.machine, len(loads), axis=0), tcp=true.tcp, wrench=wrench)
    seen = predict_displacements(true, rows)[:, :3]
    seen = seen + SIGMA * np.random.default_rng(seed).standard_normal(seen.shape)
    table = make_measurements(
        [variable.name for variable in model.actuated],
        np.repeat(both.model, len(loads), axis=0),
        tcp=model.tcp,
        wrench=wrench,
        displacement=seen,
        sigma_position=SIGMA,
        source=f"simulated {machine}",
    )
    return model, table, both


def table_5(machine: str, seed: int = 0, share: float = 0.0) -> Models:
    """Return the models fitted to the 900 N rows; with a share of the poses held out, or none."""
    model, table, _ = campaign(machine, seed)
    return fit_models(model, table, split_rows(table, share, 900.0, seed), MODELS, Options(seed=seed))
