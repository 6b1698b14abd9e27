"""Print how well conditioned the stiffness of the robots that come along is, over random poses.

Run as `python benchmarks/condition_numbers.py [POSES]`. The poses lie within the limits; the reduced global
stiffness is scaled to unit diagonal. The IR-663's paper, with 1e15 for rigid and 1e-10 for free, has 1e25.
"""

from __future__ import annotations

import sys

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import Robot, compile_structure, load_robot, posture, robot_names
from beamstiff.fem.assembly import dense_stiffness
from beamstiff.fem.constraints import constraint_rows, has_constraints, null_space, unknown_sizes
from beamstiff.fem.mechanism import scaled_condition
from beamstiff.fem.placed_structure import place
from beamstiff.se3 import Array


def random_poses(robot: Robot, poses: int, seed: int = 0) -> Array:
    """Return joint values (P, A) spread evenly over the limits of the actuated variables, rad or m."""
    limits = np.array([variable.limits for variable in robot.actuated], dtype=np.float64).reshape(-1, 2)
    return np.random.default_rng(seed).uniform(limits[:, 0], limits[:, 1], (poses, len(limits)))


def condition_numbers(robot: Robot, q: Array) -> tuple[int, Array]:
    """Return the number of unknowns and the condition number (P,) of the scaled stiffness at poses (P, A)."""
    structure = compile_structure(robot)
    geometry = place(structure, posture(structure.kinematics, q))
    stiffness = dense_stiffness(structure, geometry)
    if has_constraints(structure):
        basis = null_space(constraint_rows(structure, geometry), unknown_sizes(structure), robot.name)
        stiffness = basis.swapaxes(-1, -2) @ stiffness @ basis
    return stiffness.shape[-1], scaled_condition(stiffness)


def main(poses: int = 1000) -> None:
    """Print a row for each robot."""
    table = Table(title=f"Condition number of the scaled stiffness, {poses} random poses")
    for heading in ("robot", "unknowns", "median", "largest"):
        table.add_column(heading, justify="left" if heading == "robot" else "right")
    for name in robot_names():
        robot = load_robot(name)
        unknowns, found = condition_numbers(robot, random_poses(robot, poses))
        table.add_row(name, str(unknowns), f"{np.median(found):.1e}", f"{found.max():.1e}")
    Console().print(table)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
