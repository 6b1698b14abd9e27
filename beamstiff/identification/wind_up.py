"""Wind-up of the drives, read by encoders behind the gears, as observations of their stiffness.

An encoder behind the gear of q2 reads ``q2_link = q2 + s + zero + curve(q2) + noise``, s by how much the
joint's own spring opens. Between the rows of one pose zero, curve and dead weight are the same; so
r readings there count as r - 1 contrasts, orthonormal (Helmert), whose noise is independent and that of a
reading. A contrast is one more row of the port model (`model.ports`): its load is the contrast of the rows'
loads at the ports, what it sees is one port.

How much the readings scatter nobody states: it is what a spring alone leaves of the contrasts of each joint,
play and friction included.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import PortModel
from beamstiff.robot.coupling import variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

LEAST = 3  # contrasts of a joint, of which the scatter is told
LARGEST = 0.1  # rad or m: no gear winds up so much; then sign, unit or joint of the column is another
RESOLUTION = 1e-7  # rad or m, of the finest encoders (25 bit a turn): no scatter is less
ALONE = 0.1  # by how much a drive's spring may move the tool otherwise than its variable does, of all
IDLE = 1e-9  # of the largest wind-up, below which one is rounding
COMPONENT = 3  # of a row's six in which a wind-up stands: no position


Contrasts = Callable[[Measurements, int, bool], tuple[sparse.csr_array, Array]]


@dataclass(frozen=True)
class Drive:
    """A drive with an encoder behind its gear."""

    at: int  # column of the table
    turns: bool  # whether it is revolute
    port: int  # of its own spring
    gain: float  # 1, or -1 where its spring opens as its variable falls
    sigma: float  # rad or m: noise of a reading


@dataclass(frozen=True)
class WindUp:
    """Contrasts of readings behind the gears."""

    drives: tuple[Drive, ...]
    port: Integers  # (E,): the port that each sees open
    # (E,), rad or m
    value: Array
    sigma: Array
    contrast: sparse.csr_array  # (E, N): what each counts of the table's rows
    notes: tuple[str, ...] = ()  # what was used, and what was not

    @property
    def first(self) -> Integers:
        """The first row of the table that each counts, (E,)."""
        return np.asarray(self.contrast.indices[self.contrast.indptr[:-1]])

    def alone(self, model: PortModel) -> PortModel:
        """Return the model of the contrasts, of that of the table's rows."""
        motion = np.zeros((len(self.port), *model.motion.shape[1:]))
        motion[np.arange(len(self.port)), self.port, COMPONENT] = 1.0
        return replace(
            model,
            pose=model.pose[self.first],
            force=self.contrast @ model.force,
            motion=motion,
            clamped=np.zeros((len(self.port), 6)),
        )

    def added(self, model: PortModel) -> PortModel:
        """Return the model with a row for each contrast behind those of the table."""
        own = self.alone(model)
        return replace(
            model,
            pose=np.concatenate([model.pose, own.pose]),
            force=np.concatenate([model.force, own.force]),
            motion=np.concatenate([model.motion, own.motion]),
            clamped=np.concatenate([model.clamped, own.clamped]),
        )

    def spread(self, opened: Array) -> Array:
        """Return how far contrasts move, (E, 6, a), where errors open the ports by (N, a, p)."""
        moved = np.zeros((len(self.port), 6, opened.shape[1]))
        squares = self.contrast.power(2)
        for at in range(opened.shape[1]):
            every = np.sqrt(squares @ opened[:, at] ** 2)
            moved[:, COMPONENT, at] = every[np.arange(len(self.port)), self.port]
        return moved


def without_encoders(table: Measurements) -> Measurements:
    """Return a table without its readings behind the gears."""
    return replace(table, link=np.full_like(table.link, np.nan))


def wind_up(
    robot: Robot, table: Measurements, model: PortModel, moved: Array, contrasts: Contrasts, told: str
) -> WindUp:
    """Return the contrasts that a table's encoders behind the gears make.

    `table`: N rows.
    `model`: of these rows; drives that are not among its parameters do not count.
    `moved`: (N, 6, A) array; how far each row's point moves per unit of each actuated variable
        (`input_errors.rigid_motion`).
    `contrasts`: returns those of a column, such as `between_loads`.
    `told`: what they are, for the notes.
    """
    drives, notes = list[Drive](), list[str]()
    opened = model.openings(model.start)
    for at, name in enumerate(table.variables):
        if np.isnan(table.link[:, at]).all():
            continue
        turns = variable_kinds(robot)[name] == "angle"
        try:
            port, gain = _port(robot, model, name, moved[:, :, at])
            contrast, value = contrasts(table, at, turns)
            sigma = _scatter(gain * value, contrast @ opened[:, port], np.abs(opened).max())
        except _UnusedError as error:
            notes.append(f"{name}_link is not used: {error}")
            continue
        drives.append(Drive(at, turns, port, gain, sigma))
        notes.append(
            f"{name}_link: {len(value)} {told} count as the wind-up of this drive, to "
            f"{1e3 * sigma:.2g} {'mrad' if turns else 'mm'} each"
        )
    return replace(of_drives(drives, table, contrasts), notes=tuple(notes))


def of_drives(drives: Sequence[Drive], table: Measurements, contrasts: Contrasts) -> WindUp:
    """Return the contrasts of drives."""
    parts = [contrasts(table, one.at, one.turns) for one in drives]
    sizes = [len(value) for _, value in parts]
    nothing = sparse.csr_array((0, len(table)))
    return WindUp(
        tuple(drives),
        np.repeat([one.port for one in drives], sizes).astype(np.int64),
        np.concatenate([[], *(one.gain * value for one, (_, value) in zip(drives, parts, strict=True))]),
        np.repeat([one.sigma for one in drives], sizes),
        sparse.csr_array(sparse.vstack([nothing, *(contrast for contrast, _ in parts)])),
    )


class _UnusedError(Exception):
    """Why a joint's encoder is not used."""


def _port(robot: Robot, model: PortModel, variable: str, moved: Array) -> tuple[int, float]:
    """Return the port of a drive's own spring, and 1 or -1: whether it opens as its variable grows."""
    joints = [joint for joint in robot.joints if joint.variable == variable]
    kind = "torsional" if variable_kinds(robot)[variable] == "angle" else "axial"
    parameter = f"{joints[0].name}.{kind}" if len(joints) == 1 else ""
    if parameter not in model.parameters:
        raise _UnusedError("no joint of its own, whose stiffness is sought, is behind it")
    spring = model.springs[model.parameters.index(parameter)]
    ports = np.flatnonzero(np.diagonal(spring))
    if len(ports) != 1 or np.count_nonzero(spring) != 1:
        raise _UnusedError("other springs act in parallel")
    own, rigid = model.motion[:, ports[0], :3].ravel(), moved[:, :3].ravel()
    gain = float(own @ rigid) / max(float(rigid @ rigid), np.finfo(float).tiny)
    if np.linalg.norm(own - np.sign(gain) * rigid) > ALONE * np.linalg.norm(rigid):
        raise _UnusedError("the joint's spring does not move the tool as the drive does")
    return int(ports[0]), float(np.sign(gain))


def readings(table: Measurements, at: int) -> Integers:
    """Return the rows where an encoder was read; what several points saw in one state counts once."""
    rows = np.flatnonzero(np.isfinite(table.link[:, at]))
    step = np.nan_to_num(table.step, nan=-1.0)
    states = np.column_stack([table.run, table.pose, step, table.wrench, table.link[:, at]])[rows]
    return np.asarray(rows[np.sort(np.unique(states, axis=0, return_index=True)[1])])


def between_loads(table: Measurements, at: int, turns: bool) -> tuple[sparse.csr_array, Array]:
    """Return orthonormal contrasts (E, N) of the rows of each pose, and those of the differences, (E,)."""
    rows = readings(table, at)
    parts = [(np.zeros((0, 0)), rows[:0], np.zeros(0))]
    for pose in np.unique(table.pose[rows]):
        own = rows[table.pose[rows] == pose]
        count = np.arange(1, len(own))
        helmert = np.tril(np.ones((len(own), len(own))), -1) - np.diag(np.arange(len(own)))
        helmert = helmert[1:] / np.sqrt(count * (count + 1))[:, None]
        parts.append((helmert, own, helmert @ turned(table, at, own, turns)))
    return placed([part[:2] for part in parts], len(table)), np.concatenate([part[2] for part in parts])


def turned(table: Measurements, at: int, rows: Integers, turns: bool) -> Array:
    """Return the differences of both readings at rows, less the first one's; angles the short way round."""
    difference = table.link[rows, at] - table.q[rows, at]
    difference = difference - difference[:1]
    return np.asarray(np.angle(np.exp(1j * difference)) if turns else difference)


def placed(blocks: Sequence[tuple[Array, Integers]], count: int) -> sparse.csr_array:
    """Return blocks (e, r), each of some rows (r,) of `count`, below one another."""
    parts = [sparse.csr_array((0, count))]
    for block, rows in blocks:
        own = sparse.csr_array((np.ones(len(rows)), (np.arange(len(rows)), rows)), shape=(len(rows), count))
        parts.append(sparse.csr_array(block) @ own)
    return sparse.csr_array(sparse.vstack(parts))


def _scatter(value: Array, predicted: Array, largest: float) -> float:
    """Return the standard deviation of contrasts about a multiple of what is predicted of them.

    `largest`: of all wind-ups that are predicted.
    """
    if len(value) < LEAST:
        raise _UnusedError(f"found {len(value)} independent differences, expected {LEAST} or more")
    if np.sqrt(np.mean(value**2)) > LARGEST:
        raise _UnusedError("no gear winds up so much; check unit and joint of the column")
    size = float(predicted @ predicted)
    if np.sqrt(size) <= IDLE * largest:
        raise _UnusedError("no load of this joint differs from another")
    factor = float(predicted @ value) / size
    left = value - factor * predicted
    sigma = max(float(np.sqrt(left @ left / (len(value) - 1))), RESOLUTION)
    if factor * np.sqrt(size) < -3.0 * sigma:
        raise _UnusedError("it turns against the load; check the sign of the column")
    return sigma
