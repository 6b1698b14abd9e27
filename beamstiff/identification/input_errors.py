"""Errors of the loads and of the joint readings, and how far they move what is measured."""

from dataclasses import dataclass, fields, replace

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.identification.whitening import Disturbance
from beamstiff.identification.wind_up import WindUp
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from beamstiff.se3 import Array

STEP = 1e-4  # rad or m, of the central difference by a joint value


@dataclass(frozen=True)
class InputErrors:
    """Standard deviations of what a table says of its rows' loads and joint values; independent.

    A spring balance to 0.1 kg and encoders to 0.01 deg, as in seed 000, section 5.2:

    >>> paper = InputErrors(load=0.1 * 9.81, angle=np.radians(0.01))
    >>> bool(paper), bool(InputErrors())
    (True, False)
    """

    # N: of the size of the load, as read from a spring balance: force and moment are wrong in proportion
    load: float = 0.0
    # force, moment, N and N m: of each component of the wrench, as read from a force sensor
    force: float = 0.0
    moment: float = 0.0
    # angle, length, rad and m: of the reading of each actuated variable, of a revolute joint or of a slide;
    # the rows of a pose share it
    angle: float = 0.0
    length: float = 0.0
    # hold_angle, hold_length, rad and m: of how well each drive holds its position from the unloaded reading
    # to the loaded one, every row for itself. Where it does not, the tool moves by ``J dq`` more: 0.01 deg
    # are 0.3 mm at 2 m, while the same error of the posture alone changes the displacement by some
    # ten-thousandths
    hold_angle: float = 0.0
    hold_length: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no standard deviation."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0):
                raise BeamstiffError(
                    f"input errors: found {field.name} = {value}, expected a standard deviation, 0 or more"
                )

    def __bool__(self) -> bool:
        return any(getattr(self, field.name) > 0 for field in fields(self))

    def of_variables(self, robot: Robot) -> Array:
        """Return the standard deviation of each actuated variable's reading, (A,)."""
        return _by_kind(robot, self.angle, self.length)

    def of_hold(self, robot: Robot) -> Array:
        """Return the standard deviation of each actuated variable between two readings, (A,)."""
        return _by_kind(robot, self.hold_angle, self.hold_length)


@dataclass(frozen=True)
class Response:
    """What errors of the inputs do, for any stiffness values."""

    # of ``N (a + 2 b)`` rows: each row under every wrench of one standard deviation, then with every joint
    # value a little more and a little less
    model: PortModel
    # own, common: numbers a and b
    own: int
    common: int
    spread: Array  # (b,): standard deviations of the joint values over twice the step
    # (N, 6, A), m and rad: how far each drive that does not hold moves the row, whatever the stiffness
    held: Array
    behind: WindUp | None = None  # encoders behind the gears, whose contrasts follow the rows

    def disturbance(self, stiffness: Array) -> Disturbance:
        """Return how far each row moves by one standard deviation of each error, at stiffness values (m,)."""
        moved = self.model.predict(stiffness).reshape(-1, self.own + 2 * self.common, 6)
        turned = moved[:, self.own :].reshape(len(moved), self.common, 2, 6)
        by_value = (turned[:, :, 0] - turned[:, :, 1]) * self.spread[:, None]
        own = np.concatenate([moved[:, : self.own].swapaxes(1, 2), self.held], axis=2)
        common = by_value.swapaxes(1, 2)
        if self.behind is None:
            return Disturbance(own, common)
        opened = self.model.openings(stiffness).reshape(*moved.shape[:2], -1)[:, : self.own]
        wound = self.behind.spread(opened)
        still = [np.zeros((len(wound), *one.shape[1:])) for one in (self.held, common)]
        return Disturbance(
            np.concatenate([own, np.concatenate([wound, still[0]], axis=2)]),
            np.concatenate([common, still[1]]),  # the error of a joint's reading is the same in all of a pose
        )


def build_response(
    robot: Robot,
    measurements: Measurements,
    errors: InputErrors,
    parameters: tuple[str, ...],
    behind: WindUp | None = None,
) -> Response:
    """Return what errors of the inputs do to the rows of a table.

    `parameters`: the open stiffness values. `behind`: contrasts of encoders that stand behind the rows.
    """
    own = _wrenches(robot, measurements, errors)
    spread = errors.of_variables(robot)
    varied = np.flatnonzero(spread)
    if not own.shape[1] and not varied.size:  # a table has at least one row
        own = np.zeros((len(measurements), 1, 6))
    n, a, b = len(measurements), own.shape[1], varied.size
    number = np.repeat(np.arange(n), a + 2 * b)
    rows = subset(measurements, number)
    wrench = np.concatenate([own, np.repeat(measurements.wrench[:, None], 2 * b, axis=1)], axis=1)
    steps = np.zeros((a + 2 * b, len(spread)))
    for at, variable in enumerate(varied):
        steps[a + 2 * at, variable], steps[a + 2 * at + 1, variable] = STEP, -STEP
    rows = replace(rows, wrench=wrench.reshape(-1, 6), q=rows.q + np.tile(steps, (n, 1)))
    model = reduce_to_ports(robot, rows, parameters, gravity=False).along(rows)
    held = rigid_motion(robot, measurements) * errors.of_hold(robot)
    return Response(model, a, b, spread[varied] / (2 * STEP), held, behind)


def rigid_motion(robot: Robot, measurements: Measurements) -> Array:
    """Return how far each row's measured point moves per unit of each actuated variable, (N, 6, A)."""
    kinematics = compile_kinematics(robot)
    poses, pose = np.unique(measurements.q, axis=0, return_inverse=True)
    where, pose = posture(kinematics, poses), pose.reshape(-1)
    result = np.zeros((len(measurements), 6, poses.shape[1]))
    for point in np.unique(measurements.point):
        rows = measurements.point == point
        result[rows] = twist_jacobian(kinematics, where, str(point))[pose[rows]]
    return measurements.along(result)


def _by_kind(robot: Robot, angle: float, length: float) -> Array:
    kinds = [angle if variable.kind == "angle" else length for variable in robot.actuated]
    return np.array(kinds, dtype=np.float64)


def _wrenches(robot: Robot, measurements: Measurements, errors: InputErrors) -> Array:
    """Return the wrenches of one standard deviation of each error of the load, (N, a, 6)."""
    n = len(measurements)
    result = []
    if errors.load:
        size = np.linalg.norm(measurements.wrench[:, :3], axis=1)
        share = np.divide(errors.load, size, out=np.zeros(n), where=size > 0)
        result.append((measurements.wrench * share[:, None])[:, None])
    if errors.force:
        result.append(np.tile(errors.force * np.eye(6)[:3], (n, 1, 1)))
    if errors.moment:
        turns = np.isin(measurements.load_point, list(turning_nodes(robot)))
        result.append(turns[:, None, None] * np.tile(errors.moment * np.eye(6)[3:], (n, 1, 1)))
    return np.concatenate(result, axis=1) if result else np.zeros((n, 0, 6))
