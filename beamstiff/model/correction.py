"""What the model of a robot's file changes about its constant springs, and how far it extrapolates.

The constant springs answer the rest: the geometric stiffness of the loaded machine, and what a fuzzy
compliance does not know: dead weight, and terms that were never measured.
"""

from collections.abc import Iterator

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.structure import Structure
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance
from beamstiff.model.gaussian_process import GaussianProcessStiffness
from beamstiff.model.grid import GriddedStiffness, tcp_positions
from beamstiff.model.linear import predict_displacements
from beamstiff.model.model_file import fitted_model
from beamstiff.model.ports import reduce_to_ports
from beamstiff.model.varying import displaced
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Posture, compile_kinematics, posture
from beamstiff.robot.parts import Variable
from beamstiff.se3 import Array

NEAR = 1e-4  # m and rad by which joint readings may leave a range
MARGIN = 0.1  # of a joint's fitted range, within which what was fitted goes on


def model_correction(robot: Robot, rows: Measurements) -> Array:
    """Return what the robot's model adds to the displacement of rows by its constant springs, (N, 6).

    Linear, base frame, m and rad. Of absolute rows also what it says of the dead weight, and its kinematics.
    """
    model = fitted_model(robot)
    if model is None or not len(rows):
        return np.zeros((len(rows), 6))
    if isinstance(model, FuzzyCompliance):
        return _of_compliance(robot, model, rows)
    ports = reduce_to_ports(robot, rows, model.parameters)
    own = 1.0 / np.array([robot.parameter(name) for name in model.parameters])
    by_model, by_springs = (
        displaced(ports, compliance)
        for compliance in (model.compliances(rows.q), np.tile(own, (len(rows), 1)))
    )
    result = np.asarray(by_model - by_springs)
    if isinstance(model, GriddedStiffness) and rows.kind == "absolute":
        result += _at_points(robot, rows, model.offsets(rows.q))
    return result


def compliance_correction(structure: Structure, where: Posture) -> Array:
    """Return what the robot's model adds to the TCP's compliance and to its sag, (P, 6, 7)."""
    robot = structure.robot
    names = [variable.name for variable in robot.actuated]
    q = where.values[:, [structure.kinematics.coupling.names.index(name) for name in names]]
    loads = np.tile(np.eye(6), (len(q), 1))
    pushed = make_measurements(names, np.repeat(q, 6, axis=0), tcp=robot.tcp, wrench=loads)
    still = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((len(q), 3)))
    moved = model_correction(robot, pushed).reshape(-1, 6, 6).swapaxes(1, 2)
    without = _without_kinematics(robot)
    return np.concatenate([moved, model_correction(without, still)[:, :, None]], axis=2)


def model_std(robot: Robot, rows: Measurements) -> Array | None:
    """Return the standard deviations of the displacements by a Gaussian process, (N, 6); None of others."""
    model = fitted_model(robot)
    if not isinstance(model, GaussianProcessStiffness):
        return None
    return model.predict_with_std(rows.q, rows.wrench)[1]


def extrapolation_notes(robot: Robot, q: Array, what: str = "rows") -> tuple[str, ...]:
    """Return how far postures (N, A) leave those that the robot or its model was fitted to; none within."""
    return (*_beyond_fitted(robot, q, what), *_beyond_model(robot, q, what))


def _beyond_fitted(robot: Robot, q: Array, what: str) -> Iterator[str]:
    """Yield which postures have joints beyond those at which geometry, stiffness and effects were found."""
    known = {one.variable: one for one in robot.fitted_ranges}
    away, farthest = np.zeros(len(q), dtype=bool), dict[str, float]()
    for variable, values in zip(robot.actuated, q.T, strict=True):
        if (own := known.get(variable.name)) is None:
            continue
        # an angle is the same a turn farther on
        turns = 2.0 * np.pi * np.arange(-2, 3) if variable.kind == "angle" else np.zeros(1)
        past = _past(values[:, None] + turns, own.low, own.high).min(axis=1, initial=np.inf)
        beyond = past > NEAR + MARGIN * (own.high - own.low)
        away |= beyond
        if beyond.any():
            size, unit = _for_people(variable, float(past.max()))
            farthest[f"{variable.name} by {size:.3g} {unit}"] = size
    if farthest:
        names = sorted(farthest, key=farthest.__getitem__, reverse=True)
        yield (
            f"{int(away.sum())} of {len(q)} {what} are beyond the joint values that robot {robot.name!r} was "
            f"fitted at ({listed(names, 3)}): its geometry, stiffness and effects are extrapolated there"
        )


def _past(values: Array, low: Array | float, high: Array | float) -> Array:
    """Return by how much values leave a range; 0 within it."""
    return np.asarray(np.maximum(np.maximum(low - values, values - high), 0.0))


def _for_people(variable: Variable, size: float) -> tuple[float, str]:
    """Return a change of a variable in deg or mm, with the unit."""
    return (float(np.degrees(size)), "deg") if variable.kind == "angle" else (1e3 * size, "mm")


def _beyond_model(robot: Robot, q: Array, what: str) -> tuple[str, ...]:
    data, model = robot.model, fitted_model(robot)
    if data is None or not len(q):
        return ()
    low, high = (np.array(corner) for corner in data.workspace)
    at = tcp_positions(robot, q)
    beyond = np.linalg.norm(_past(at, low, high), axis=1)
    parts, away = [], beyond > NEAR
    if away.any():
        parts.append(f"the TCP {1e3 * beyond.max():.3g} mm beyond the fitted workspace")
    known = {one.variable: one for one in data.ranges}
    farthest: dict[str, float] = {}
    for variable, values in zip(robot.actuated, q.T, strict=True):
        if (own := known.get(variable.name)) is not None:
            past = _past(values, own.low, own.high)
            away = away | (past > NEAR)
            if past.max() > NEAR:
                size, unit = _for_people(variable, float(past.max()))
                farthest[f"{variable.name} {size:.3g} {unit}"] = size
    if farthest:
        parts.append(f"{max(farthest, key=farthest.__getitem__)} beyond its fitted range")
    if isinstance(model, GriddedStiffness) and (empty := model.outside(q) & (beyond <= NEAR)).any():
        parts.append(f"{int(empty.sum())} in cubes without data")
        away = away | empty
    if not parts:
        return ()
    how = "its standard deviation grows" if data.kind == "gaussian process" else "it answers as at its rim"
    return (
        f"the robot's model ({data.kind}) extrapolates at {int(away.sum())} of {len(q)} {what}: at most "
        f"{', and '.join(parts)}; there {how}",
    )


def _of_compliance(robot: Robot, model: FuzzyCompliance, rows: Measurements) -> Array:
    """Return the difference of fuzzy compliance and constant springs, in the terms that rules know."""
    elsewhere = (rows.point != robot.tcp) | ((rows.load_point != robot.tcp) & (rows.wrench != 0).any(axis=1))
    if elsewhere.any():
        row = int(np.argmax(elsewhere))
        raise BeamstiffError(
            f"{rows.place(row)}: found the point {str(rows.point[row])!r} and a load at "
            f"{str(rows.load_point[row])!r}, expected the TCP {robot.tcp!r}, all that a fuzzy "
            "model knows"
        )
    poses, pose = np.unique(rows.q, axis=0, return_inverse=True)
    loads = np.tile(np.eye(6), (len(poses), 1))
    unit = make_measurements(rows.variables, np.repeat(poses, 6, axis=0), tcp=robot.tcp, wrench=loads)
    own = predict_displacements(robot, unit).reshape(-1, 6, 6).swapaxes(1, 2)[pose.reshape(-1)]
    differs = np.where(model.known, model.compliance(rows.q, rows.wrench) - own, 0.0)
    return np.asarray((differs @ rows.wrench[..., None])[..., 0])


def _at_points(robot: Robot, rows: Measurements, moved: Array) -> Array:
    """Return how the rows' points move where the TCP does by ``[d, r]`` (N, 6)."""
    if (rows.point == robot.tcp).all():
        return moved
    kinematics = compile_kinematics(robot)
    index = kinematics.node_index
    where = posture(kinematics, rows.q).node_positions
    seen = where[np.arange(len(rows)), [index[name] for name in rows.point.tolist()]]
    shift = np.cross(moved[:, 3:], seen - where[:, index[robot.tcp]])
    return np.hstack([moved[:, :3] + shift, moved[:, 3:]])


def _without_kinematics(robot: Robot) -> Robot:
    if robot.model is None or robot.model.kinematics is None:
        return robot
    return robot.model_copy(update={"model": robot.model.model_copy(update={"kinematics": None})})
