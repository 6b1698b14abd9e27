"""The port-reduced evaluator: predictions of all rows and their derivatives, from stiffness values alone.

What is left open may change without anything else changing: each pose is condensed once to the ports (the
directions whose stiffness is open), and an evaluation is a small dense problem::

    d = C_clamped w + B_d^T M^-1 (B_w w + g)        dd/dk_j = -(M^-1 B_d)^T Phi_j M^-1 (B_w w + g)

with ``M = S + sum_j k_j Phi_j``; Phi_j has a one for each direction of a spring, and for a beam the stiffness
of its second end per unit of its modulus (DESIGN: ports; the derivative of an inverse, term by term).

Where statics alone gives the forces at the ports (S = 0: serial robots, a four-bar in its plane) they act in
series, and d is linear in the compliances: ``d = C_clamped w + sum_j B_d^T Phi_j^+ (B_w w + g) / k_j``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, OptionError, listed, suggest
from beamstiff.fem.beam_element import beam_stiffness
from beamstiff.fem.condensation import Port, condense, without_ports
from beamstiff.fem.dependent_ports import independent_ports
from beamstiff.fem.mechanism import solve_stable
from beamstiff.fem.placed_structure import place
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import refuse_idle_moments
from beamstiff.model.port_derivatives import moved_with_slopes
from beamstiff.model.pose_errors import named_by_row
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import Posture, posture
from beamstiff.robot.parts import JOINT_DIRECTIONS
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

Index = NDArray[np.int64]
Parametrisation = Literal["stiffness", "log", "compliance"]
# the power of k that a derivative by k is multiplied with to be one by the parameter
PARAMETRISATIONS: dict[str, int] = {"stiffness": 0, "log": 1, "compliance": 2}
# springs this stiff beside what else meets at their port leave nothing to doubt: no search for mechanisms
SOUND = 1e-6
SAME_LENGTH = 1e-9  # relative change of a beam's length from pose to pose that is rounding
SMALLEST = 1e-290  # its inverse is still a number


@dataclass(frozen=True)
class PortModel:
    """A robot reduced to its open stiffness values, for the rows of a measurement table."""

    parameters: tuple[str, ...]  # names of the open stiffness values (m), such as ``"J12.torsional"``
    start: Array  # (m,): their values in the robot, N/m, N m/rad or Pa; 1 where the robot says rigid or free
    springs: Array  # (m, p, p): Phi: stiffness at the ports per unit of each value
    port_stiffness: Array  # (P, p, p): S, by pose
    pose: Index  # (N,): pose of each row
    force: Array  # (N, p): B w (+ g): what the row's load does at the ports
    motion: Array  # (N, p, 6): B at the row's measured point
    clamped: Array  # (N, 6): displacement of the row with all ports held
    # (p,), m: the machine's size for ports that turn, 1 for those that slide: by it moments compare with
    # forces
    lever: Array

    def predict(self, stiffness: Array) -> Array:
        """Return the displacement ``[d, r]`` of every row, (..., N, 6), base frame, for values (..., m).

        Of `parameters`, N/m, N m/rad or Pa; zero is free. Several candidates at once along the leading axes.
        """
        if (compliance := self._in_series(stiffness)) is not None:
            shares = self.by_compliance
            assert shares is not None
            moved: Array = (compliance @ shares.reshape(-1, shares.shape[-1]).T).reshape(
                *compliance.shape[:-1], *self.clamped.shape
            )
            return self.clamped + moved
        values = self._checked(stiffness)
        own = np.tensordot(values, self.springs, 1)
        if values.ndim == 1 and self._sound(own):
            return self.clamped + moved_with_slopes(own, self.springs[:0], *self._rows)[0]
        return self.displaced(self.openings(stiffness))

    def derivatives(self, stiffness: Array, by: Parametrisation = "stiffness") -> tuple[Array, Array]:
        """Return predictions (N, 6) and their derivatives (N, 6, m) at stiffness values (m,).

        By the values k, their logarithms, or their inverses ``c = 1/k``; ``dd/dlog k = k dd/dk``, ``dd/dc =
        -k^2 dd/dk``.
        """
        if by not in PARAMETRISATIONS:
            raise BeamstiffError(
                f"there are no derivatives by {by!r}{suggest(by, PARAMETRISATIONS)}; known: "
                f"{listed(PARAMETRISATIONS)}"
            )
        power = PARAMETRISATIONS[by]  # dk/dx = k^power, or minus that
        if (compliance := self._in_series(stiffness)) is not None:
            assert self.by_compliance is not None
            return self.predict(stiffness), -self.by_compliance * _factor(compliance, 2 - power, by)
        values = self._checked(stiffness)
        own = np.tensordot(values, self.springs, 1)
        if values.ndim == 1 and self._sound(own):
            moved, by_value = moved_with_slopes(own, self.springs, *self._rows)
            return self.clamped + moved, by_value * _factor(values, power, by)
        opened = self.openings(stiffness)
        carried = self.inverse(stiffness)[self.pose] @ self.motion
        stretched = np.tensordot(opened, self.springs, ([1], [2]))  # (N, m, p)
        by_value = -carried.swapaxes(-1, -2) @ stretched.swapaxes(-1, -2)
        return self.displaced(opened), by_value * _factor(np.asarray(stiffness), power, by)

    @property
    def _rows(self) -> tuple[Array, Index, Array, Array]:
        return self.port_stiffness, self.pose, self.force, self.motion

    def displaced(self, opened: Array) -> Array:
        """Return the displacements (..., N, 6) where the ports open by (..., N, p)."""
        return self.clamped + (self.motion.swapaxes(-1, -2) @ opened[..., None])[..., 0]

    def openings(self, stiffness: Array) -> Array:
        """Return by how much the ports open in every row, ``M^-1 (B_w w + g)``, (..., N, p)."""
        slot, columns = self._columns
        if columns.shape[-1] > columns.shape[-2]:
            inverse = self.inverse(stiffness)[..., self.pose, :, :]
            return (inverse @ self.force[..., None])[..., 0]
        solved: Array = self._solve(stiffness, columns)[..., self.pose, :, slot]
        return np.moveaxis(solved, 0, -2) if solved.ndim > 2 else solved

    @cached_property
    def _columns(self) -> tuple[Index, Array]:
        """Return each row's place among those of its pose, (N,), and the forces of each pose, (P, p, R)."""
        order = np.argsort(self.pose, kind="stable")
        counts = np.bincount(self.pose, minlength=len(self.port_stiffness))
        slot = np.empty(self.pose.size, dtype=np.int64)
        slot[order] = np.arange(self.pose.size) - np.repeat(np.cumsum(counts) - counts, counts)
        columns = np.zeros((*self.port_stiffness.shape[:2], int(counts.max(initial=0))))
        columns[self.pose, :, slot] = self.force
        return slot, columns

    @cached_property
    def by_compliance(self) -> Array | None:
        """Displacement per unit of each compliance, (N, 6, m), where the forces at the ports are static.

        None where they depend on the stiffness.
        """
        owned: NDArray[np.bool_] = (self.springs != 0).any(axis=2)  # (m, p)
        if self.port_stiffness.any() or (owned.sum(axis=0) != 1).any():
            return None
        flexibility = np.zeros_like(self.springs)
        for of_spring, spring, ports in zip(flexibility, self.springs, owned, strict=True):
            of_spring[np.ix_(ports, ports)] = np.linalg.inv(spring[np.ix_(ports, ports)])
        stretched = np.tensordot(self.force, flexibility, ([1], [2]))  # (N, m, p)
        return self.motion.swapaxes(-1, -2) @ stretched.swapaxes(-1, -2)

    def _in_series(self, stiffness: Array) -> Array | None:
        """Return the compliances (..., m), if they are all that counts and the values are in order."""
        values = np.asarray(stiffness, dtype=np.float64)
        if self.by_compliance is None or values.shape[-1:] != (len(self.parameters),):
            return None
        if not ((values > SMALLEST) & np.isfinite(values)).all():
            return None
        return 1.0 / values

    def rows(self, chosen: ArrayLike) -> Self:
        """Return the model of some rows: a mask or indices."""
        at = np.asarray(chosen)
        poses, pose = np.unique(self.pose[at], return_inverse=True)
        return replace(
            self,
            port_stiffness=self.port_stiffness[poses],
            pose=pose.reshape(-1).astype(np.int64),
            force=self.force[at],
            motion=self.motion[at],
            clamped=self.clamped[at],
        )

    def along(self, rows: Measurements) -> Self:
        """Return the model of rows (N) that are read along axes of their own."""
        motion = rows.along(self.motion.swapaxes(-1, -2)).swapaxes(-1, -2)
        return replace(self, motion=motion, clamped=rows.along(self.clamped))

    def inverse(self, stiffness: Array) -> Array:
        """Return ``M^-1 = (S + sum k_j Phi_j)^-1`` of every pose, (..., P, p, p), for values (..., m)."""
        unit = np.eye(len(self.lever))
        return self._solve(stiffness, np.broadcast_to(unit, (len(self.port_stiffness), *unit.shape)))

    def _checked(self, stiffness: Array) -> Array:
        """Return stiffness values (..., m) that are some."""
        values = np.asarray(stiffness, dtype=np.float64)
        shape = (*values.shape[:-1], len(self.parameters))
        if values.shape != shape or not np.isfinite(values).all() or (values < 0).any():
            raise BeamstiffError(
                f"found the stiffness values {values.tolist()}, expected {len(self.parameters)} finite and "
                "positive ones"
            )
        return values

    @cached_property
    def _stiffest(self) -> Array:
        """Return the largest stiffness that meets at each port in any pose, (p,)."""
        largest: Array = np.diagonal(self.port_stiffness, axis1=1, axis2=2).max(axis=0, initial=0.0)
        return largest

    def _sound(self, own: Array) -> bool:
        """Return whether springs (..., p, p) are stiff enough to leave no doubt about mechanisms."""
        diagonal = np.diagonal(own, axis1=-2, axis2=-1)
        return bool((diagonal > SOUND * (diagonal + self._stiffest)).all())

    def _solve(self, stiffness: Array, right: Array) -> Array:
        """Return ``M^-1 right`` of every pose, (..., P, p, R), for values (..., m) and right (P, p, R)."""
        values = self._checked(stiffness)
        own = np.tensordot(values, self.springs, 1)[..., None, :, :]
        matrix = self.port_stiffness + own
        diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
        if self._sound(own):
            size = 1.0 / np.sqrt(diagonal)
            matrix *= size[..., :, None]
            matrix *= size[..., None, :]
            return size[..., None] * np.linalg.solve(matrix, size[..., None] * right)
        if values.ndim > 1:
            return np.stack([self._solve(candidate, right) for candidate in values])
        solution, unstable = solve_stable(matrix, right)
        if unstable is not None:
            pose, motion = unstable
            moving = np.abs(motion) > 1e-3 * np.abs(motion).max()
            owners = np.flatnonzero(self.springs[:, moving][:, :, moving].any(axis=(1, 2)))
            raise BeamstiffError(
                f"{listed([self.parameters[owner] for owner in owners])}: with so little stiffness the robot "
                f"is a mechanism at pose {pose}"
            )
        return solution


def _factor(values: Array, power: int, by: Parametrisation) -> Array:
    """Return what derivatives by the stiffness are multiplied with: a power of the values, and the sign."""
    result: Array = values**power
    return -result if by == "compliance" else result


def find_ports(robot: Robot, parameters: Sequence[str]) -> tuple[list[Port], Index]:
    """Return the ports that belong to stiffness parameters, and the parameter of each."""
    known = stiffness_parameters(robot)
    struts = {strut.name: at for at, strut in enumerate(robot.struts)}
    joints = {joint.name: at for at, joint in enumerate(robot.joints)}
    beams = {f"{beam.name}.E": at for at, beam in enumerate(robot.beams)}
    ports: list[Port] = []
    owner: list[int] = []
    for number, name in enumerate(parameters):
        if name not in known:
            raise BeamstiffError(
                f"robot {robot.name!r} has no stiffness parameter {name!r}{suggest(name, known)}"
            )
        if name in parameters[:number]:
            raise BeamstiffError(f"the stiffness parameter {name!r} is named twice")
        if name in struts:
            found = [Port(name, "strut", struts[name])]
        elif name in beams:
            found = [Port(name, "beam", beams[name], direction) for direction in range(6)]
        else:
            joint, kind = name.rsplit(".", 1)
            directions = [at for at, what in enumerate(JOINT_DIRECTIONS) if what == kind]
            found = [Port(name, "joint", joints[joint], direction) for direction in directions]
        ports += found
        owner += [number] * len(found)
    return ports, np.array(owner, dtype=np.int64)


def unit_springs(structure: Structure, posture: Posture, ports: Sequence[Port], owner: Index) -> Array:
    """Return Phi (m, p, p): the stiffness at the ports for one unit of each parameter, at the first pose."""
    result = np.zeros((int(owner.max()) + 1, len(ports), len(ports)))
    diagonal = [at for at, port in enumerate(ports) if port.kind != "beam"]
    result[owner[diagonal], diagonal, diagonal] = 1.0
    bends = [at for at, port in enumerate(ports) if port.kind == "beam" and port.direction == 0]
    if bends:
        first = posture.only(slice(1))
        lengths = place(structure, first).beam_length[0]
        full = beam_stiffness(lengths, **structure.beam_properties)  # (B, 12, 12)
        for at in bends:
            beam, some = ports[at].index, slice(at, at + 6)
            result[owner[at], some, some] = full[beam, 6:, 6:] / structure.beam_properties["E"][beam]
    return result


def _as_at_first(structure: Structure, posture: Posture, ports: Sequence[Port]) -> Array | None:
    """Return T^-T (P, p, p), with which the ports of a beam that grows with a slide are as at the first pose.

    Phi of such a beam follows its length; ``Phi = T^T Phi_1 T`` by Cholesky factors, so that with ports
    ``T y`` it is Phi_1 at all poses. None where no length changes.
    """
    bends = [at for at, port in enumerate(ports) if port.kind == "beam" and port.direction == 0]
    if not bends:
        return None
    beams = [ports[at].index for at in bends]
    lengths = place(structure, posture).beam_length[:, beams]  # (P, b)
    if (np.abs(lengths / lengths[0] - 1) <= SAME_LENGTH).all():
        return None
    properties = {name: value[beams] for name, value in structure.beam_properties.items()}
    root = np.linalg.cholesky(beam_stiffness(lengths, **properties)[..., 6:, 6:])  # (P, b, 6, 6)
    result = np.broadcast_to(np.eye(len(ports)), (len(lengths), len(ports), len(ports))).copy()
    for at, own in zip(bends, np.moveaxis(root, 1, 0), strict=True):
        result[:, at : at + 6, at : at + 6] = own[0] @ np.linalg.inv(own)
    return result


def opened(robot: Robot, parameters: Sequence[str]) -> Robot:
    """Return the robot with a number for every parameter that is `rigid` or `free`, so that it is a port."""
    known = stiffness_parameters(robot)
    values: Mapping[str, float] = {name: 1.0 for name in parameters if known.get(name) in (RIGID, FREE)}
    return robot.with_parameters(values) if values else robot


def reduce_to_ports(
    robot: Robot,
    measurements: Measurements,
    parameters: Sequence[str] | None = None,
    gravity: bool | None = None,
) -> PortModel:
    """Reduce a robot to the ports of `parameters` (default ``robot.identify``) for the rows of a table.

    `gravity` adds the dead weight; by default for absolute positions, not for displacements (loaded minus
    unloaded).
    """
    names = tuple(parameters if parameters is not None else robot.identify)
    if not names:
        given = stiffness_parameters(robot).items()
        such = next((f", such as {name}" for name, value in given if FREE < value < RIGID), "")
        raise OptionError(
            "parameters",
            f"robot {robot.name!r} names no parameters under `identify`; name some there or here{such}",
        )
    ports, owner = find_ports(robot, names)
    open_robot = opened(robot, names)
    structure = compile_structure(open_robot)
    refuse_idle_moments(robot, measurements)
    poses, pose = np.unique(measurements.q, axis=0, return_inverse=True)
    pose = pose.reshape(-1).astype(np.int64)
    observed = list(dict.fromkeys([*measurements.point.tolist(), *measurements.load_point.tolist()]))
    at_poses = posture(structure.kinematics, poses)
    springs = unit_springs(structure, at_poses, ports, owner)
    turned = _as_at_first(structure, at_poses, ports)
    independent, share = independent_ports(structure, at_poses, ports)
    if independent.size < len(ports):
        if turned is not None:
            raise BeamstiffError(
                f"robot {robot.name!r}: found springs in parallel beside the modulus of a beam that changes "
                "its length; leave one of them out"
            )
        if any(strut.EA for strut in robot.struts if strut.name in names):
            raise BeamstiffError(
                f"robot {robot.name!r}: found springs in parallel beside a strut with EA; leave one of them "
                "out"
            )
        # springs in parallel: those at the others act at the independent ones
        structure, ports = without_ports(structure, ports), [ports[at] for at in independent]
        springs = share.T @ springs @ share
    with named_by_row(measurements, pose):
        condensed = condense(structure, at_poses, observed, ports)
    at = {name: 6 * number + np.arange(6) for number, name in enumerate(observed)}
    seen = np.array([at[name] for name in measurements.point])
    loaded = np.array([at[name] for name in measurements.load_point])
    rows = np.arange(pose.size)
    maps = condensed.port_map[pose]  # (N, p, o)
    motion = maps[rows[:, None], :, seen].swapaxes(-1, -2)
    from_load = maps[rows[:, None], :, loaded].swapaxes(-1, -2)
    force = (from_load @ measurements.wrench[..., None])[..., 0]
    clamped = np.einsum(
        "nab,nb->na",
        condensed.clamped[pose][rows[:, None, None], seen[:, :, None], loaded[:, None, :]],
        measurements.wrench,
    )
    if gravity if gravity is not None else measurements.kind == "absolute":
        force = force + condensed.port_dead[pose]
        clamped = clamped + condensed.clamped_dead[pose][rows[:, None], seen]
    port_stiffness = condensed.port_stiffness
    if turned is not None:
        port_stiffness = turned @ port_stiffness @ turned.swapaxes(-1, -2)
        force = (turned[pose] @ force[..., None])[..., 0]
        motion = turned[pose] @ motion
    return PortModel(
        parameters=names,
        start=np.array([stiffness_parameters(open_robot)[name] for name in names]),
        springs=springs,
        port_stiffness=port_stiffness,
        pose=pose,
        force=force,
        motion=motion,
        clamped=clamped,
        lever=np.array([structure.kinematics.size if port.direction > 2 else 1.0 for port in ports]),
    )
