"""A serial robot, its poses and the library's linear theory of it, for the simulated machines' tests."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from beamstiff import Robot, compile_structure, load_robot
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.units import quantity
from tests.exam.campaigns import campaign_of, random_poses, read, without_weight

XYZ = ("x", "y", "z")
STILL = np.zeros((1, 6))


def vector(truth: Truth, names: Any = XYZ) -> Array:
    return np.array([truth.parameters[name] for name in names])


def serial() -> tuple[Robot, Array, Array]:
    """Return a robot, poses (6, 6) and its compliance there by the library's linear theory (6, 6, 6)."""
    robot = without_weight(load_robot("kr240-2"))
    q = random_poses(robot, np.random.default_rng(21), 6)
    return robot, q, tcp_compliance(compile_structure(robot), posture(compile_kinematics(robot), q))


def tcp_places(robot: Robot, q: Array) -> Array:
    kinematics = compile_kinematics(robot)
    return posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]


def tcp_axes(robot: Robot, q: Array) -> Array:
    kinematics = compile_kinematics(robot)
    frame = next(node.frame for node in robot.nodes if node.name == robot.tcp)
    return posture(kinematics, q).transforms[:, kinematics.frame_index[frame], :3, :3]


def more(robot: Robot, campaign: SimulatedCampaign, truth: Truth) -> Array:
    """Return what an effect adds to the readings."""
    return read(robot, campaign, truth) - read(robot, campaign)


def seen_at(robot: Robot, q: Array, *truths: Truth) -> Array:
    """Return where the tool of an unloaded machine is read, (P, 3)."""
    return read(robot, campaign_of(robot, q, STILL, kind="absolute"), *truths)[:, :3]


def linear(C: Array, wrench: Array) -> Array:
    """Return displacements of poses (P, 6, 6) under loads (P, S, 6), row by row."""
    return np.einsum("pij,psj->psi", C, wrench).reshape(-1, 6)


def with_errors(robot: Robot, errors: Mapping[str, float]) -> Robot:
    """Return the robot with errors of its frames' parameters, by ``frame.parameter``."""
    frames = []
    for frame in robot.frames:
        named = {n: kind for n, kind in FRAME_PARAMETERS.items() if f"{frame.name}.{n}" in errors}
        update = {
            n: quantity(getattr(frame, n), kind) + errors[f"{frame.name}.{n}"] for n, kind in named.items()
        }
        frames.append(frame.model_copy(update=update))
    return robot.model_copy(update={"frames": tuple(frames)})
