"""The KR500 in its cubes (seed 001): a simulated campaign, and models with the measurements each needed.

The machine is the exam's (rigid bodies, nonlinear springs, equilibrium on the deformed machine), so no model
here shares its equations. What it lacks of a rigid robot with six constant springs is invented:

- *as published*: drives whose compliance ripples with their own angle, by a factor of three and more either
  way, which nobody has seen in a drive; drawn and sized until the paper's first two numbers come out: what
  the payload does, and what one stiffness leaves. What cubes leave is then no longer chosen;
- *by posture*: the same ripple of all drives with the sum of the first three angles. The Gaussian process
  expects that drives tend to follow their own angle; here they do not;
- *as usual*: gears whose lever changes with the angle on joints 2 and 3, joint 3 hardening, links 2 and 3
  bending.

Where the paper's workspace lies and how its tool points it does not say; here the tool points down, where the
payload moves it by what the paper measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.effect import Reality
from beamstiff.exam.forms import imposed
from beamstiff.exam.laws import Situation, varying
from beamstiff.exam.machine import TURN, machine_of
from beamstiff.exam.simulate import readings
from beamstiff.identification.identify import identify
from beamstiff.identification.models.fuzzy import fit_fuzzy, fit_fuzzy_correction
from beamstiff.identification.models.gaussian_process import fit_gaussian_process
from beamstiff.identification.models.grid import fit_grid
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.grid import Cubes
from beamstiff.model.grid_sampling import point_in_each, sample, sampling_points
from beamstiff.model.protocol import Model, RigidModel, StructuralModel
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

LOW, SIZE = np.array([1.7, -0.6, 0.8]), (0.6, 1.2, 0.6)  # m: 600 x 1200 x 600 mm
CUBES = {
    600: Cubes(LOW, 0.6, (1, 2, 1)),
    300: Cubes(LOW, 0.3, (2, 4, 2)),
    150: Cubes(LOW, 0.15, (4, 8, 4)),
}
DOWN = np.diag([-1.0, 1.0, -1.0])  # the tool's z axis points down
HOME = np.deg2rad([0.0, -60.0, 100.0, 0.0, 40.0, 0.0])
PAYLOAD = -50.0 * 9.81  # N, along z
SIGMA = 2e-5  # m, of a component of a reading
# seed, logarithm of the ripple, and compliance over the published one: invented, see `published`
DRAWN, RIPPLE, SOFTER = 2, 1.1, 0.714
WAVES = ((np.deg2rad(60.0), 1.0), (np.deg2rad(27.0), 0.5))  # length, share


def published(robot: Robot) -> Reality:
    """Return the machine whose drives ripple with their own angles: the paper's gap, from invented causes."""
    return _rippling(robot, {str(joint.variable): (str(joint.variable),) for joint in robot.joints})


def by_posture(robot: Robot) -> Reality:
    """Return the machine whose drives all ripple with how far the arm is turned and leans."""
    return _rippling(robot, {str(joint.variable): ("q1", "q2", "q3") for joint in robot.joints})


def _rippling(robot: Robot, follows: Mapping[str, Sequence[str]]) -> Reality:
    random, machine = np.random.default_rng(DRAWN), machine_of(robot)
    for joint in robot.joints:
        phases = random.uniform(0, 2 * np.pi, len(WAVES))
        law = _ripple(follows[str(joint.variable)], joint.stiffness.torsional / SOFTER, phases)
        machine = machine.with_law(joint.name, TURN, varying(law))
    return Reality(machine)


def _ripple(variables: Sequence[str], mean: float, phases: Array) -> Callable[[Situation], Array]:
    def stiffness(situation: Situation) -> Array:
        angle = np.sum([situation.values[name] for name in variables], axis=0)
        waves = [
            share * np.sin(2 * np.pi * angle / length + p)
            for (length, share), p in zip(WAVES, phases, strict=True)
        ]
        k: Array = mean * np.exp(-RIPPLE * np.sum(waves, axis=0))
        return k

    return stiffness


def usual(robot: Robot) -> Reality:
    """Return the machine with what drives and links do, of usual size."""
    truths = [
        Truth(
            "actuator-lever",
            name,
            "geared",
            {"crank": 0.3, "frame": 1.0, "start": 1.05, "gear": 0.7, "way": 1.0, "middle": middle},
        )
        for name, middle in (("q2", -0.96), ("q3", 1.66))
    ]
    truths += [
        Truth("hardening", "q3", "exponential", {"soft": 0.7, "hard": 1.2, "bend": 1e-4}),
        Truth("link-bending", "link2", "tapered", {"EI": 2e7, "flat": 0.8, "twist": 0.6, "taper": 0.3}),
        Truth("link-bending", "link3", "tapered", {"EI": 1.5e7, "flat": 0.8, "twist": 0.6, "taper": 0.3}),
    ]
    reality = Reality(machine_of(robot))
    for truth in truths:
        reality = imposed(truth, reality)
    return reality


def measured(robot: Robot, reality: Reality, q: Array, seed: int | None) -> Measurements:
    """Return displacements under the payload in postures (N, A), with noise, or without for no seed."""
    n, wrench = len(q), np.zeros((len(q), 6))
    wrench[:, 2] = PAYLOAD
    tcp, still = np.full(n, robot.tcp), np.zeros(n, dtype=np.int64)
    campaign = SimulatedCampaign(
        q, wrench, np.arange(n), still, 60.0 * np.arange(n), np.full(n, 20.0), tcp, tcp, rotations=False
    )
    seen = readings(reality, campaign)[:, :3]
    if seed is not None:
        seen = seen + SIGMA * np.random.default_rng(seed).standard_normal(seen.shape)
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=seen, sigma_position=SIGMA)


@dataclass(frozen=True, eq=False)
class Row:
    """How a model does at the check points.

    Attributes
    ----------
    name : str
    measurements : int
        Rows that it was fitted to.
    errors : (P,) array, m
        Position error at each check point.
    published : float or None, m
        What the paper reached with it.
    """

    name: str
    measurements: int
    errors: Array
    published: float | None = None

    @property
    def mean(self) -> float:
        """Mean error, m."""
        return float(self.errors.mean())

    @property
    def largest(self) -> float:
        """Largest error, m."""
        return float(self.errors.max())


@dataclass(frozen=True)
class Bench:
    """The robot, the machine, and the check points without noise."""

    robot: Robot
    reality: Reality
    check: Measurements

    def row(self, name: str, model: Model, measurements: int, published: float | None = None) -> Row:
        """Return how a model does."""
        gap = self.check.displacement[:, :3] - model.predict(self.check.q, self.check.wrench)[:, :3]
        return Row(name, measurements, np.linalg.norm(gap, axis=1), published)

    def sampled(self, positions: Array, seed: int) -> Measurements:
        """Return readings at positions, the tool turned three ways at each."""
        found = sample(compile_kinematics(self.robot), positions, DOWN, start=HOME)
        return measured(self.robot, self.reality, found.q[found.reached], seed)

    def scattered(self, count: int, seed: int) -> Measurements:
        """Return readings at random positions, the tool turned at random by up to 10 degrees."""
        random = np.random.default_rng(seed)
        at = LOW + np.array(SIZE) * random.uniform(size=(count, 3))
        kinematics = compile_kinematics(self.robot)
        turns = random.uniform(-10.0, 10.0, count)
        q = [sample(kinematics, one[None], DOWN, [turn], HOME).q for one, turn in zip(at, turns, strict=True)]
        return measured(self.robot, self.reality, np.concatenate(q), seed)


def bench(truth: Callable[[Robot], Reality], seed: int = 5) -> Bench:
    """Return the check points of seed 001: one at random in every cube of 150 mm."""
    robot = load_robot("kr500")
    points = point_in_each(CUBES[150], np.random.default_rng(seed))
    found = sample(compile_kinematics(robot), points, DOWN, [0.0], HOME)
    reality = truth(robot)
    return Bench(robot, reality, measured(robot, reality, found.q[found.reached], None))


def study(
    at: Bench, sizes: tuple[int, ...] = (600, 300, 150), counts: tuple[int, ...] = (27, 54, 108)
) -> list[Row]:
    """Return the paper's models, then ours."""
    robot = at.robot
    paper = {600: 0.0989e-3, 300: 0.0761e-3, 150: 0.0581e-3}
    rows = [at.row("none", RigidModel(), 0, 0.2567e-3)]
    whole = at.sampled(
        sampling_points(replace(CUBES[600], counts=(1, 1, 1), low=np.zeros(3), size=1.0)) * SIZE + LOW, 1
    )
    one = StructuralModel(identify(robot, whole, folds=0).robot)
    rows.append(at.row("one stiffness", one, len(whole), 0.1049e-3))
    ours = []
    for size in sizes:
        cubes, table = CUBES[size], at.sampled(sampling_points(CUBES[size]), 2)
        fits = [fit_grid(robot, table, cubes, shrink=False)]
        fits += [fit_grid(robot, table, cubes, interpolate=smooth) for smooth in (False, True)]
        name = f"{cubes.count} cubes of {size} mm"
        rows.append(at.row(name, fits[0].model.extrapolating(), len(table), paper[size]))
        ours.append(at.row(f"{name}, shrunk", fits[1].model.extrapolating(), len(table)))
        ours.append(at.row(f"{name}, shrunk and interpolated", fits[2].model.extrapolating(), len(table)))
    for count in counts:
        table = at.scattered(count, 3)
        ours.append(
            at.row(
                "one stiffness, random poses", StructuralModel(identify(robot, table, folds=0).robot), count
            )
        )
        if count >= 54:
            ours.append(at.row("fuzzy, random poses", fit_fuzzy(robot, table).model.extrapolating(), count))
        ours.append(
            at.row("gray box, random poses", fit_fuzzy_correction(robot, table).model.extrapolating(), count)
        )
        ours.append(at.row("gaussian process, random poses", fit_gaussian_process(robot, table).model, count))
    return rows + ours
