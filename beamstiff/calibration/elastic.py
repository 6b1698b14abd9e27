"""The elastic displacement under gravity, payload and load, where absolute positions are measured.

Compliances are sought in the linear model of the springs (`model.ports`), exact in series; what the stiffness
of the loaded machine (K_C) and a changed geometry make of it is put right from round to round.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.calibration.parameters import COMPLIANCE, Parameter
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import displaced_points
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics, sampled_postures
from beamstiff.robot.stiffness_parameters import parameter_unit, stiffness_parameters
from beamstiff.se3 import Array

REALISTIC = 1e-3  # m, rad: displacement by which the size of a compliance is told
UNFELT = 1e-9  # of the most compliant one's slope, or of one that all weights load with the robot's size
ELSEWHERE = 50  # postures in which weights act on a drive as they do anywhere, to a quarter or so
LEAST = 1e-9  # of that size: as good as rigid


@dataclass(frozen=True, eq=False)
class Elastic:
    """Elastic displacements as functions of m compliances; N rows."""

    names: tuple[str, ...]
    model: PortModel | None  # none where no compliance is sought
    held: Array  # (N, 6), m and rad: what the linear model leaves out; all of it where none is sought
    size: Array  # (m,): compliance that moves a point by about 1 mm or 1 mrad, where it moves it most

    def displacement(self, compliance: Array) -> Array:
        """Return ``[d, r]`` of the rows' points, (N, 6), base frame, for compliances (m,)."""
        if self.model is None:
            return self.held
        return self.held + self.model.predict(self.stiffness(compliance))

    def columns(self, compliance: Array) -> Array:
        """Return its derivatives (N, 6, m)."""
        if self.model is None:
            return np.zeros((*self.held.shape, 0))
        return self.model.derivatives(self.stiffness(compliance), by="compliance")[1]

    def stiffness(self, compliance: Array) -> Array:
        """Return stiffness values (m,) of compliances (m,), those as good as rigid finite."""
        return np.asarray(1.0 / np.maximum(compliance, LEAST * self.size))


def elastic_displacement(robot: Robot, rows: Measurements) -> Array:
    """Return how far gravity, payload and the row's load move its point, (N, 6), m and rad, base frame.

    Of the stiffness of the loaded machine; the rotation is the TCP's.
    """
    if not is_compliant(robot):
        return np.zeros((len(rows), 6))
    result, tool = displaced_points(robot, rows)
    result[:, 3:] = tool[:, 3:]
    return result


def is_compliant(robot: Robot) -> bool:
    """Tell whether anything of the robot is compliant."""
    return bool(robot.beams) or any(0.0 < value < RIGID for value in stiffness_parameters(robot).values())


def build_elastic(
    robot: Robot, rows: Measurements, names: Sequence[str], size: Array | None = None
) -> Elastic:
    """Return the elastic displacement, with the compliances called `names` open.

    Something has to load each of them (`felt_names`). `size` (m,): where it is known, of another geometry.
    """
    if not names:
        return Elastic((), None, elastic_displacement(robot, rows), np.zeros(0))
    model = reduce_to_ports(robot, rows, names, gravity=True)
    present = np.array([robot.parameter(name) for name in names])
    finite = np.isfinite(present) & (present > 0)
    stiffness = np.where(finite, present, model.start)
    if size is None:
        size = realistic_compliances(robot, rows, model, stiffness, gravity=True)
    stiffness = np.where(finite, present, 1.0 / (LEAST * size))
    stated = robot.with_parameters(dict(zip(names, stiffness.tolist(), strict=True)))
    held = elastic_displacement(stated, rows) - model.predict(stiffness)
    return Elastic(tuple(names), model, held, size)


def _slopes(model: PortModel, stiffness: Array) -> Array:
    """Return how much each compliance moves a point at most, (m,), per unit."""
    columns = model.derivatives(stiffness, by="compliance")[1]
    return np.asarray(np.abs(columns).max(axis=(0, 1)))


def realistic_compliances(
    robot: Robot, rows: Measurements, model: PortModel, stiffness: Array, gravity: bool
) -> Array:
    """Return compliances (m,) that move a point by about 1 mm or 1 mrad, where they move it most.

    In the postures of the rows or in others, under the same loads: a drive that the rows hardly load carries
    a link all the same, and one that is so soft that it shows in them would let the link fall elsewhere.

    `model`: of the rows. `stiffness` (m,): about which it is linear. `gravity`: whether weights act.
    """
    slopes, q = _slopes(model, stiffness), sampled_postures(robot, ELSEWHERE, 0)
    q = q[close_loops(compile_kinematics(robot), q, strict=False).closed]
    if len(q):
        others = replace(subset(rows, np.arange(len(q)) % len(rows)), q=q)
        there = reduce_to_ports(robot, others, model.parameters, gravity=gravity)
        slopes = np.maximum(slopes, _slopes(there, stiffness))
    with np.errstate(divide="ignore"):  # what nothing moves may be anything
        return np.asarray(REALISTIC / slopes)


def felt_names(robot: Robot, rows: Measurements, names: Sequence[str]) -> list[str]:
    """Return the stiffness values that gravity or a row's load acts on."""
    model = reduce_to_ports(robot, rows, names, gravity=True)
    slopes = _slopes(model, model.start)
    size = compile_kinematics(robot).size
    weight = float(np.linalg.norm(robot.gravity)) * sum(mass.mass for mass in robot.masses)
    force, moment = (np.linalg.norm(rows.wrench[:, at], axis=1).max() for at in (slice(3), slice(3, 6)))
    most = max(float(slopes.max()), ((weight + force) * size + moment) * size)
    return [name for name, slope in zip(names, slopes, strict=True) if slope > UNFELT * most]


def is_rigid(parameter: Parameter, value: float) -> bool:
    """Tell whether a compliance fell to its floor."""
    return parameter.group == "compliance" and value <= 2 * LEAST * parameter.size


def compliances_of(robot: Robot, elastic: Elastic) -> Array:
    """Return the robot's compliances (m,), rigid ones as 0."""
    values = np.array([robot.parameter(name) for name in elastic.names], dtype=np.float64)
    return np.asarray(1.0 / values if values.size else values)


def compliance_parameters(robot: Robot, elastic: Elastic) -> tuple[Parameter, ...]:
    """Return the compliances as parameters."""
    units = {"N/m": "m/N", "N*m/rad": "rad/(N*m)", "Pa": "1/Pa"}
    return tuple(
        Parameter(name, "compliance", units[parameter_unit(robot, name)], float(size), COMPLIANCE)
        for name, size in zip(elastic.names, elastic.size, strict=True)
    )
