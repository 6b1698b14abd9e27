"""A serial robot of six joints before a point tracker, as the public tools were tried: rigid and sagging."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import numpy as np

from beamstiff import Robot, calibrate, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.elastic import elastic_displacement
from beamstiff.calibration.validation import errors_on
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Mass, Node, Rigid
from beamstiff.se3 import Array

SIGMA = 3e-5  # m
POSES, FRESH = 50, 200
LENGTH, ANGLE, ZERO = 1e-3, 1e-3, 2e-3  # standard deviations of the machine's errors, m, rad
LOAD = 1000.0  # N, standard deviation of each component where rows are loaded
JOINTS = tuple(f"J{k}.torsional" for k in range(1, 7))


@cache
def robot(stiff: bool) -> Robot:
    """Return the KR500 with a reflector on its tool; its links weigh something, its joints may be `stiff`."""
    plain = load_robot("kr500")
    masses = (
        Mass(node="n2b", mass="350 kg", at=(0.65, 0, 0)),
        Mass(node="n3b", mass="400 kg", at=(0, 0.2, 0)),
        Mass(node="n6b", mass="250 kg", at=(0.1, 0, 0.2)),
    )
    whole = plain.model_copy(
        update={
            "masses": masses,
            "nodes": (*plain.nodes, Node(name="ball", frame="f6", at=(0.05, 0.02, 0.1))),
            "rigids": (*plain.rigids, Rigid(name="tool", nodes=("n6b", "ball"))),
        }
    )
    return whole.with_parameters(dict.fromkeys(JOINTS, np.inf)) if stiff else whole


def machine(nominal: Robot, seed: int) -> Robot:
    """Return a robot with errors in every frame, encoder and the reflector's place; stiffness off by half."""
    rng = np.random.default_rng([seed, 1])
    errors = {}
    for frame in nominal.frames:
        errors |= {f"{frame.name}.{part}": LENGTH * rng.standard_normal() for part in ("d", "r")}
        errors |= {f"{frame.name}.{part}": ANGLE * rng.standard_normal() for part in ("alpha", "beta")}
    errors |= {variable.name: ZERO * rng.standard_normal() for variable in nominal.actuated}
    errors |= {f"ball.{axis}": LENGTH * rng.standard_normal() for axis in "xyz"}
    factors = rng.uniform(0.6, 1.5, 6)
    stiffness = {name: nominal.parameter(name) * by for name, by in zip(JOINTS, factors, strict=True)}
    return corrected(nominal, errors, np.zeros((1, 6))).with_parameters(stiffness)


def campaign(real: Robot, count: int, seed: int, loaded: float = 0.0) -> Measurements:
    """Return what the tracker sees, the first half of the rows unloaded."""
    rng = np.random.default_rng([seed, 2])
    low, high = np.array([variable.limits for variable in real.actuated]).T
    q = rng.uniform(low, high, (count, 6))
    wrench = np.zeros((count, 6))
    wrench[count // 2 :, :3] = loaded * rng.standard_normal((count - count // 2, 3))
    point = np.full(count, "ball")
    names = [variable.name for variable in real.actuated]

    def table(position: Array) -> Measurements:
        return make_measurements(
            names, q, tcp=real.tcp, wrench=wrench, position=position, point=point, sigma_position=SIGMA
        )

    kinematics = compile_kinematics(real)
    rigid = posture(kinematics, q).node_positions[:, kinematics.node_index["ball"]]
    seen = rigid + elastic_displacement(real, table(rigid))[:, :3]
    return table(seen + SIGMA * rng.standard_normal((count, 3)))


@dataclass(frozen=True)
class Tried:
    """One calibration: parameters identified, errors on fresh poses as measured, m, and its time, s."""

    identified: int
    nominal: float
    mean: float
    largest: float
    seconds: float
    noise: float


def rigid_case(seed: int) -> Tried:
    """Calibrate a robot that does not give way."""
    real = machine(robot(True), seed)
    return _tried(robot(True), campaign(real, POSES, seed), campaign(real, FRESH, 1000 + seed), ())


def sagging_case(seed: int, compliances: bool) -> Tried:
    """Calibrate a robot that sags, half of the rows loaded, with compliances or without."""
    real = machine(robot(False), seed)
    rows, fresh = campaign(real, POSES, seed, LOAD), campaign(real, FRESH, 1000 + seed, LOAD)
    return _tried(robot(True), rows, fresh, JOINTS if compliances else ())


def _tried(nominal: Robot, rows: Measurements, fresh: Measurements, compliances: tuple[str, ...]) -> Tried:
    start = time.perf_counter()
    found = calibrate(nominal, rows, compliances=compliances, folds=0)
    seconds = time.perf_counter() - start
    errors = errors_on(found, fresh)
    return Tried(
        identified=len(found.identifiability.identified),
        nominal=found.before.position_mean or 0.0,
        mean=errors.position_mean or 0.0,
        largest=errors.position_max or 0.0,
        seconds=seconds,
        noise=found.noise,
    )
