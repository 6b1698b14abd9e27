"""Compensation on line: a force in, the corrected target out, within half a millisecond.

What the real tool does beside a command, ``D(command, load)``, is smooth. Around a target it is written as a
polynomial of second order in the pose of the command and the load, from one evaluation of the machine in 91
states and checked in others; where the check fails the neighbourhood is made smaller, or given up. A call
then solves ``command + D(command, load) = target`` within a known neighbourhood, else makes a new one,
slowly. Backlash and other effects that follow a joint's torque have kinks: their slips are further variables
of the polynomial, and come from a table by the torque (`joint_torque_laws`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from beamstiff.compensation.follow import follow, follow_path, six_freedoms, solve
from beamstiff.compensation.joint_torque_laws import SlipLaw, joint_motions, slip_laws, tabulated
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath, difference
from beamstiff.compensation.path_correction import correct_path, shown_error
from beamstiff.compensation.process.load import Constant
from beamstiff.compensation.uncertainty import correction_std, doubtful, parameter_columns
from beamstiff.errors import BeamstiffError
from beamstiff.robot.kinematics import pose_of, posture, twist_jacobian
from beamstiff.se3 import Array, rotation_from_vector

REACH, TURN = 0.05, 0.2  # of the machine's size; rad: how far a neighbourhood goes at first
LOADS = np.array([2000.0] * 3 + [400.0] * 3)  # N and N m: likewise, at least
ENOUGH = 1e-6  # m and rad: error of the polynomial at its edge
HALVINGS = 8
CHECKED = 30  # states of each kind
ITERATIONS, SETTLED = 5, 1e-8  # m and rad


@dataclass(frozen=True, eq=False)
class OnlineCorrection:
    """The answer to one target and its load."""

    command: Array  # (4, 4), m: pose of the tool to send the controller to, base frame
    q: Array  # (A,), rad or m: joint values of the controller there
    correction: Array  # (6,): ``[command less target, rotation vector]``, m and rad
    std: Array  # (6,): standard deviation of it, as far as the robot file and `std` say
    warm: bool  # a known neighbourhood answered
    left_alone: bool  # the correction is below twice its standard deviation: the command is the target


@dataclass(frozen=True, eq=False)
class _Neighbourhood:
    """A polynomial of ``[D, q, torques of slips]`` (T,) in scaled ``[way, turn, load, slips]`` (V,)."""

    position: Array  # (3,)
    rotation: Array  # (3, 3)
    load: Array  # (6,)
    scale: Array  # (V,)
    value: Array  # (T,)
    slope: Array  # (T, V)
    bend: Array  # (T * V, V): of half the second derivative, (T, V, V) symmetric
    columns: Array  # (K, 6): of uncertain parameters
    column_slopes: Array  # (K, 6, 6): by the load

    def at(self, scaled: Array) -> Array:
        """Return ``[D, q, torques]`` at a state (V,)."""
        bend = (self.bend @ scaled).reshape(self.slope.shape)
        return np.asarray(self.value + (self.slope + bend) @ scaled)


@dataclass(eq=False)
class OnlineCompensation:
    """Corrects one target after the other, under loads that only become known then.

    It keeps the neighbourhoods that it has made: an answer does not depend on them beyond `ENOUGH`.
    """

    machine: Machine
    std: Mapping[str, float] = field(default_factory=dict)  # of stiffness parameters, SI
    load_std: Array = field(default_factory=lambda: np.zeros(6))  # of the load as it is read, N and N m
    leave_doubtful: bool = False
    _known: list[_Neighbourhood] = field(default_factory=list)
    _boxes: tuple[Array, Array] = field(default_factory=lambda: (np.zeros((0, 9)), np.zeros((0, 9))))
    _last: _Neighbourhood | None = None
    _q: Array | None = None
    _laws: tuple[SlipLaw, ...] = ()
    _smooth: Machine | None = None  # without these

    def __post_init__(self) -> None:
        if not six_freedoms(self.machine.kinematics):
            raise BeamstiffError(
                f"robot {self.machine.controller.name!r}: found fewer than six joints, expected six or more: "
                "on line whole poses are corrected"
            )

    def prepare(
        self, path: ToolPath, wrench: Array | None = None, start: Array | None = None
    ) -> dict[int, str]:
        """Make what calls near the targets of a path, base frame, will need, under loads about (N, 6).

        `start`: as of `follow`. Returns the targets that are out of reach, and why.
        """
        poses, found = path.poses, follow_path(self.machine, path, path.poses, start)
        loads = np.zeros((len(path), 6)) if wrench is None else wrench
        for row in np.flatnonzero(found.reached).tolist():
            if self._nearest(poses[row], loads[row]) is None:
                self._add(poses[row], loads[row], found.q[row])
            self._q = found.q[row] if self._q is None else self._q
        return found.reasons

    def correct(self, target: Array, wrench: Array) -> OnlineCorrection:
        """Return the command for a target (4, 4) of the tool, base frame, m, under a load (6,) at its tip."""
        near = self._nearest(target, wrench)
        warm = near is not None
        if near is None and (near := self._add(target, wrench, self._start(target))) is None:
            return self._exact(target, wrench)
        scaled = np.concatenate([self._scaled(near, target, wrench), np.zeros(len(near.scale) - 12)])
        first, joints = scaled[:6].copy(), len(self.machine.controller.actuated)
        torques = np.zeros(0)
        for _ in range(ITERATIONS):
            before = scaled.copy()
            found = near.at(scaled)
            scaled[:6] = first - found[:6] / near.scale[:6]
            if self._laws:
                torques = found[6 + joints :]
                scaled[12:] = [
                    law.at(at) / near.scale[12 + number]
                    for number, (law, at) in enumerate(zip(self._laws, torques, strict=True))
                ]
            if np.abs((scaled - before) * near.scale).max() <= SETTLED:
                break
        else:
            return self._exact(target, wrench)
        q = found[6 : 6 + joints]
        columns = near.columns + near.column_slopes @ scaled[6:12]
        step = self.load_std / near.scale[6:12]
        loads, variance = near.slope[:6, 6:12] * step, (columns**2).sum(axis=0)
        for at, law in enumerate(self._laws):
            motion = near.slope[:6, 12 + at] / near.scale[12 + at]
            variance += motion**2 * law.variance(torques[at])
            ahead = torques[at] + near.slope[6 + joints + at, 6:12] * step
            loads += np.outer(motion, law.at(ahead) - law.at(torques[at]))
        std = np.sqrt(variance + (loads**2).sum(axis=1))
        self._last, self._q = near, q
        return self._answer(target, -found[:6], q, std, warm)

    def _answer(self, target: Array, correction: Array, q: Array, std: Array, warm: bool) -> OnlineCorrection:
        if self.leave_doubtful and bool(doubtful(correction[None], std[None])[0]):
            return OnlineCorrection(target, q, correction, std, warm, True)
        command = target.copy()
        command[:3, 3] += correction[:3]
        command[:3, :3] = _rotation(correction[3:]) @ target[:3, :3]
        return OnlineCorrection(command, q, correction, std, warm, False)

    def _exact(self, target: Array, wrench: Array) -> OnlineCorrection:
        """Return the answer where no polynomial is good: at a kink, or beside the end of a joint's range."""
        path = ToolPath("on line", ("target",), np.ones(1, np.int64), target[None], np.ones(1, np.bool_))
        found = correct_path(self.machine, path, Constant(tuple(wrench.tolist())), start=self._q)
        if found.reasons or found.partly:
            left = shown_error(found.partly.get(0, np.zeros(6)))
            why = found.reasons.get(0, f"no command is exact, {left} remain")
            raise BeamstiffError(f"the target is not corrected: {why}")
        std = correction_std(self.machine, found.q, wrench[None], target[None], self.std, self.load_std)
        self._q = found.q[0]
        correction = difference(found.commands, target[None])[0]
        return self._answer(target, correction, found.q[0], std[0], False)

    def _nearest(self, target: Array, wrench: Array) -> _Neighbourhood | None:
        """Return a neighbourhood that holds a state, the last one before all."""
        if self._last is not None and np.abs(self._scaled(self._last, target, wrench)).max() <= 1.0:
            return self._last
        if not self._known:
            return None
        centres, scales = self._boxes
        state = np.concatenate([target[:3, 3], wrench])
        best: _Neighbourhood | None = None
        least = 1.0
        for at in np.flatnonzero((np.abs(state - centres) <= scales).all(axis=1)).tolist():
            far = float(np.abs(self._scaled(self._known[at], target, wrench)).max())
            if far <= least:
                best, least = self._known[at], far
        return best

    @staticmethod
    def _scaled(one: _Neighbourhood, target: Array, wrench: Array) -> Array:
        state = np.empty(12)
        state[:3] = target[:3, 3] - one.position
        state[3:6] = _vector(target[:3, :3] @ one.rotation.T)
        state[6:] = wrench - one.load
        state /= one.scale[:12]
        return state

    def _start(self, target: Array) -> Array:
        node = self.machine.frames.node_poses(target[None])
        found = follow(self.machine.kinematics, node, self._q)
        if not found.reached.all():
            raise BeamstiffError(f"the target is {found.reasons[0]}")
        return np.asarray(found.q[0])

    def _add(self, target: Array, wrench: Array, q: Array) -> _Neighbourhood | None:
        """Make a neighbourhood about a target as a command, as large as its polynomial is good; or none."""
        load = np.maximum(LOADS, np.repeat([np.abs(wrench[:3]).max(), np.abs(wrench[3:]).max()], 3))
        way = np.repeat([REACH * self.machine.kinematics.size, TURN], 3)
        if self._smooth is None:
            self._split(q, np.abs(wrench) + load)
        scale = np.concatenate([way, load, [law.most for law in self._laws]])
        if self._known:  # what was good elsewhere is a good guess
            scale[:6] = self._known[-1].scale[:6]
        for _ in range(HALVINGS):
            made, by_pose, by_load, by_both = self._fitted(target, wrench, q, scale)
            if max(by_pose, by_load, by_both) <= ENOUGH:
                self._known.append(made)
                self._boxes = (
                    np.array([np.concatenate([one.position, one.load]) for one in self._known]),
                    np.array([one.scale[[0, 1, 2, *range(6, 12)]] for one in self._known]),
                )
                return made
            single = max(by_pose, by_load) > ENOUGH
            narrower = [0.5 if by_pose > ENOUGH or not single else 1.0, 0.25 if by_load > ENOUGH else 1.0]
            scale[:12] *= np.repeat(narrower, 6)
        return None

    def _split(self, q: Array, load: Array) -> None:
        """Part the machine's slips from what is smooth, seen at a posture under loads up to (6,)."""
        real = self.machine.real
        self._laws = slip_laws(self.machine, q, load)
        moved = [one for law in self._laws for one in law.alone[0].effects]
        left = tuple(one for one in real.effects if one not in moved)
        self._smooth = replace(self.machine, actual=real.model_copy(update={"effects": left}))

    def _fitted(
        self, target: Array, wrench: Array, q: Array, scale: Array
    ) -> tuple[_Neighbourhood, float, float, float]:
        """Return the polynomial by differences, and its largest error in other states of the box.

        Errors where the pose alone differs, the load alone, and both; infinite where a state is out of reach.
        """
        size = len(scale)
        eye, (one, other) = np.eye(size), np.triu_indices(size, 1)
        both, checks = eye[one] + eye[other], self._checks(target, q, size)
        states = np.vstack([np.zeros(size), eye, -eye, both, checks])
        values = self._evaluated(target, wrench, q, states * scale)
        middle, plus, minus, mixed = np.split(values[: -len(checks)], np.cumsum([1, size, size]))
        bend = np.zeros((values.shape[1], size, size))
        bend[:, range(size), range(size)] = (0.5 * (plus + minus) - middle).T
        bend[:, one, other] = bend[:, other, one] = 0.5 * (mixed - plus[one] - plus[other] + middle).T
        if self._laws:
            most = np.nanmax(np.abs(values[:, -len(self._laws) :]), axis=0).tolist()
            self._laws = tuple(
                law if largest <= law.torque[-1] else tabulated(self.machine, law, q, largest)
                for law, largest in zip(self._laws, most, strict=True)
            )
        loads = wrench + np.vstack([np.zeros(6), np.diag(scale[6:12])])
        many, smooth = np.repeat(target[None], 7, axis=0), self._smooth or self.machine
        columns = parameter_columns(smooth, np.repeat(q[None], 7, axis=0), loads, many, self.std)
        made = _Neighbourhood(
            position=target[:3, 3].copy(),
            rotation=target[:3, :3].copy(),
            load=np.array(wrench, dtype=np.float64),
            scale=scale,
            value=middle[0],
            slope=0.5 * (plus - minus).T,
            bend=bend.reshape(-1, size),
            columns=columns[:, 0],
            column_slopes=(columns[:, 1:] - columns[:, :1]).swapaxes(1, 2),
        )
        if not np.isfinite(values).all():
            return made, np.inf, 0.0, np.inf
        seen = np.array([made.at(state) for state in checks])
        off = np.abs(seen - values[-len(checks) :])[:, :6].max(axis=1)
        still, free = (~checks[:, part].any(axis=1) for part in (slice(0, 6), slice(6, 12)))
        return made, float(off[free].max()), float(off[still].max()), float(off.max())

    def _checks(self, target: Array, q: Array, size: int) -> Array:
        """Return states (K, V) of the box: random ones, and the ends of every joint's torque in it.

        What is not smooth goes with the torque of a joint: where both ends are right, no kink is between.
        """
        random = np.random.default_rng(0).uniform(-1.0, 1.0, (3, CHECKED, size))
        random[0, :, 6:12] = random[1, :, :6] = 0.0
        kinematics, tcp = self.machine.kinematics, self.machine.controller.tcp
        at = posture(kinematics, q)
        jacobian = twist_jacobian(kinematics, at, tcp)[0]
        arm = target[:3, 3] - pose_of(kinematics, at, tcp)[0, :3, 3]
        torque = jacobian + np.vstack([np.cross(jacobian[3:].T, arm).T, np.zeros_like(jacobian[3:])])
        ends = np.zeros((2 * torque.shape[1], size))
        ends[:, 6:12] = np.vstack([np.sign(torque.T), -np.sign(torque.T)])
        tilted = ends.copy()
        tilted[:, :6] = np.sign(random[2, : len(ends), :6])
        return np.vstack([*random, ends, tilted])

    def _evaluated(self, target: Array, wrench: Array, q: Array, states: Array) -> Array:
        """Return ``[D, q, torques]`` (K, T) of the machine at states (K, V) of a box; NaN out of reach."""
        machine, smooth = self.machine, self._smooth or self.machine
        commands = np.repeat(target[None], len(states), axis=0)
        commands[:, :3, 3] += states[:, :3]
        commands[:, :3, :3] = rotation_from_vector(states[:, 3:6]) @ commands[:, :3, :3]
        found = solve(machine.kinematics, machine.frames.node_poses(commands), q, restarts=0)
        if not found.reached[0]:
            raise BeamstiffError("the target is out of reach")
        loads, undeformed = wrench + states[:, 6:12], machine.undeformed(found.q)
        tip, torques = commands, np.zeros((len(states), 0))
        for _ in range(2):  # the load acts where the real tool is
            # which way joints came is not known of one target
            moved = smooth.moved(found.q, loads, tip, np.zeros_like(found.q))
            if self._laws:
                motions, torques = joint_motions(machine, self._laws, machine.rows(found.q, loads, tip))
                moved += np.einsum("kal,kl->ka", motions, states[:, 12:])
            tip = machine.displaced(undeformed, moved)
        result = np.hstack([difference(tip, commands), found.q, torques])
        result[~found.reached] = np.nan
        return result


def _vector(turn: Array) -> Array:
    """Return the rotation vector (3,) of a rotation of less than half a turn."""
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = 0.5 * np.sqrt(axis @ axis)
    cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    factor = 0.5 if sine < 1e-9 else 0.5 * np.arctan2(sine, cosine) / sine
    return np.asarray(axis * factor)


def _rotation(vector: Array) -> Array:
    """Return the rotation (3, 3) of a vector (3,), by Rodrigues' formula."""
    x, y, z = vector.tolist()
    angle = float(np.sqrt(x * x + y * y + z * z))
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-12:
        return np.asarray(np.eye(3) + skew)
    once, twice = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + once * skew + twice * (skew @ skew))
