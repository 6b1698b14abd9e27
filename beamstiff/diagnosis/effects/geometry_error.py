"""`geometry-error`: a parameter of the kinematics, or the zero of an encoder, differs from nominal.

Columns are those of the error Jacobian (`calibration.error_jacobian`). Displacements hardly depend on
geometry: of them only encoders' zeros are tried, by central differences of the deflection. What sits off
the axis of its joint, a disc or a bearing, errs once a turn as well; an encoder's disc that is oval twice.
"""

from dataclasses import replace

import numpy as np

from beamstiff.calibration.error_jacobian import build_geometry
from beamstiff.calibration.parameters import GEOMETRY, known_parameters
from beamstiff.calibration.statement import opening_parameters
from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, Term, named
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.description import Robot
from beamstiff.robot.expression import Expression, parse_expression
from beamstiff.robot.parts import Frame
from beamstiff.se3 import Array

STEP = 1e-5  # m or rad
LENGTHS, ANGLES = ("d", "r", "b"), ("alpha", "theta", "gamma", "beta")
USUAL = ("d", "r", "alpha", "theta")
LENGTH, ANGLE = 5e-4, 1e-3  # m, rad
RUNOUT = 0.2  # of these: discs and bearings are centred better than links are long


def _components(baseline: Baseline) -> list[str | None]:
    robot = baseline.nominal
    found: list[str | None] = [variable.name for variable in robot.actuated]
    for frame in robot.frames if baseline.absolute else ():
        for name in (*LENGTHS, *ANGLES):
            value = fixed(robot, frame, name)
            if value is not None and (name in USUAL or value != 0.0):
                found.append(f"{frame.name}.{name}")
    return found


def fixed(robot: Robot, frame: Frame, name: str) -> float | None:
    """Return a frame's parameter, m or rad; None where it follows a variable."""
    value = _expression(robot, frame, name)
    return None if value.coefficients else value.constant


def _expression(robot: Robot, frame: Frame, name: str) -> Expression:
    kinds = {variable.name: variable.kind for variable in robot.variables}
    return parse_expression(getattr(frame, name), "angle" if name in ANGLES else "length", kinds)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    name = str(component)
    frame, _, parameter = name.rpartition(".")
    angle = parameter in ANGLES if frame else _turns(baseline.nominal, name)
    try:
        columns = (pose_change if baseline.absolute else _deflection_change)(baseline, name)
    except BeamstiffError:  # a loop that constrains more than it needs to closes with nominal values only
        return []
    unit, size = ("rad", ANGLE) if angle else ("m", LENGTH)
    steady = (columns, (Quantity("offset", unit, size),))
    result = [Shape.of("offset", steady)]
    variable = _turning(baseline.nominal, name) if baseline.absolute else None
    if variable is None:
        return result
    turn = baseline.rows.q[:, baseline.rows.variables.index(variable)]

    def waves(of: Array, often: str, times: int, unit: str, size: float) -> Term:
        courses = np.stack([np.sin(times * turn), np.cos(times * turn)], -1)
        quantities = named(f"{often}_a_turn", unit, size * RUNOUT, ("sine", "cosine"))
        return of[..., None] * courses[:, None], quantities

    once = waves(columns, "once", 1, unit, size)
    result.append(Shape.of("offset, and once a turn", steady, once, weight=0.5))
    if frame:  # what sits off the axis takes the encoder's disc along
        disc = waves(pose_change(baseline, variable), "encoder_once", 1, "rad", ANGLE)
        result.append(
            Shape.of("offset, and once a turn, of the encoder too", steady, once, disc, weight=0.25)
        )
    else:
        oval = waves(columns, "twice", 2, unit, size)
        result.append(Shape.of("offset, and once and twice a turn", steady, once, oval, weight=0.25))
    return result


def _turning(robot: Robot, name: str) -> str | None:
    """Return the joint at which a parameter sits, if it turns: what is off its axis turns with it."""
    frame, _, _ = name.rpartition(".")
    for variable in robot.actuated:
        own = variable.name == name if not frame else _follows(robot, frame, variable.name)
        if own and variable.kind == "angle":
            return variable.name
    return None


def _follows(robot: Robot, frame: str, variable: str) -> bool:
    one = next(item for item in robot.frames if item.name == frame)
    return any(variable in _expression(robot, one, name).coefficients for name in ANGLES)


def _turns(robot: Robot, variable: str) -> bool:
    return next(item for item in robot.variables if item.name == variable).kind == "angle"


def _deflection_change(baseline: Baseline, name: str) -> Array:
    at, rows = baseline.rows.variables.index(name), baseline.rows
    zero = np.eye(rows.q.shape[1])[at] * STEP
    low, high = (predict_displacements(baseline.robot, replace(rows, q=rows.q + by)) for by in (-zero, zero))
    return (high - low) / (2 * STEP)


def pose_change(baseline: Baseline, name: str) -> Array:
    """Return how the nominal pose (N, 6) changes with a parameter, or an encoder's zero, per unit.

    Raises BeamstiffError where a loop closes with the present value only.
    """
    if not baseline.pose_changes:
        robot, rows = baseline.robot, baseline.rows
        known = [item for item in known_parameters(robot, (), turned=False) if item.group in GEOMETRY]
        opening = opening_parameters(build_geometry(robot, rows, known))
        closing = [item for item in known if item.name not in opening]
        _, columns = build_geometry(robot, rows, closing).jacobian(np.zeros(len(closing)))
        names = (item.name for item in closing)
        baseline.pose_changes.update(zip(names, np.moveaxis(columns, -1, 0), strict=True))
    if name not in baseline.pose_changes:
        raise BeamstiffError(f"{name}: a loop closes with the present value only")
    return baseline.pose_changes[name]


EFFECT = Effect(
    name="geometry-error",
    family="geometry",
    meaning="The kinematics differ from nominal: a frame's parameter, or the zero of an encoder.",
    components=_components,
    shapes=_shapes,
    separation="measure absolute positions of the unloaded robot in many postures",
    look_alikes=("frame-misalignment", "tool-offset"),
    sources="0.05 to 0.5 deg, tenths of a millimetre, engineering estimate",
    places_of=lambda component: (component.partition(".")[0],),
)
