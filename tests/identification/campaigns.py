"""Synthetic campaigns for the tests, and the KR240-2's displacement by seed 000, eq. 20."""

from dataclasses import replace
from functools import cache

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian

POSITION, ROTATION = 3e-5, 5e-5


@cache
def kr240() -> Robot:
    return load_robot("kr240-2")


def rows(
    robot: Robot, poses: int, loads: int = 1, *, sigma: bool = True, shared: bool = False
) -> Measurements:
    """Return tests of the KR240-2 at random poses, each with some loads, displacements still zero."""
    random = np.random.default_rng(poses + 100 * loads)
    count = poses * loads
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.repeat(random.uniform(-1, 1, (poses, 6)), loads, axis=0),
        tcp=robot.tcp,
        wrench=random.normal(size=(count, 6)) * [1500, 1500, 1500, 400, 400, 400],
        displacement=np.zeros((count, 6)),
        sigma_position=POSITION if sigma else None,
        sigma_rotation=ROTATION if sigma else None,
        shared_unloaded=shared,
        source="campaign",
    )


def sensitivities(robot: Robot, table: Measurements) -> np.ndarray:
    """Return A (N, 6, 6): displacement by the compliance of each joint, eq. 20."""
    kinematics = compile_kinematics(robot)
    jacobian = twist_jacobian(kinematics, posture(kinematics, table.q), robot.tcp)
    torque = np.einsum("nij,ni->nj", jacobian, table.wrench)
    return jacobian * torque[:, None, :]


def compliances(robot: Robot) -> np.ndarray:
    return 1 / np.array([robot.parameter(name) for name in robot.identify])


def measured(robot: Robot, table: Measurements, noise: np.ndarray | float = 0.0) -> Measurements:
    """Return the table with what the robot does, and noise (N, 6) on top."""
    return replace(table, displacement=predict_displacements(robot, table) + noise)


def white(table: Measurements, seed: int) -> np.ndarray:
    """Return noise (N, 6) as the table states it."""
    return np.random.default_rng(seed).standard_normal((len(table), 6)) * np.repeat([POSITION, ROTATION], 3)


def shared_covariance(table: Measurements) -> np.ndarray:
    """Return the dense covariance (6N, 6N) of rows whose pose shares an unloaded reading."""
    spread = np.tile(np.repeat([POSITION, ROTATION], 3), len(table))
    pose = np.repeat(table.pose, 6)
    component = np.tile(np.arange(6), len(table))
    together = (pose[:, None] == pose) & (component[:, None] == component)
    return 0.5 * (np.eye(len(spread)) + together) * np.outer(spread, spread)


def least_squares(
    a: np.ndarray, d: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the generalised least squares estimate, its covariance, and the sum of whitened squares."""
    weight = np.linalg.inv(covariance)
    inverse = np.linalg.inv(a.T @ weight @ a)
    found = inverse @ a.T @ weight @ d
    rest = d - a @ found
    return found, inverse, float(rest @ weight @ rest)
