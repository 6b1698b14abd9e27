"""Machines and loads whose answers the tests work out themselves, by statics and rigid-body motion."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from beamstiff import Beam, JointStiffness, Mass, Material, Robot, Section, load_robot
from beamstiff.diagnosis.effects import EFFECTS, Shape
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, predict
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.reader import parse_robot
from beamstiff.se3 import Array
from tests.arms import planar_arm

UPPER, FORE = 1.2, 0.8  # m, links of the elbow arm
SHOULDER, ELBOW = 2e6, 5e5  # N m/rad
POSITION, ROTATION = 3e-5, 5e-5  # m, rad: usual noise of the campaigns
ONCE = "no state was measured twice: the data alone cannot separate noise from model error"


def elbow(mass: float = 0.0, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), **second: Any) -> Robot:
    """Return an arm of two joints about the vertical; `second` is stiffness of the second beside its own."""
    own = JointStiffness(**({"torsional": ELBOW} | second))
    return planar_arm(
        "elbow",
        (UPPER, FORE),
        (SHOULDER, own),
        "foot hub end pin tip",
        ("upper", "fore"),
        limits=(-3.0, 3.0),
        gravity=gravity,
        masses=[Mass(node="tip", mass=mass)] if mass else [],
        identify=["J1.torsional", *(["J2.torsional"] if np.isfinite(own.torsional) else [])],
    )


def rows_of(robot: Robot, q: Any, wrench: Any, **more: Any) -> Measurements:
    """Return rows of a robot, displacements still zero; other columns by name."""
    wrench = np.atleast_2d(np.asarray(wrench, dtype=np.float64))
    q = np.broadcast_to(np.atleast_2d(np.asarray(q, dtype=np.float64)), (len(wrench), len(robot.actuated)))
    if "position" not in more:
        more = {"displacement": np.zeros((len(q), 6))} | more
    return make_measurements([item.name for item in robot.actuated], q, tcp=robot.tcp, wrench=wrench, **more)


def at_random(robot: Robot, count: int, seed: int, reach: float = 1.0, **more: Any) -> Measurements:
    """Return rows of a robot in as many postures about the middle of its limits, under random wrenches."""
    rng = np.random.default_rng(seed)
    limits = np.array([item.limits for item in robot.actuated])
    half = np.minimum(0.35 * (limits[:, 1] - limits[:, 0]), reach)
    q = limits.mean(axis=1) + half * rng.uniform(-1, 1, (count, len(limits)))
    wrench = rng.standard_normal((count, 6)) * [800, 800, 800, 200, 200, 200]
    return rows_of(robot, q, wrench, **more)


def cycles(robot: Robot, poses: int, shares: Any, seed: int = 1, **more: Any) -> Measurements:
    """Return rows of random postures, each under shares of its own random wrench."""
    once, loads = at_random(robot, poses, seed), len(shares)
    wrench = np.repeat(once.wrench, loads, axis=0) * np.tile(shares, poses)[:, None]
    pose = np.repeat(np.arange(poses), loads)
    more = {"pose": pose, "sigma_position": POSITION, "sigma_rotation": ROTATION} | more
    return rows_of(robot, once.q[pose], wrench, **more)


def sound(load: float = 1.0, noise: float = 1.0) -> Measurements:
    """Return 40 rows of the elbow arm as described; `load` and `noise` are times the usual and the stated."""
    rows = at_random(elbow(), 40, seed=1, sigma_position=POSITION, sigma_rotation=ROTATION)
    rows = replace(rows, wrench=load * rows.wrench)
    error = noise * np.random.default_rng(2).standard_normal((40, 6)) * rows.sigma
    return replace(rows, displacement=predict(elbow(), rows) + error)


def nominal(robot: Robot, rows: Measurements) -> Baseline:
    """Return the baseline of rows that read what the robot says, so that nothing is left to fit."""
    if rows.kind == "displacement":
        return fit_baseline(robot, replace(rows, displacement=predict(robot, rows)))
    return fit_baseline(robot, rows)


def shape_of(baseline: Baseline, effect: str, component: str | None, name: str) -> Shape:
    """Return one shape of an effect by its name."""
    return next(one for one in EFFECTS[effect].shapes(baseline, component) if one.name == name)


def close(found: Array, expected: Array, share: float = 1e-9, least: float = 1e-15) -> None:
    """Ask for agreement within a share of the largest displacement, and of the largest rotation."""
    assert found.shape == expected.shape
    for part in (slice(0, 3), slice(3, 6)):
        scale = np.abs(expected[:, part]).max()
        np.testing.assert_allclose(found[:, part], expected[:, part], rtol=0, atol=share * scale + least)


def unexplained(moved: Array, *columns: Array) -> float:
    """Return the share of a displacement (N, 6) that columns (N, 6, c) of any size do not explain."""
    every = np.concatenate(columns, axis=-1).reshape(moved.size, -1)
    size = np.linalg.norm(every, axis=0)
    every = every[:, size > 0] / size[size > 0]
    rest = moved.ravel() - every @ np.linalg.lstsq(every, moved.ravel())[0]
    return float(np.linalg.norm(rest) / np.linalg.norm(moved))


def by_compliance_of(robot: Robot, rows: Measurements, name: str) -> Array:
    """Return the derivative (N, 6) of the prediction by the compliance of a parameter."""
    value = robot.parameter(name)
    compliance = 1 / value if np.isfinite(value) else 0.0
    # of second order: what is left out is 1e-6 of the derivative, what rounds off far less
    step = max(1e-3 * compliance, 1e-12 if not name.endswith(".E") else 0.0)
    here, first, second = (
        predict_displacements(robot.with_parameters({name: 1 / c if c else value}), rows)
        for c in (compliance, compliance + step, compliance + 2 * step)
    )
    return (4 * first - second - 3 * here) / (2 * step)


def bent(robot: Robot, link: str, EI: float, twist: float = 1.3, EA: float = 1e10) -> Robot:
    """Return a robot with a beam of round section in place of a rigid; ``GJ = EI / twist``."""
    rigid = next(item for item in robot.rigids if item.name == link)
    E = 2e11
    section = Section(A=EA / E, Iy=EI / E, Iz=EI / E, J=1.0)
    beam = Beam(name=link, nodes=rigid.nodes, section="bent", material="bent")
    update = {
        "rigids": tuple(item for item in robot.rigids if item is not rigid),
        "beams": (*robot.beams, beam),
        "sections": {**robot.sections, "bent": section},
        "materials": {**robot.materials, "bent": Material(E=E, G=EI / twist)},
    }
    return robot.model_copy(update=update)


@cache
def kr240() -> Robot:
    return load_robot("kr240-2")


def lift() -> Robot:
    """Return an arm of three joints on a column of 1 to 3 m, which is rigid, and turns at its foot."""
    return parse_robot(LIFT)


LIFT = """\
beamstiff: 1
name: lift
variables:
  - {name: q1, type: revolute, limits: ["-170 deg", "170 deg"]}
  - {name: height, type: prismatic, limits: [1.0, 3.0]}
  - {name: q2, type: revolute, limits: ["-80 deg", "80 deg"]}
  - {name: q3, type: revolute, limits: ["-120 deg", "120 deg"]}
frames:
  - {name: turret, theta: q1}
  - {name: head, parent: turret, r: height}
  - {name: upper, parent: head, alpha: -90 deg, theta: q2}
  - {name: fore, parent: upper, d: 0.8, theta: q3}
nodes:
  - {name: ground}
  - {name: foot, frame: turret}
  - {name: top, frame: head}
  - {name: shoulder, frame: upper}
  - {name: elbow, frame: upper, at: [0.8, 0, 0]}
  - {name: wrist, frame: fore}
  - {name: tool, frame: fore, at: [0.7, 0, 0.1]}
rigids:
  - {name: column, nodes: [foot, top]}
  - {name: arm, nodes: [shoulder, elbow]}
  - {name: forearm, nodes: [wrist, tool]}
joints:
  - {name: J1, nodes: [ground, foot], frame: turret, variable: q1, stiffness: {}}
  - {name: J2, nodes: [top, shoulder], frame: upper, variable: q2, stiffness: {}}
  - {name: J3, nodes: [elbow, wrist], frame: fore, variable: q3, stiffness: {}}
masses:
  - {node: elbow, mass: 40}
  - {node: tool, mass: 25}
fixed: [ground]
tcp: tool
gravity: [0, 0, -9.81]
"""


# modified Denavit-Hartenberg parameters of the KR240-2: alpha, d (along x), offset along z
_KR240 = (
    (0.0, 0.0, 0.675),
    (np.pi / 2, 0.35, 0.0),
    (0.0, 1.25, 0.0),
    (-np.pi / 2, -0.055, 1.1),
    (np.pi / 2, 0.0, 0.0),
    (-np.pi / 2, 0.0, 0.23),
)


@dataclass(frozen=True)
class Arm:
    """The KR240-2 in N postures: joint axes and points on them (N, 6, 3), tool point and axes."""

    axis: Array
    point: Array
    tip: Array
    tool: Array

    def torque(self, wrench: Array) -> Array:
        """Return the torques (N, 6) about the joints that wrenches (N, 6) at the tool make."""
        return np.einsum("nja,nja->nj", self.axis, self.moment(wrench))

    def moment(self, wrench: Array) -> Array:
        """Return the moments (N, 6, 3) about the joints' points."""
        arm = self.tip[:, None] - self.point
        return wrench[:, None, 3:] + np.cross(arm, wrench[:, None, :3])

    def turned(self, rotation: Array, joint: int) -> Array:
        """Return the displacement (N, 6) of the tool by small rotations (N, 3) about a joint's point."""
        return np.concatenate([np.cross(rotation, self.tip - self.point[:, joint]), rotation], axis=1)

    def slipped(self, slip: Array, joint: int) -> Array:
        """Return the displacement (N, 6) of the tool by slips (N,) about a joint's axis."""
        return self.turned(self.axis[:, joint] * slip[:, None], joint)


def arm_at(q: Array, off: tuple[int, str, float] | None = None) -> Arm:
    """Return the KR240-2 in postures (N, 6): forward kinematics, one frame after another.

    `off` adds to a parameter of a joint's frame: joint, name (alpha, d, theta or r), by how much.
    """
    count = len(q)
    turn, at = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    axes, points = [], []
    for joint, (alpha, along, offset) in enumerate(_KR240):
        angle = q[:, joint]
        if off is not None and off[0] == joint:
            by = {"alpha": 0.0, "d": 0.0, "theta": 0.0, "r": 0.0, off[1]: off[2]}
            alpha, along, offset = alpha + by["alpha"], along + by["d"], offset + by["r"]
            angle = angle + by["theta"]
        c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros(count), np.ones(count)
        tilt = np.array([[1, 0, 0], [0, np.cos(alpha), -np.sin(alpha)], [0, np.sin(alpha), np.cos(alpha)]])
        about = np.moveaxis(np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]), -1, 0)
        at = at + turn @ np.array([along, 0.0, 0.0])
        turn = turn @ tilt @ about
        at = at + offset * turn[:, :, 2]
        axes.append(turn[:, :, 2])
        points.append(at)
    return Arm(np.stack(axes, 1), np.stack(points, 1), at, turn)
