"""The machine of `beamstiff demo`: a KR240-2 whose second link bends, as the exam simulates it."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.simulate import simulate
from beamstiff.measure.table import Measurements
from beamstiff.planning.candidates import candidate_poses, force_loads
from beamstiff.robot.description import Robot
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics

SIGMA = 3e-5  # m per axis, of a laser tracker
FORCE = 1500.0  # N
AXES = ("x", "-x", "y", "-y", "z", "-z")
# N m/rad, up to 16 % from the robot file's
DRIVES = {"J1": 3.2e6, "J2": 5.9e6, "J3": 4.3e6, "J4": 5.0e5, "J5": 7.1e5, "J6": 4.7e5}
# a link that is bolted together, drawn by the exam: EI in N m^2, where the robot file has a rigid link
BOLTED = {"EI": 6.34e6, "flat": 0.975, "twist": 0.472, "offset": 0.192, "side": 1.96, "end": 1.0}
FAULT = Truth("link-bending", "link2", "bolted", {**BOLTED, "joint": 0.548, "opens": 0.505})


def campaign(robot: Robot, poses: int, seed: int) -> Measurements:
    """Return what a tracker reads of the machine in some postures, each under forces along x, y and z."""
    postures = candidate_poses(compile_kinematics(robot), poses, seed)
    postures = np.radians(np.degrees(postures).round(1))  # as a table says them
    loads = force_loads(FORCE, AXES)
    return measured(robot, np.repeat(postures, len(loads), axis=0), np.tile(loads, (poses, 1)), seed)


def reached(robot: Robot, commands: Array, near: Array, wrench: Array) -> Array:
    """Return where the machine's tool comes to rest (T, 3) that was sent to commands (T, 4, 4), m.

    `near` (T, 6): joint values nearby. `wrench` (T, 6): on the tool.
    """
    kinematics = compile_kinematics(robot)
    q = inverse_geometry(kinematics, commands, start=near, restarts=0, tolerance=1e-9).q
    return measured(robot, q, wrench, 0, kind="absolute", sigma=0.0).position


def measured(
    robot: Robot,
    q: Array,
    wrench: Array,
    seed: int,
    point: Sequence[str] | None = None,
    kind: Literal["absolute", "displacement"] = "displacement",
    sigma: float = SIGMA,
) -> Measurements:
    """Return what is read of a robot with the fault under loads (N, 6) at joint values (N, 6), with noise."""
    rows, real = len(q), robot.with_parameters({f"{name}.torsional": k for name, k in DRIVES.items()})
    tcp = np.full(rows, robot.tcp)
    states = SimulatedCampaign(
        q=q,
        wrench=wrench,
        pose=np.unique(q, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64),
        step=np.arange(rows, dtype=np.int64),
        time=60.0 * np.arange(rows, dtype=np.float64),
        temperature=np.full(rows, 20.0),
        point=tcp if point is None else np.array(point),
        load_point=tcp,
        kind=kind,
        sigma_position=sigma,
        claimed_position=SIGMA,
        rotations=False,
    )
    return simulate(real, [FAULT], states, np.random.default_rng(seed))
