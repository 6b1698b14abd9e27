"""Campaigns for the tests of the simulated machines."""

import dataclasses
from functools import cache
from typing import Any

import numpy as np

from beamstiff import JointStiffness, Robot
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import Reality
from beamstiff.exam.forms import draw_truth, imposed
from beamstiff.exam.machine import machine_of
from beamstiff.exam.robots import exam_robot, with_payload, with_stiff_drive
from beamstiff.exam.simulate import readings
from tests.arms import planar_arm


def campaign_of(robot: Robot, q: Any, wrench: Any, **other: Any) -> SimulatedCampaign:
    """Return a campaign of P poses (P, A) with S loads each: (P, S, 6), or (S, 6) for all."""
    q, wrench = np.atleast_2d(np.asarray(q, float)), np.asarray(wrench, float)
    if wrench.ndim == 2:
        wrench = np.tile(wrench, (len(q), 1, 1))
    poses, steps = wrench.shape[:2]
    rows = poses * steps
    columns = {
        "q": np.repeat(q, steps, axis=0),
        "wrench": wrench.reshape(rows, 6),
        "pose": np.repeat(np.arange(poses), steps),
        "step": np.tile(np.arange(steps), poses),
        "time": 60.0 * np.arange(rows),
        "temperature": np.full(rows, np.nan),
        "point": np.full(rows, robot.tcp),
        "load_point": np.full(rows, robot.tcp),
    }
    return SimulatedCampaign(**(columns | other))


def random_poses(robot: Robot, rng: np.random.Generator, poses: int, part: float = 0.35) -> Array:
    """Return poses (P, A) in the middle part of the limits, angles within 1 rad of it."""
    limits = np.array([variable.limits for variable in robot.actuated])
    half = np.minimum(part * (limits[:, 1] - limits[:, 0]), 1.0)
    return limits.mean(axis=1) + half * rng.uniform(-1.0, 1.0, (poses, len(limits)))


def random_loads(rng: np.random.Generator, poses: int, factors: Any, force: float = 1000.0) -> Array:
    """Return a direction a pose with forces and moments in it, at each of the factors, (P, S, 6)."""
    direction = rng.standard_normal((poses, 6)) * force * np.repeat([1.0, 0.1], 3)
    return np.asarray(direction[:, None] * np.asarray(factors, float)[None, :, None])


@cache
def loaded_robot(name: str, stiff_drive: bool = False) -> Robot:
    """Return a robot of the exam with a payload, and with a stiff drive where that is asked for."""
    rng = np.random.default_rng(5)
    robot = with_payload(exam_robot(name, rng), 60.0, (0.02, 0.0, 0.1))
    return with_stiff_drive(robot, rng) if stiff_drive else robot


def without_weight(robot: Robot) -> Robot:
    return robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def read(robot: Robot, campaign: SimulatedCampaign, *truths: Truth) -> Array:
    """Return the noise-free readings (N, 6) of a machine with some effects."""
    reality = Reality(machine_of(robot))
    for truth in truths:
        reality = imposed(truth, reality)
    return readings(reality, campaign)


def drawn(
    robot: Robot, effect: str, component: str | None, form: str, seed: int = 0, size: float = 0.7
) -> Truth:
    return draw_truth(np.random.default_rng(seed), robot, effect, size, component, form)


def changed(truth: Truth, **parameters: float) -> Truth:
    return dataclasses.replace(truth, parameters={**truth.parameters, **parameters})


STIFF = 1e6  # N m/rad, of the arm's only drive
LONG = 2.0  # m, of the arm


def arm(stiffness: float = STIFF, gravity: float = 0.0) -> Robot:
    """Return an arm along x that turns about the vertical; its drive is elastic, all else is rigid."""
    stiff = JointStiffness(torsional="rigid" if np.isinf(stiffness) else stiffness)
    named = ["J.torsional"] if np.isfinite(stiffness) else []
    more = {"limits": (-1.0, 1.0), "gravity": (0.0, 0.0, -gravity), "identify": named}
    return planar_arm("arm", (LONG,), (stiff,), "a b tip", ("arm",), ("J",), **more)


def pushed(robot: Robot, wrench: Any, *truths: Truth, q: float = 0.0, **other: Any) -> Array:
    """Return what one load, or a sequence of loads (S, 6), makes a machine with one joint read."""
    loads = np.atleast_2d(np.asarray(wrench, float))
    found = read(robot, campaign_of(robot, [[q]], loads, **other), *truths)
    return found[0] if np.ndim(wrench) == 1 else found


def turned_about_its_axis(robot: Robot, torque: Any, *truths: Truth, q: float = 0.0, **other: Any) -> Array:
    """Return the rotation about the vertical, rad, that torques (S,) at the tip make."""
    loads = np.zeros((len(np.atleast_1d(torque)), 6))
    loads[:, 5] = torque
    return np.asarray(pushed(robot, loads, *truths, q=q, **other)[:, 5])
