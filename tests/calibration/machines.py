"""Robots and campaigns for the tests of geometric calibration."""

import itertools
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.elastic import elastic_displacement
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import Mass, Node, Rigid
from beamstiff.se3 import Array, rotation_about, rotation_from_vector, transform, vector_from_rotation

DATA = Path(__file__).resolve().parents[2] / "examples" / "data"
JOINTS = tuple(f"J{k}.torsional" for k in range(1, 7))
SIGMA, TURNED = 3e-5, 5e-5  # m, rad


@cache
def serial(stiff: bool = True) -> Robot:
    """Return the KR500 with links that weigh something, two reflectors off the last axis, `stiff` joints."""
    robot = load_robot("kr500")
    masses = (
        Mass(node="n2b", mass="350 kg", at=(0.65, 0, 0)),
        Mass(node="n3b", mass="400 kg", at=(0, 0.2, 0)),
        Mass(node="n6b", mass="250 kg", at=(0.1, 0, 0.2)),
    )
    balls = (
        Node(name="ball", frame="f6", at=(0.05, 0.02, 0.1)),
        Node(name="other", frame="f6", at=(-0.1, 0.1, 0.15)),
    )
    flanges = tuple(Rigid(name=f"to {ball.name}", nodes=("n6b", ball.name)) for ball in balls)
    robot = robot.model_copy(
        update={
            "masses": masses,
            "nodes": (*robot.nodes, *balls),
            "rigids": (*robot.rigids, *flanges),
            "tcp": "ball",
        }
    )
    return robot.with_parameters(dict.fromkeys(JOINTS, np.inf)) if stiff else robot


@cache
def four_bar() -> Robot:
    """Return the IR-663 with wrist and ball screws."""
    return load_robot(DATA / "ir663_wrist.yaml")


def variables(robot: Robot) -> list[str]:
    return [variable.name for variable in robot.actuated]


def within(robot: Robot, count: int, seed: int) -> Array:
    """Return joint values (P, A) within the limits."""
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def four_bar_poses() -> Array:
    """Return joint values (27, 6) of the paper's grid (eq. 59), the tool forward, within 20 deg."""
    grid = np.array(list(itertools.product((1.4, 1.75, 2.1), (-0.3, 0.0, 0.3), (1.4, 1.55, 1.7))))
    tilt = rotation_from_vector(np.radians(20) * np.random.default_rng(0).uniform(-1, 1, (27, 3)))
    wanted = transform(tilt @ rotation_about(1, np.full(27, np.pi / 2)), grid)
    return inverse_geometry(compile_kinematics(four_bar()), wanted, seed=0).q


def machined(robot: Robot, seed: int, size: float = 1e-3, names: Any = None) -> dict[str, float]:
    """Return errors of all usual parameters, 1 mm and 1 mrad."""
    rng = np.random.default_rng(seed)
    every = [f"{frame.name}.{part}" for frame in robot.frames for part in ("alpha", "d", "r", "beta")]
    every += variables(robot) if names is None else []
    return {name: size * rng.standard_normal() for name in (every if names is None else names)}


def measured(
    real: Robot,
    q: Array,
    *,
    noise: float = SIGMA,
    turned: bool = False,
    point: str | None = None,
    wrench: Array | None = None,
    base: Array | None = None,
    target: Array | None = None,
    seed: int = 0,
    stated: bool = True,
) -> Measurements:
    """Return what a machine shows: its geometry, and what gives way."""
    rng = np.random.default_rng([seed, 7])
    seen = real.tcp if point is None else point
    rows = make_measurements(
        variables(real),
        q,
        tcp=real.tcp,
        wrench=wrench,
        position=np.zeros((len(q), 3)),
        point=np.full(len(q), seen),
    )
    kinematics = compile_kinematics(real)
    where = posture(kinematics, q)
    moved = elastic_displacement(real, rows)
    position = where.node_positions[:, kinematics.node_index[seen]] + moved[:, :3]
    rotation = rotation_from_vector(moved[:, 3:]) @ pose_of(kinematics, where, real.tcp)[:, :3, :3]
    if base is not None:
        position, rotation = position @ base[:3, :3].T + base[:3, 3], base[:3, :3] @ rotation
    if target is not None:
        rotation = rotation @ target
    position = position + noise * rng.standard_normal(position.shape)
    rotation = rotation_from_vector(noise / SIGMA * TURNED * rng.standard_normal(position.shape)) @ rotation
    return make_measurements(
        variables(real),
        q,
        tcp=real.tcp,
        wrench=wrench,
        position=position,
        rotation=vector_from_rotation(rotation) if turned else None,
        point=np.full(len(q), seen),
        sigma_position=SIGMA if stated else None,
        sigma_rotation=TURNED if turned and stated else None,
    )


def machine(robot: Robot, errors: Mapping[str, float]) -> Robot:
    """Return a robot that was built with errors."""
    return corrected(robot, errors, within(robot, 1, 0))
