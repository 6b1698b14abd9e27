"""Where the measured points are for a geometry, and the error Jacobian: how they move with each parameter.

Every parameter of a frame is one of the motions of its chain: a screw, as a joint variable's is. So the
frames' parameters are taken for joint variables beside the actuated ones, and the twists of the points follow
as they do for these, with the loops' dependence carried through (seed 003, eqs 49 to 52)::

    dX/dp = T_p - T_passive pinv(J_passive) dPhi/dp

The column of a turn about an axis a through o is ``[a x (p - o); a]`` at a point p, of a shift ``[a; 0]``
(`robot.forward.twists_at`); Hayati's beta is the turn about a frame's y, after theta (`robot.frames`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from beamstiff.calibration.parameters import AXES, TURNS, Parameter, base_names
from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.frames import MOTIONS, Kinematics, widened
from beamstiff.robot.kinematics import Posture, compile_kinematics, pose_of, posture_at, twist_jacobian
from beamstiff.robot.loops import rotation_vector_rate
from beamstiff.se3 import Array, rotation_from_vector

Indices = NDArray[np.intp]
MOTION_OF = {name: at for at, (name, _, _) in enumerate(MOTIONS)}


@dataclass(frozen=True, eq=False)
class Placed:
    """Where the measured points are; N rows."""

    posture: Posture  # of the distinct poses (P)
    position: Array  # (N, 3), m
    rotation: Array  # (N, 3, 3): of the TCP's frame (of the target in the measuring frame)


@dataclass(frozen=True, eq=False)
class Geometry:
    """The rows' points as functions of t parameters of the geometry."""

    robot: Robot
    parameters: tuple[Parameter, ...]
    kinematics: Kinematics  # as described
    rows: Measurements
    poses: Array  # (P, A): distinct joint readings
    pose: Indices  # (N,) of int: which of them each row has
    stations: int = 1  # places that the base has in measuring frames: 1, or one for every table of the rows

    @property
    def station(self) -> Indices:
        """Place of the base in each row, (N,)."""
        return self.rows.run.astype(np.intp) if self.stations > 1 else np.zeros(len(self.rows), dtype=np.intp)

    @cached_property
    def _at(self) -> dict[str, int]:
        return {item.name: number for number, item in enumerate(self.parameters)}

    @cached_property
    def frame_columns(self) -> list[tuple[int, int, int]]:
        """Number, frame and motion of each parameter of a frame."""
        found = []
        for number, item in enumerate(self.parameters):
            if item.group == "frame":
                frame, _, name = item.name.rpartition(".")
                found.append((number, self.kinematics.frame_index[frame], MOTION_OF[name]))
        return found

    @cached_property
    def offset_columns(self) -> list[tuple[int, int]]:
        """Number and actuated variable of each encoder's zero."""
        names = self.rows.variables
        return [(at, names.index(x.name)) for at, x in enumerate(self.parameters) if x.group == "offset"]

    def _vector(self, theta: Array, owner: str, axes: Sequence[str]) -> Array:
        return np.array(
            [theta[self._at[f"{owner}.{x}"]] if f"{owner}.{x}" in self._at else 0.0 for x in axes]
        )

    def changed(self, theta: Array) -> Kinematics:
        """Return the kinematics with parameters theta (t,)."""
        constants, node_at = self.kinematics.constants.copy(), self.kinematics.node_at.copy()
        for number, frame, motion in self.frame_columns:
            constants[frame, motion] += theta[number]
        for name in dict.fromkeys(self.rows.point.tolist()):
            node_at[self.kinematics.node_index[name]] += self._vector(theta, name, AXES)
        return replace(self.kinematics, constants=constants, node_at=node_at)

    def bases(self, theta: Array) -> tuple[Array, Array]:
        """Return rotations (S, 3, 3) and positions (S, 3) of the base in the measuring frame, by station."""
        names = base_names(self.stations)
        turns = np.array([self._vector(theta, name, TURNS) for name in names])
        return rotation_from_vector(turns), np.array([self._vector(theta, name, AXES) for name in names])

    def turn(self, theta: Array) -> Array:
        """Return the rotation of the base in each row, (N, 3, 3)."""
        return self.bases(theta)[0][self.station]

    def target(self, theta: Array) -> Array:
        """Return how the measured target is turned against the frame of the TCP, (3, 3)."""
        return rotation_from_vector(self._vector(theta, "target", TURNS))

    def placed(self, theta: Array, moved: Array | None = None) -> Placed:
        """Return where the points are, in the measuring frame.

        `theta` (t,). `moved` (N, 6): elastic displacement ``[d, r]`` of the points, in the base frame.
        """
        posture, position, rotation = self.in_base(theta, moved)
        turn, shift = (part[self.station] for part in self.bases(theta))
        seen = (turn @ position[:, :, None])[:, :, 0] + shift
        return Placed(posture, seen, turn @ rotation @ self.target(theta))

    def postures(self, theta: Array) -> Posture:
        """Return postures (P), loops closed; those asked last are kept, as residuals precede derivatives."""
        if theta.tobytes() not in self._last:
            q, kinematics = self.poses.copy(), self.changed(theta)
            for number, column in self.offset_columns:
                q[:, column] += theta[number]
            near = next((before.values for before in self._last.values()), None)
            values, closed, reasons = close_loops(kinematics, q, strict=False, near=near)
            if not closed.all():
                self._refuse(closed, reasons)
            self._last.clear()
            self._last[theta.tobytes()] = posture_at(kinematics, values)
        return self._last[theta.tobytes()]

    @cached_property
    def _last(self) -> dict[bytes, Posture]:
        return {}

    def in_base(self, theta: Array, moved: Array | None) -> tuple[Posture, Array, Array]:
        """Return postures (P), positions (N, 3) and rotations of the TCP (N, 3, 3), in the base frame."""
        kinematics, posture = self.kinematics, self.postures(theta)
        seen = [kinematics.node_index[name] for name in self.rows.point.tolist()]
        position = posture.node_positions[self.pose, seen]
        rotation = pose_of(kinematics, posture, self.robot.tcp)[self.pose, :3, :3]
        if moved is not None:
            position = position + moved[:, :3]
            rotation = rotation_from_vector(moved[:, 3:]) @ rotation
        return posture, position, rotation

    def _refuse(self, closed: NDArray[np.bool_], reasons: Sequence[str]) -> None:
        pose = int(np.argmin(closed))
        row = int(np.argmax(self.pose == pose))
        more = int((~closed).sum()) - 1
        others = f" (and {more} more {'pose' if more == 1 else 'poses'})" if more else ""
        reason = reasons[pose].replace(f" (pose {pose})", "")
        raise BeamstiffError(f"{self.rows.place(row)}: {reason}{others}")

    def jacobian(self, theta: Array, moved: Array | None = None) -> tuple[Placed, Array]:
        """Return where the points are, and the error Jacobian there.

        Arguments as of `placed`. Columns (N, 6, t): ``[v; w]`` of the points, in the measuring frame, m and
        rad per unit of each parameter.
        """
        posture, position, rotation = self.in_base(theta, moved)
        turn, shift = (part[self.station] for part in self.bases(theta))
        target_vector = self._vector(theta, "target", TURNS)
        turned = turn @ rotation
        arm = (turn @ position[:, :, None])[:, :, 0]
        placed = Placed(posture, arm + shift, turned @ rotation_from_vector(target_vector))
        result = np.zeros((len(self.rows), 6, len(self.parameters)))
        self._in_chain(self.changed(theta), posture, result)
        for axis, name in enumerate(AXES):
            for point in dict.fromkeys(self.rows.point.tolist()):
                if (number := self._at.get(f"{point}.{name}")) is not None:
                    own = self.rows.point == point
                    frame = self.kinematics.node_frame[self.kinematics.node_index[point]]
                    result[own, :3, number] = posture.transforms[self.pose[own], frame, :3, axis]
        result[:, :3] = turn @ result[:, :3]
        result[:, 3:] = turn @ result[:, 3:]
        for station, name in enumerate(base_names(self.stations)):
            own = self.station == station
            rate = _turning(self._vector(theta, name, TURNS))
            for axis in range(3):
                if (number := self._at.get(f"{name}.{AXES[axis]}")) is not None:
                    result[own, axis, number] = 1.0
                if (number := self._at.get(f"{name}.{TURNS[axis]}")) is not None:
                    result[own, :3, number] = np.cross(rate[:, axis], arm[own])
                    result[own, 3:, number] = rate[:, axis]
        target_rate = turned @ _turning(target_vector)
        for axis in range(3):
            if (number := self._at.get(f"target.{TURNS[axis]}")) is not None:
                result[:, 3:, number] = target_rate[:, :, axis]
        return placed, result

    def _in_chain(self, kinematics: Kinematics, posture: Posture, result: Array) -> None:
        """Fill in the columns of frames' parameters and encoders' zeros, base frame."""
        if not (self.frame_columns or self.offset_columns):
            return
        wide = widened(kinematics, [(frame, motion) for _, frame, motion in self.frame_columns])
        nothing = np.zeros((len(posture.values), len(self.frame_columns)))
        values = np.concatenate([posture.values, nothing], axis=1)
        actuated = kinematics.coupling.actuated
        columns = [column for _, column in self.offset_columns]
        columns += [actuated + at for at in range(len(self.frame_columns))]
        numbers = [number for number, _ in self.offset_columns] + [
            number for number, _, _ in self.frame_columns
        ]
        where = Posture(values, posture.transforms, posture.node_positions)
        for point in dict.fromkeys([*self.rows.point.tolist(), self.robot.tcp]):
            twists = twist_jacobian(wide, where, point)[:, :, columns]
            own = np.flatnonzero(self.rows.point == point)
            result[own[:, None, None], np.arange(3)[:, None], np.array(numbers)] = twists[self.pose[own], :3]
            if point == self.robot.tcp:  # the orientation is the TCP's, whichever point is measured
                result[:, 3:, numbers] = twists[self.pose, 3:]


def _turning(vector: Array) -> Array:
    """Return the rates of turning (3, 3), in columns, for unit rates of a rotation vector (3,)."""
    return np.asarray(np.linalg.inv(rotation_vector_rate(vector)), dtype=np.float64)


def build_geometry(
    robot: Robot, rows: Measurements, parameters: Sequence[Parameter], stations: int = 1
) -> Geometry:
    """Return the geometry of a robot at the rows of a table; compliances are left out."""
    kinematics = compile_kinematics(robot)
    poses, pose = np.unique(rows.q, axis=0, return_inverse=True)
    geometry = tuple(item for item in parameters if item.group != "compliance")
    return Geometry(robot, geometry, kinematics, rows, poses, pose.reshape(-1), stations)
