"""Measurement campaigns drawn at random: poses, loads, their order in time, noise and its claim."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import Measurements
from beamstiff.planning.poses import random_poses
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

Design = Literal["rich", "lean"]
Data = Literal["displacement", "absolute"]
Claim = Literal["true", "half", "twice", "absent"]

# how often absolute positions are measured: displacement hardly shows geometry and payload
ABSOLUTE = {"geometry-error": 0.9, "payload-error": 0.9, "tool-offset": 0.4, "none": 0.25}
ABSOLUTE_ELSE = 0.12
CLAIMED: dict[Claim, float] = {"true": 0.6, "half": 0.15, "twice": 0.1, "absent": 0.15}
CLAIMS: dict[Claim, float] = {"true": 1.0, "half": 0.5, "twice": 2.0}
DEFLECTION = 1.3e-3  # m; loads are chosen so that the tool deflects by about this in the middle of the poses
LARGEST_FORCE = 6000.0  # N
MOST_ROWS = 250
LEAN_POSES = 10
FRESH_POSES = 40  # of a crowded machine
ALIKE = 1e-6  # m: the tool of the simulated machine stands where that of the model does

# loads of one direction in the order of time, as parts of the largest
STEPS = (1 / 3, 2 / 3, 1.0)
CYCLE = (1 / 3, 2 / 3, 1.0, 2 / 3, 1 / 3, 0.0)
BOTH_SIGNS = (0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)
FINE = (0.1, 0.25, 0.5, 1.0, -0.1, -0.25, -0.5, -1.0)
PATTERNS = (STEPS, CYCLE, BOTH_SIGNS, FINE)
PATTERN_WEIGHTS = (0.15, 0.25, 0.4, 0.2)
WEIGHT_AND_LOADS = (0.0, 0.5, 1.0)  # of absolute positions: the payload by itself, then loads


@dataclass(frozen=True)
class Wish:
    """What sort of campaign is to be drawn."""

    design: Design
    data: Data
    readings: Literal[3, 6]
    claimed: Claim


def draw_wish(rng: np.random.Generator, truths: Sequence[Truth], lean: float) -> Wish:
    """Return what sort of campaign is to show some effects; `lean`: how many are."""
    effects = [truth.effect for truth in truths] or ["none"]
    absolute = max(ABSOLUTE.get(effect, ABSOLUTE_ELSE) for effect in effects)
    data: Data = "absolute" if rng.random() < absolute else "displacement"
    design: Design = "lean" if rng.random() < lean else "rich"
    readings: Literal[3, 6] = 6 if rng.random() < 0.5 else 3
    claimed = list(CLAIMED)[int(rng.choice(len(CLAIMED), p=list(CLAIMED.values())))]
    return Wish(design, data, readings, claimed)


def draw_campaign(rng: np.random.Generator, robot: Robot, wish: Wish) -> SimulatedCampaign:
    """Return a campaign of the wished sort.

    Rich: 12 to 24 poses in two or three directions of load, of absolute positions 24 to 40 with the payload
    alone and two loads. Lean: ten poses, one load each. Noise 0.02 to 0.05 mm and 2e-5 to 1e-4 rad.
    """
    force = largest_force(robot, rng) * rng.uniform(0.6, 1.4)
    pattern: tuple[float, ...]
    if wish.design == "lean":
        poses, directions, pattern, repeats = LEAN_POSES, 1, (rng.uniform(0.6, 1.0),), 1
    elif wish.data == "absolute":
        poses, directions, pattern = int(rng.integers(24, 41)), 1, WEIGHT_AND_LOADS
        repeats = int(rng.integers(2, 4))
    else:
        directions = int(rng.integers(2, 4))
        pattern = PATTERNS[int(rng.choice(len(PATTERNS), p=PATTERN_WEIGHTS))]
        poses = min(int(rng.integers(12, 25)), max(12, MOST_ROWS // (directions * len(pattern))))
        repeats = int(rng.integers(2, 4))
    cone = wish.design == "lean" and rng.random() < 0.4
    loads = draw_loads(rng, poses, directions, force, cone)
    campaign = _campaign(rng, robot, loads, pattern, repeats)
    sigma = rng.uniform(2e-5, 5e-5), float(np.exp(rng.uniform(np.log(2e-5), np.log(1e-4))))
    claimed = [CLAIMS[wish.claimed] * one if wish.claimed in CLAIMS else None for one in sigma]
    campaign = replace(
        campaign,
        kind=wish.data,
        sigma_position=sigma[0],
        sigma_rotation=sigma[1],
        claimed_position=claimed[0],
        claimed_rotation=claimed[1] if wish.readings == 6 else None,
        shared_unloaded=wish.data == "displacement" and rng.random() < 0.3,
        rotations=wish.readings == 6,
    )
    if wish == replace(wish, design="rich", data="displacement") and rng.random() < 0.15:
        return _twice_seen(rng, robot, campaign)
    return campaign


def draw_fresh(rng: np.random.Generator, robot: Robot, like: SimulatedCampaign) -> SimulatedCampaign:
    """Return new poses with loads in new directions, without noise, measured as `like` was."""
    force = float(np.linalg.norm(like.wrench[:, :3], axis=1).max(initial=0.0)) or largest_force(robot, rng)
    absolute = like.kind == "absolute"
    poses = 20 if absolute else 10
    pattern = WEIGHT_AND_LOADS if absolute else BOTH_SIGNS
    fresh = _campaign(rng, robot, draw_loads(rng, poses, 1, force), pattern)
    return replace(fresh, kind=like.kind, rotations=like.rotations)


def draw_crowded(
    rng: np.random.Generator, robot: Robot, data: Data, force: float, points: tuple[str, ...]
) -> tuple[SimulatedCampaign, SimulatedCampaign]:
    """Return a campaign of a crowded machine, and fresh poses without noise, loaded and warmed up alike.

    Absolute positions: 40 to 60 poses, two thirds of them under a load. Displacements: 12 to 24 poses.
    """
    sigma, absolute = rng.uniform(1e-5, 3e-5), data == "absolute"
    poses = int(rng.integers(40, 61) if absolute else rng.integers(12, 25))
    patterns: tuple[tuple[float, ...], ...] = ((0.0,), (0.0, 1.0), (0.0, 1.0)) if absolute else PATTERNS
    pattern = patterns[int(rng.integers(len(patterns)))]
    campaign, fresh = (
        _campaign(rng, robot, draw_loads(rng, count, 1, force), pattern) for count in (poses, FRESH_POSES)
    )
    time = fresh.time * (campaign.time[-1] / fresh.time[-1])
    fresh = replace(fresh, time=time, temperature=np.interp(time, campaign.time, campaign.temperature))
    campaign, fresh = (replace(seen_at(one, points), kind=data, rotations=False) for one in (campaign, fresh))
    return replace(campaign, sigma_position=sigma, claimed_position=sigma), fresh


def planned(rng: np.random.Generator, plan: Measurements, sigma: tuple[float, float]) -> SimulatedCampaign:
    """Return the campaign of a user's table of tests; `sigma`: noise, m and rad, where it does not say."""
    rows = len(plan)
    position = plan.sigma_position or sigma[0]
    rotation = plan.sigma_rotation or sigma[1]
    rotations = plan.sigma_rotation is not None or bool(plan.measured_mask[:, 3:].any())
    time = np.where(np.isnan(plan.time), 60.0 * np.arange(rows), plan.time)
    _, group = np.unique(plan.pose, return_inverse=True)
    earlier = np.tril(group[:, None] == group[None, :], -1).sum(axis=1)  # rows of the pose before this one
    return SimulatedCampaign(
        q=plan.q,
        wrench=plan.wrench,
        pose=plan.pose,
        step=np.where(np.isnan(plan.step), earlier, plan.step).astype(np.int64),
        time=time,
        temperature=np.where(np.isnan(plan.temperature), _warming(rng, time), plan.temperature),
        point=plan.point,
        load_point=plan.load_point,
        kind=plan.kind,
        sigma_position=position,
        sigma_rotation=rotation,
        claimed_position=position,
        claimed_rotation=rotation if rotations else None,
        shared_unloaded=plan.shared_unloaded,
        rotations=rotations,
    )


def reachable(rng: np.random.Generator, robot: Robot, count: int) -> Array:
    """Return poses (count, A) whose loops close, those first whose tool is above the base frame's height."""
    kinematics = compile_kinematics(robot)
    drawn = random_poses(kinematics, 4 * count, rng)
    drawn = drawn[simulated_alike(robot, drawn)]
    if len(drawn) < count:
        raise BeamstiffError(
            f"robot {robot.name!r}: its loops close alike in the simulator at {len(drawn)} of {4 * count} "
            "poses only: expected limits that keep away from dead centres"
        )
    height = posture(kinematics, drawn).node_positions[:, kinematics.node_index[robot.tcp], 2]
    return drawn[np.argsort(height < 0.0, kind="stable")[:count]]


def simulated_alike(robot: Robot, q: Array) -> NDArray[np.bool_]:
    """Return at which poses (P, A) the simulator closes the loops, and in the assembly of the robot, (P,)."""
    if not robot.loops:
        return np.ones(len(q), dtype=np.bool_)
    kinematics, skeleton = compile_kinematics(robot), skeleton_of(robot)
    tool = next(node for node in robot.nodes if node.name == robot.tcp)
    expected = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]

    def alike(some: Array, there: Array) -> NDArray[np.bool_]:
        try:
            found = place(skeleton, some).node(tool)
        except BeamstiffError:
            if len(some) == 1:
                return np.zeros(1, dtype=np.bool_)
            half = len(some) // 2
            return np.concatenate([alike(some[:half], there[:half]), alike(some[half:], there[half:])])
        return np.asarray(np.abs(found - there).max(axis=1) < ALIKE)

    return alike(q, expected)


def largest_force(robot: Robot, rng: np.random.Generator) -> float:
    """Return a force, N, that moves the tool by `DEFLECTION` in the middle of the machine's poses."""
    structure = compile_structure(robot)
    at = posture(structure.kinematics, random_poses(structure.kinematics, 24, rng))
    softness = np.linalg.norm(tcp_compliance(structure, at)[:, :3, :3], axis=(1, 2)) / np.sqrt(3.0)
    return min(LARGEST_FORCE, DEFLECTION / float(np.median(softness)))


def draw_loads(
    rng: np.random.Generator, poses: int, directions: int, force: float, cone: bool = False
) -> Array:
    """Return the largest wrenches, (poses, directions, 6): forces all around, half of them off centre.

    With `cone` they lie within 20 deg of straight down, as weights on a rope pull.
    """
    towards = rng.normal(size=(poses, directions, 3))
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    if cone:
        towards = np.array([0.0, 0.0, -1.0]) + np.sin(np.deg2rad(20.0)) * towards
        towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    forces = force * towards
    arm = rng.uniform(-0.2, 0.2, size=(poses, directions, 3)) * (rng.random((1, directions, 1)) < 0.5)
    return np.concatenate([forces, np.cross(arm, forces)], axis=-1)


def _campaign(
    rng: np.random.Generator, robot: Robot, loads: Array, pattern: tuple[float, ...], repeats: int = 1
) -> SimulatedCampaign:
    """Return every direction's states pose after pose; the last state of a pose is read `repeats` times."""
    poses, directions = loads.shape[:2]
    q = reachable(rng, robot, poses)
    states = loads[:, :, None, :] * np.array(pattern)[:, None]
    states = states.reshape(poses, directions * len(pattern), 6)
    states = np.concatenate([states, np.repeat(states[:, -1:], repeats - 1, axis=1)], axis=1)
    steps = states.shape[1]
    rows = poses * steps
    pauses = np.full((poses, steps), rng.uniform(20.0, 90.0))
    pauses[:, 0] += rng.uniform(60.0, 300.0)  # the machine moves, the load is taken off
    time = np.cumsum(pauses.reshape(-1)) - pauses[0, 0]
    tcp: NDArray[np.str_] = np.full(rows, robot.tcp)
    return SimulatedCampaign(
        q=np.repeat(q, steps, axis=0),
        wrench=states.reshape(rows, 6),
        pose=np.repeat(np.arange(poses), steps),
        step=np.tile(np.arange(steps), poses),
        time=time,
        temperature=_warming(rng, time),
        point=tcp,
        load_point=tcp.copy(),
    )


def _warming(rng: np.random.Generator, time: Array) -> Array:
    """Return the temperature of a machine that warms up to a new level, read to 0.05 K."""
    rise, lag = rng.uniform(0.0, 8.0), rng.uniform(0.2, 1.0) * max(float(np.ptp(time)), 1.0)
    exact = rng.uniform(18.0, 24.0) + rise * -np.expm1(-(time - time.min()) / lag)
    return np.asarray(np.round((exact + rng.normal(scale=0.05, size=time.shape)) / 0.05) * 0.05)


def _twice_seen(rng: np.random.Generator, robot: Robot, campaign: SimulatedCampaign) -> SimulatedCampaign:
    """Return the campaign with every state seen at a second node too, one that moves."""
    held = {node.name for node in robot.nodes if node.frame == "base"} | {*robot.fixed, robot.tcp}
    nodes = [node.name for node in robot.nodes if node.name not in held]
    if not nodes:
        return campaign
    return seen_at(campaign, (robot.tcp, nodes[int(rng.integers(len(nodes)))]))


def seen_at(campaign: SimulatedCampaign, points: tuple[str, ...]) -> SimulatedCampaign:
    """Return the campaign with every state seen at these nodes."""
    seen = campaign.at(np.repeat(np.arange(len(campaign)), len(points)))
    return replace(seen, point=np.tile(np.array(points), len(campaign)))
