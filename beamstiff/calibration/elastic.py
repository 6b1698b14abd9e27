"""The elastic displacement under gravity, payload and load, where absolute positions are measured.

Compliances are sought in the linear model of the springs (`model.ports`), exact in series; what the stiffness
of the loaded machine (K_C) and a changed geometry make of it is put right from round to round.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.calibration.parameters import COMPLIANCE, Parameter
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import displaced_points
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.stiffness import parameter_unit, stiffness_parameters
from beamstiff.se3 import Array

REALISTIC = 1e-3  # m, rad: displacement by which the size of a compliance is told
UNFELT = 1e-9  # of the most compliant one's slope, or of one that all weights load with the robot's size
LEAST = 1e-9  # of that size: as good as rigid


@dataclass(frozen=True, eq=False)
class Elastic:
    """Elastic displacements as functions of m compliances; N rows."""

    names: tuple[str, ...]
    model: PortModel | None  # none where no compliance is sought
    held: Array  # (N, 6), m and rad: what the linear model leaves out; all of it where none is sought
    size: Array  # (m,): compliance that would move a point by about 1 mm or 1 mrad

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


def build_elastic(robot: Robot, rows: Measurements, names: Sequence[str]) -> Elastic:
    """Return the elastic displacement, with the compliances called `names` open.

    Something has to load each of them (`felt_names`).
    """
    if not names:
        return Elastic((), None, elastic_displacement(robot, rows), np.zeros(0))
    model = reduce_to_ports(robot, rows, names, gravity=True)
    present = np.array([robot.parameter(name) for name in names])
    finite = np.isfinite(present) & (present > 0)
    stiffness = np.where(finite, present, model.start)
    slopes = np.abs(model.derivatives(stiffness, by="compliance")[1]).max(axis=(0, 1))
    size = REALISTIC / slopes
    stiffness = np.where(finite, present, 1.0 / (LEAST * size))
    stated = robot.with_parameters(dict(zip(names, stiffness.tolist(), strict=True)))
    held = elastic_displacement(stated, rows) - model.predict(stiffness)
    return Elastic(tuple(names), model, held, size)


def felt_names(robot: Robot, rows: Measurements, names: Sequence[str]) -> list[str]:
    """Return the stiffness values that gravity or a row's load acts on."""
    model = reduce_to_ports(robot, rows, names, gravity=True)
    slopes = np.abs(model.derivatives(model.start, by="compliance")[1]).max(axis=(0, 1))
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
