"""The posture that a program states for a target: KRL's S and T, RAPID's configuration, FANUC's CONFIG.

All three say on which side of the three singularities of an arm with a spherical wrist the robot is, and in
which turn axes 1, 4 and 6 are. Here an axis counts as ABB's do: axis 1 up, zero with the arm along the base's
x; axes 2, 3 and 5 downwards; axis 4 from the elbow to the wrist, zero with axis 5 parallel to axis 2; axis 6
from the wrist to the flange. KUKA counts axes 1, 4 and 6 the other way, FANUC axes 4 and 6: the readers of
their programs see to that. Signs and zeros of the robot file's own variables follow from its geometry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.robot.frames import Kinematics
from beamstiff.robot.kinematics import pose_of, posture, twist_jacobian
from beamstiff.se3 import Array

EXCEED = 1e-4  # rad: as far a program's rounded numbers may lie beyond a singularity or a turn
MEET = 0.01  # of the machine's size: as near the axes of a spherical wrist have to pass each other
PARALLEL = 0.02  # rad
WHOLE = 2 * np.pi
TURNING = (0, 3, 5)  # axes 1, 4 and 6
DECIDING = (None, 2, 4, *TURNING)  # the axis behind each column of `Arm.misfits`; None: no axis by itself
NAMED = 2  # configurations that a message offers


@dataclass(frozen=True)
class Configuration:
    """What a posture is, as `StatedPosture` says it: sides of the three singularities, angles of the axes."""

    front: bool
    elbow_up: bool
    wrist_down: bool
    angles: tuple[float, ...]  # (6,), rad; those of axes 2 and 3 from wherever the robot file counts


@dataclass(frozen=True)
class StatedPosture:
    """What a program says of the posture at a target; None where it leaves that open."""

    text: str  # as the file writes it
    front: bool | None = None  # the wrist is before axis 1
    elbow_up: bool | None = None  # the wrist is before the line of the lower arm
    wrist_down: bool | None = None  # axis 5 is positive
    turns: tuple[tuple[int, float, float], ...] = ()  # axis (0 to 5), lowest and highest angle, rad
    flange_up: bool = False  # at the zero of axis 6 the flange's x points up (FANUC), else down
    # how the language of the program writes another configuration in place of this one
    write: Callable[[StatedPosture, Configuration], str] | None = None


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot of six joints with a spherical wrist, and how manufacturers count them: ``sign q + zero``."""

    kinematics: Kinematics
    sign: Array  # (6,)
    zero: Array  # (6,), rad; of axes 2 and 3 it is not needed
    bends: bool  # False: a parallelogram carries the forearm, whose elbow cannot turn over

    def fits(self, stated: StatedPosture, q: Array) -> NDArray[np.bool_]:
        """Tell which postures (K, 6) are as stated, (K,)."""
        return np.logical_not(self.misfits(stated, q).any(axis=1))

    def misfits(self, stated: StatedPosture, q: Array) -> NDArray[np.bool_]:
        """Tell what of postures (K, 6) is not as stated, (K, 6).

        The sides of axis 1, of the lower arm and of axis 5, then the turns of axes 1, 4 and 6.
        """
        angle = self._angles(stated, q)
        result = np.zeros((len(q), len(DECIDING)), dtype=np.bool_)
        elbow_up = stated.elbow_up if self.bends else None
        sides = (stated.front, elbow_up, stated.wrist_down)
        for column, (said, value) in enumerate(zip(sides, self._sides(q, angle), strict=True)):
            if said is not None:
                result[:, column] = ~((value if said else -value) > -EXCEED)
        for axis, low, high in stated.turns:
            within = (angle[:, axis] > low - EXCEED) & (angle[:, axis] < high + EXCEED)
            result[:, DECIDING.index(axis, len(sides))] = ~within
        return result

    def configuration(self, stated: StatedPosture, q: Array) -> Configuration:
        """Return the configuration of a posture (6,), its angles counted as the `stated` one counts them.

        What passes for as stated, at the border or since the arm cannot do otherwise, is as stated.
        """
        angle, [misfit] = self._angles(stated, q[None]), self.misfits(stated, q[None])
        sides = [bool(side[0] > 0) for side in self._sides(q[None], angle)]
        said = (stated.front, stated.elbow_up, stated.wrist_down)
        for column, as_stated in enumerate(said):
            if as_stated is not None and not misfit[column]:
                sides[column] = as_stated
        for axis, low, high in stated.turns:
            if not misfit[DECIDING.index(axis, len(sides))]:
                angle[0, axis] = np.clip(angle[0, axis], low + EXCEED, high - EXCEED)
        front, elbow_up, wrist_down = sides
        return Configuration(front, elbow_up, wrist_down, tuple(angle[0].tolist()))

    def reachable_as(self, stated: StatedPosture, q: Array) -> str:
        """Return, in words, which configurations postures (K, 6) have, those most like the stated one.

        With the value of the joint that keeps it from being the stated one.
        """
        if stated.write is None:
            return ""
        misfits = self.misfits(stated, q)
        sides, turns = misfits[:, : -len(TURNING)].sum(axis=1), misfits[:, -len(TURNING) :].sum(axis=1)
        off = sides * len(DECIDING) + turns  # another side is another posture of the arm
        told: dict[str, str] = {}
        for row in np.flatnonzero(off == off.min()).tolist():
            one = self.configuration(stated, q[row])
            told.setdefault(stated.write(stated, one), self._deciding(misfits[row], one, q[row]))
        return " or ".join(f"{text}{why}" for text, why in [*told.items()][:NAMED])

    def _deciding(self, misfit: NDArray[np.bool_], found: Configuration, q: Array) -> str:
        """Return, in words, what decides that a posture is not as stated."""
        parts: dict[str, None] = {}
        for column in np.flatnonzero(misfit).tolist():
            if (axis := DECIDING[column]) is None:
                parts[f"the wrist {'in front of' if found.front else 'behind'} axis 1"] = None
            else:
                name = self.kinematics.robot.actuated[axis].name
                parts[f"{name} = {round(np.degrees(q[axis]), 3) + 0.0:.3g} deg"] = None
        return "".join(f", {part}" for part in parts)

    def _sides(self, q: Array, angle: Array) -> tuple[Array, Array, Array]:
        """Return how far postures are on the positive sides, (K,) each: front, elbow up, wrist down."""
        lines = _Lines.of(self.kinematics, q)
        forward, side = _turned(angle[:, 0])
        before = np.sum((lines.wrist - lines.point(0)) * forward, axis=1) / self.kinematics.size
        whole, fore = (
            self.sign[joint] * np.cross(lines.velocity(joint, lines.wrist), side) for joint in (1, 2)
        )
        lower = whole - fore
        sizes = np.linalg.norm(lower, axis=1) * np.linalg.norm(fore, axis=1)
        bend = np.sum(np.cross(lower, fore) * side, axis=1) / np.maximum(sizes, 1e-12)
        return before, bend, _wrapped(angle[:, 4])

    def turned(self, stated: StatedPosture, q: Array) -> Array:
        """Return postures (K, 6) with whole turns of axes 1, 4 and 6 added where the turns stated need it."""
        angle, result = self._angles(stated, q), q.copy()
        for axis, low, high in stated.turns:
            turns = np.round((0.5 * (low + high) - angle[:, axis]) / WHOLE)
            result[:, axis] += self.sign[axis] * WHOLE * turns
        return result

    def _angles(self, stated: StatedPosture, q: Array) -> Array:
        angle = self.sign * q + self.zero
        if stated.flange_up:
            angle[:, 5] += _wrapped(self.zero[5] + np.pi) - self.zero[5]
        return np.asarray(angle)


@dataclass(frozen=True, eq=False)
class _Lines:
    """The axes of six joints in K postures."""

    jacobian: Array  # (K, 6, 6): ``[v; w]`` of the TCP
    pose: Array  # (K, 4, 4): of the TCP

    @classmethod
    def of(cls, kinematics: Kinematics, q: Array) -> _Lines:
        at, tcp = posture(kinematics, q), kinematics.robot.tcp
        return cls(twist_jacobian(kinematics, at, tcp), pose_of(kinematics, at, tcp))

    def direction(self, joint: int) -> Array:
        """Return the direction of an axis, (K, 3); zero where the joint does not turn the TCP."""
        return np.asarray(self.jacobian[:, 3:, joint])

    def point(self, joint: int) -> Array:
        """Return a point of an axis, (K, 3)."""
        away = np.cross(self.direction(joint), self.jacobian[:, :3, joint])
        return np.asarray(self.pose[:, :3, 3] + away)

    def velocity(self, joint: int, point: Array) -> Array:
        """Return the velocity of points (K, 3) of the hand for a unit rate of a joint."""
        arm = point - self.pose[:, :3, 3]
        return np.asarray(self.jacobian[:, :3, joint] + np.cross(self.direction(joint), arm))

    @property
    def wrist(self) -> Array:
        """Where axis 4 passes axis 5, (K, 3)."""
        first, second = self.direction(3), self.direction(4)
        across = np.cross(np.cross(first, second), second)
        share = np.sum((self.point(4) - self.point(3)) * across, axis=1) / np.sum(first * across, axis=1)
        return np.asarray(self.point(3) + share[:, None] * first)


def arm_of(kinematics: Kinematics) -> Arm | None:
    """Return the arm; None unless six joints turn, axis 1 is upright and 4 to 6 meet in a spherical wrist."""
    joints = kinematics.robot.actuated
    if len(joints) != 6 or any(joint.kind != "angle" for joint in joints):
        return None
    limits = np.array([joint.limits or (-np.pi, np.pi) for joint in joints])
    q = 0.5 * limits.sum(axis=1)
    q[list(TURNING)] = np.clip(0.0, *limits[list(TURNING)].T)
    try:
        lines = _Lines.of(kinematics, q[None])
    except BeamstiffError:  # its loops do not close there
        return None
    axis = [lines.direction(joint)[0] for joint in range(6)]
    bends = bool(np.linalg.norm(axis[1]) > PARALLEL)
    across = [(axis[0], axis[2]), (axis[2], axis[3]), (axis[3], axis[4]), (axis[4], axis[5])]
    if (
        abs(axis[0][2]) < np.cos(PARALLEL)
        or (bends and np.linalg.norm(np.cross(axis[1], axis[2])) > PARALLEL)
        or any(abs(a @ b) > PARALLEL for a, b in across)
    ):
        return None
    wrist = lines.wrist[0]
    off = max(np.linalg.norm(np.cross(wrist - lines.point(at)[0], axis[at])) for at in (3, 4, 5))
    if off > MEET * kinematics.size:
        return None
    return _counted(kinematics, lines, q, bends)


def _counted(kinematics: Kinematics, lines: _Lines, q: Array, bends: bool) -> Arm:
    """Return signs and zeros of the axes, from one posture with axes 1 and 4 near their zeros."""
    axis = [lines.direction(joint)[0] for joint in range(6)]
    wrist, tcp = lines.wrist[0], lines.pose[0]
    sign, zero = np.ones(6), np.zeros(6)
    sign[0] = np.sign(axis[0][2])
    forward = np.cross(axis[2], [0.0, 0.0, 1.0])
    offset = (lines.point(1)[0] - lines.point(0)[0]) @ forward if bends else 0.0
    forward *= np.sign(offset if abs(offset) > 1e-3 * kinematics.size else forward[0] + 1e-12 * forward[1])
    side = np.cross([0.0, 0.0, 1.0], forward)
    sign[2] = np.sign(axis[2] @ side)
    sign[1] = np.sign(axis[1] @ side) if bends else 1.0
    sign[3] = np.sign((wrist - lines.point(2)[0]) @ axis[3])
    along = sign[3] * axis[3]
    sign[4] = np.sign(axis[4] @ side + 1e-12)
    pivot = sign[4] * axis[4]
    out = (tcp[:3, 3] - wrist) @ axis[5]
    sign[5] = np.sign(out if abs(out) > 1e-4 * kinematics.size else tcp[:3, 2] @ axis[5])
    flange = sign[5] * axis[5]
    now = {
        0: np.arctan2(forward[1], forward[0]),
        3: _angle(side, pivot, along),
        4: _angle(along, flange, pivot),
    }
    if tcp[:3, 2] @ flange > np.cos(PARALLEL):  # else x of the TCP says nothing, and q is counted as it is
        now[5] = _angle(np.cross(pivot, flange), tcp[:3, 0], flange)
    for joint, angle in now.items():
        zero[joint] = _wrapped(angle - sign[joint] * q[joint])
    return Arm(kinematics, sign, zero, bends)


def _turned(angle: Array) -> tuple[Array, Array]:
    """Return the directions forwards and to the left (K, 3) of an arm turned about the upright axis."""
    still = np.zeros_like(angle)
    forward = np.stack([np.cos(angle), np.sin(angle), still], axis=1)
    return forward, np.stack([-np.sin(angle), np.cos(angle), still], axis=1)


def _angle(first: Array, second: Array, about: Array) -> float:
    """Return the angle from one direction to another about an axis, all (3,), rad."""
    return float(np.arctan2(np.cross(first, second) @ about, first @ second))


def _wrapped(angle: Array | float) -> Array:
    """Return angles within half a turn of zero; what is a rounding short of half a turn is half a turn."""
    return np.asarray(angle - WHOLE * np.ceil((np.asarray(angle) - np.pi - 1e-9) / WHOLE))
