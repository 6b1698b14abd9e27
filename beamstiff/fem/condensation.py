"""Static condensation by Schur complement: to the TCP (seed 003, eqs 24 to 27), and to ports.

A port is a direction whose stiffness is left open: a joint's relative displacement or a strut's elongation.
With the ports' displacements e and the wrench w on the observed nodes, all else eliminated::

    (S + diag k) e = B w + g          u = B^T e + C_clamped w + d_clamped

so that the compliance at the observed nodes is ``C(k) = C_clamped + B^T (S + diag k)^-1 B``. Without ports it
is ``C_clamped``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.expression_graph.graph import MANY
from beamstiff.fem.assembly import assemble, node_map, scatter, sparse_stiffness, stiffness_between
from beamstiff.fem.condensation_program import CondensationProgram, condensation_program
from beamstiff.fem.constraints import (
    beam_rows,
    constraint_rows,
    has_constraints,
    imposed,
    joint_rows,
    null_space,
    ranks,
    strut_row,
    unknown_sizes,
)
from beamstiff.fem.large.robot import MANY_UNKNOWNS, solve_sparse
from beamstiff.fem.loads import gravity_wrenches
from beamstiff.fem.mechanism import solve_firm, solve_stable
from beamstiff.fem.orthogonal_factor import Factored, factored_at
from beamstiff.fem.placed_structure import Geometry, place, rod_flexibility
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import joint_unknowns
from beamstiff.robot.frames import same_geometry
from beamstiff.robot.kinematics import ClosedPosture, Posture
from beamstiff.se3 import Array

STIFFEST = 1e-10  # a scaled compliance below this is rounding
ROUNDING = 1e-11  # of the stiffness that meets at a port of a large structure
FAINT = 1e-7  # of the same: below this, what is left of it has lost digits that could show
MOST_ENTRIES = 2_000_000  # of the maps of observed nodes of a chunk
# of the largest component of a wrench: what is smaller comes from the compliance's rounding
FAINT_COMPONENT = 1e-9
CHUNK = 128  # poses at a time: the matrices of a chunk stay in the processor's cache


@dataclass(frozen=True)
class Port:
    """A direction whose stiffness is left open."""

    name: str  # of the stiffness parameter it belongs to
    kind: Literal["joint", "strut", "beam"]
    index: int  # of the joint, strut or beam in the robot
    # 0..5: of the joint's frame, or of the beam's local axes (second end against the first carried along)
    direction: int = 0


@dataclass(frozen=True)
class Condensed:
    """The structure seen from its ports and observed nodes, batched over P poses."""

    port_stiffness: Array  # (P, p, p): S: what the rest of the structure adds to the ports' own springs
    # (P, p, o): B: force at the ports per wrench at the observed nodes (o = 6 times their number)
    port_map: Array
    clamped: Array  # (P, o, o): compliance at the observed nodes with all ports held
    # port_dead, clamped_dead, (P, p), (P, o): g and d_clamped: what the dead weight does
    port_dead: Array
    clamped_dead: Array


def condense(
    structure: Structure,
    posture: Posture,
    observed: Sequence[str],
    ports: Sequence[Port] = (),
    chunk: int = CHUNK,
    dead: bool = True,
) -> Condensed:
    """Condense a structure to ports and observed nodes (six components each) at every pose.

    Many poses that follow from joint values go by the program of the structure (`condensation_program`), as
    far as that is sure of its answer; all else goes by matrices, `chunk` poses at a time. The present
    stiffness of the ports is not used. Without `dead` the parts of the dead weight may be zero.
    """
    condensed = _condensed(structure, posture, observed, ports, chunk, dead)
    return _behind_rods(structure, posture, ports, condensed)


def _behind_rods(
    structure: Structure, posture: Posture, ports: Sequence[Port], condensed: Condensed
) -> Condensed:
    """Return what is seen from the springs of struts whose own length is compliant too, in series with them.

    What the rod of flexibility F takes up of the strut's elongation, ``d = F (S_s e - B_s w - g_s)`` but for
    its own share, is eliminated like all else.
    """
    at = [
        number
        for number, port in enumerate(ports)
        if port.kind == "strut" and structure.robot.struts[port.index].EA is not None
    ]
    if not at:
        return condensed
    struts, poses = np.array([ports[number].index for number in at]), len(condensed.port_stiffness)
    rod = rod_flexibility(structure, posture, struts, np.arange(poses))
    own = condensed.port_stiffness[:, at][:, :, at]
    held = np.linalg.solve(np.eye(len(at)) + rod[:, :, None] * own, rod[:, :, None] * np.eye(len(at)))
    seen, weight = condensed.port_map[:, at], condensed.port_dead[:, at, None]  # (P, s, o), (P, s, 1)
    to_seen = (held @ seen).swapaxes(-1, -2)
    across = condensed.port_stiffness[:, :, at]
    return Condensed(
        port_stiffness=_symmetric(condensed.port_stiffness - across @ held @ across.swapaxes(-1, -2)),
        port_map=condensed.port_map - across @ held @ seen,
        clamped=condensed.clamped + to_seen @ seen,
        port_dead=condensed.port_dead - (across @ held @ weight)[..., 0],
        clamped_dead=condensed.clamped_dead + (to_seen @ weight)[..., 0],
    )


def _condensed(
    structure: Structure,
    posture: Posture,
    observed: Sequence[str],
    ports: Sequence[Port],
    chunk: int,
    dead: bool,
) -> Condensed:
    index = structure.kinematics.node_index
    for name in observed:
        if name not in index:
            raise BeamstiffError(f"robot {structure.robot.name!r} has no node {name!r}{suggest(name, index)}")
    if len(posture.values) == 0:
        raise BeamstiffError("no poses: expected at least one")
    everything = np.arange(len(posture.values))
    program = _program(structure, posture, observed, ports, dead)
    if program is None:
        return condense_by_matrices(structure, posture, observed, ports, chunk, everything)
    parts, sure = program.run(posture.values)

    def exact(pose: int) -> Array:
        some = np.array([pose])
        one = condense_by_matrices(structure, posture.only(some), observed, ports, 1, some)
        return np.asarray(one.port_stiffness[0])

    sure &= _sure_of_ports(parts[0], program.port_size[None], sure, exact)
    rest = np.flatnonzero(~sure)
    if rest.size:
        others = condense_by_matrices(structure, posture.only(rest), observed, ports, chunk, rest)
        for part, item in zip(parts, fields(Condensed), strict=True):
            part[rest] = getattr(others, item.name)
    return Condensed(*parts)


def _program(
    structure: Structure, posture: Posture, observed: Sequence[str], ports: Sequence[Port], dead: bool
) -> CondensationProgram | None:
    """Return the program for these poses: the one place that decides which way they go."""
    if len(posture.values) < MANY or not isinstance(posture, ClosedPosture) or posture.kinematics is None:
        return None
    if not same_geometry(posture.kinematics, structure.kinematics):
        return None
    own = port_unknowns(structure, ports)
    if -1 in own:
        return None
    index = structure.kinematics.node_index
    return condensation_program(structure, tuple(index[name] for name in observed), tuple(own), dead)


def condense_by_matrices(
    structure: Structure,
    posture: Posture,
    observed: Sequence[str],
    ports: Sequence[Port],
    chunk: int,
    number: NDArray[np.int64],
) -> Condensed:
    """Do what `condense` does, for any structure and posture; `number` stands for the poses in messages."""
    open_structure = without_ports(structure, ports)
    poses = posture.node_positions.shape[0]
    chunk = max(1, min(chunk, MOST_ENTRIES // (6 * max(1, structure.unknowns.count))))
    parts = []
    for start in range(0, poses, chunk):
        some = slice(start, start + chunk)
        geometry = place(open_structure, posture.only(some), number[some])
        parts.append(_condense_chunk(open_structure, geometry, observed, ports))
    return _joined(parts, np.arange(poses))


def _joined(parts: Sequence[Condensed], number: NDArray[np.int64]) -> Condensed:
    """Return one of many, with the poses in the order of their numbers."""
    order = np.argsort(number)
    names = [item.name for item in fields(Condensed)]
    return Condensed(*(np.concatenate([getattr(part, name) for part in parts])[order] for name in names))


def without_ports(structure: Structure, ports: Sequence[Port]) -> Structure:
    """Return the structure with the springs of the ports taken out, exactly."""
    springs, struts = structure.spring_values.copy(), structure.strut_values.copy()
    chords, number = structure.chord_values.copy(), joint_unknowns(structure.unknowns)
    # a beam whose six directions are ports carries nothing itself
    beams = structure.beam_properties | {name: structure.beam_properties[name].copy() for name in ("E", "J")}
    for port in ports:
        if port.kind == "strut":
            struts[structure.struts == port.index] = 0.0
        elif port.kind == "beam":
            beams["E"][port.index] = beams["J"][port.index] = 0.0
        else:
            springs[structure.springs == number.get((port.index, port.direction), -1)] = 0.0
            chords[structure.chords == port.index, port.direction] = 0.0
    return replace(
        structure, spring_values=springs, strut_values=struts, chord_values=chords, beam_properties=beams
    )


def _condense_chunk(
    structure: Structure, geometry: Geometry, observed: Sequence[str], ports: Sequence[Port]
) -> Condensed:
    """Return poses condensed to ports p, the rest r eliminated: ``S = K_pp - K_pr K_rr^-1 K_rp``.

    With W the motion of the observed nodes by unknowns: ``B^T = W_p - W_r K_rr^-1 K_rp`` and
    ``C_clamped = W_r K_rr^-1 W_r^T``.
    """
    if has_constraints(structure):
        rank = ranks(constraint_rows(structure, geometry), unknown_sizes(structure))
        if (
            rank != rank[0]
        ).any():  # singular positions of a loop move in more ways: pose by pose, each is exact
            groups = [np.flatnonzero(rank == value) for value in np.unique(rank)]
            parts = [_condense_chunk(structure, geometry.only(some), observed, ports) for some in groups]
            return _joined(parts, np.concatenate(groups))
    index = structure.kinematics.node_index
    maps = [node_map(structure, geometry, index[name]) for name in observed]
    watch = np.concatenate(maps, axis=1)  # u_observed = watch @ z
    dead = scatter(structure, geometry, gravity_wrenches(structure, geometry))
    rest, moved = _split(structure, geometry, ports)
    of_unknowns = rest.ndim == 1
    large = of_unknowns and rest.size > MANY_UNKNOWNS
    if of_unknowns:
        watch_r, watch_p, dead_r, dead_p = (
            watch[:, :, rest],
            watch[:, :, moved],
            dead[:, rest],
            dead[:, moved],
        )
    else:
        rest_t, moved_t = rest.swapaxes(-1, -2), moved.swapaxes(-1, -2)
        watch_r, watch_p = watch @ rest, watch @ moved
        dead_r, dead_p = (rest_t @ dead[..., None])[..., 0], (moved_t @ dead[..., None])[..., 0]
    if large:
        each = [sparse_stiffness(structure, geometry.only(np.array([at]))) for at in range(len(watch))]
        columns = np.array([matrix[:, moved].toarray() for matrix in each]).reshape(*dead.shape, moved.size)
        k_rp, k_pp = columns[:, rest], columns[:, moved]
        size_p = np.diagonal(k_pp, axis1=1, axis2=2)
    else:
        stiffness, size = assemble(structure, geometry)
        if of_unknowns:
            size_r, size_p = size[:, rest], size[:, moved]
            k_rr = stiffness[:, rest[:, None], rest]
            k_rp, k_pp = stiffness[:, rest[:, None], moved], stiffness[:, moved[:, None], moved]
        else:
            size_r, size_p = ((size[:, None] @ basis**2)[:, 0] for basis in (rest, moved))
            along_rest, along_moved = stiffness @ rest, stiffness @ moved
            k_rr, k_rp, k_pp = rest_t @ along_rest, rest_t @ along_moved, moved_t @ along_moved
    right = np.concatenate([k_rp, watch_r.swapaxes(-1, -2), dead_r[..., None]], axis=2)
    if large:
        every = np.zeros((*dead.shape, right.shape[2]))
        every[:, rest] = right
        solved = solve_sparse(structure, geometry, every, rest)[:, rest]
    else:
        solved, firm = solve_firm(k_rr, right, size_r)
    p, o = k_rp.shape[2], watch.shape[1]
    to_ports, to_watch, to_dead = solved[:, :, :p], solved[:, :, p : p + o], solved[:, :, p + o]
    k_pr = k_rp.swapaxes(-1, -2)
    if of_unknowns or p == 0:
        port_stiffness = _symmetric(k_pp - k_pr @ to_ports)
    else:  # bases mix stiff and soft unknowns: differences of their stiffness would be rounding
        _, unbalanced = stiffness_between(structure, geometry, moved - rest @ to_ports)
        to_ports = to_ports + solve_firm(k_rr, rest.swapaxes(-1, -2) @ unbalanced, size_r)[0]
        port_stiffness = _symmetric(stiffness_between(structure, geometry, moved - rest @ to_ports)[0])
    result = Condensed(
        port_stiffness=port_stiffness,
        port_map=(watch_p - watch_r @ to_ports).swapaxes(-1, -2),
        clamped=_symmetric(watch_r @ to_watch),
        # by `to_ports`, as the map above: it is the one that was refined
        port_dead=dead_p - (dead_r[:, None] @ to_ports)[:, 0],
        clamped_dead=(watch_r @ to_dead[..., None])[..., 0],
    )
    if large:
        return replace(result, port_stiffness=_without_rounding(port_stiffness, size_p))
    if of_unknowns:
        every = np.diag(unknown_sizes(structure))
        rest, moved = (
            np.broadcast_to(every[:, some], (len(watch), *every[:, some].shape)) for some in (rest, moved)
        )
        moved = moved / unknown_sizes(structure)[:, None]
    loads = np.concatenate([watch, dead[:, None]], axis=1).swapaxes(-1, -2)

    def exact(pose: int) -> Factored:
        return factored_at(structure, geometry, pose, rest[pose], loads[pose], moved[pose], works=True)

    firm &= _sure_of_ports(port_stiffness, size_p, firm, lambda pose: exact(pose).port_stiffness)
    for pose in np.flatnonzero(~firm):
        found = exact(int(pose))
        result.port_stiffness[pose] = found.port_stiffness
        result.port_map[pose], result.port_dead[pose] = found.port_force[:, :o], found.port_force[:, o]
        result.clamped[pose], result.clamped_dead[pose] = found.work[:o, :o], found.work[:o, o]
    return result


def _sure_of_ports(
    port_stiffness: Array, size: Array, firm: NDArray[np.bool_], exact: Callable[[int], Array]
) -> NDArray[np.bool_]:
    """Return at which poses (P,) the stiffness at the ports is known, and make zero of what is rounding.

    `port_stiffness` (P, p, p) is changed where nothing but its own spring holds a port: it may be set free
    later. `size` (P, p) is how large what meets at the ports is, `firm` (P,) says where the answer is known
    otherwise, and `exact` gives the stiffness at a pose beyond doubt.
    """
    own = np.abs(np.diagonal(port_stiffness, axis1=1, axis2=2))
    faint = (own < FAINT * size) & (port_stiffness != 0.0).any(axis=2) & firm[:, None]
    if faint.any():
        unsupported = faint & (np.diagonal(exact(int(np.argmax(faint.any(axis=1))))) == 0.0)
        port_stiffness[unsupported] = 0.0
        port_stiffness.swapaxes(1, 2)[unsupported] = 0.0
        faint &= ~unsupported
    return np.asarray(~faint.any(axis=1))


def _split(
    structure: Structure, geometry: Geometry, ports: Sequence[Port]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return how the unknowns follow from the rest and the ports: indices where they are unknowns or bases.

    ``z = rest @ y + moved @ e``; where every port is an unknown of its own and no loop of rigid parts
    constrains them, `rest` and `moved` are plain index arrays.
    """
    unknowns, what = structure.unknowns, f"robot {structure.robot.name!r}"
    own = port_unknowns(structure, ports)
    constrained = has_constraints(structure)
    if not constrained and all(at >= 0 for at in own):
        moved = np.array(own, dtype=np.int64)
        return np.setdiff1d(np.arange(unknowns.count), moved), moved
    poses, scale = geometry.number.size, unknown_sizes(structure)
    rows = [port_row(structure, geometry, port) for port in ports]
    port_rows = np.concatenate([np.zeros((poses, 0, unknowns.count)), *rows], axis=1)
    fixed_rows = constraint_rows(structure, geometry)
    basis = np.broadcast_to(np.diag(scale), (poses, scale.size, scale.size))
    if constrained:
        basis = null_space(fixed_rows, scale, what)
    moved_basis = imposed(port_rows, basis, [port.name for port in ports])
    return null_space(np.concatenate([fixed_rows, port_rows], axis=1), scale, what), moved_basis


def port_unknowns(structure: Structure, ports: Sequence[Port]) -> list[int]:
    """Return the unknown that each port is; -1 where it is none by itself."""
    number = joint_unknowns(structure.unknowns)
    return [number.get((port.index, port.direction), -1) if port.kind == "joint" else -1 for port in ports]


def port_row(structure: Structure, geometry: Geometry, port: Port) -> Array:
    """Return the displacement of a port as a row on the unknowns, (P, 1, n)."""
    if port.kind == "strut":
        return strut_row(structure, geometry, port.index)
    rows = (joint_rows if port.kind == "joint" else beam_rows)(structure, geometry, port.index)
    return rows[:, port.direction : port.direction + 1]


def _without_rounding(port_stiffness: Array, size: Array) -> Array:
    # where nothing but its own spring holds a port, rounding must not: it may be set free later
    left = np.abs(port_stiffness) > ROUNDING * np.sqrt(size[:, :, None] * size[:, None, :])
    return np.where(left, port_stiffness, 0.0)


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.swapaxes(-1, -2))


def tcp_compliance(structure: Structure, posture: Posture, chunk: int = CHUNK) -> Array:
    """Return the compliance at the TCP of every pose, (P, 6, 6), base frame: ``[d, r] = C [f, m]``."""
    return condense(structure, posture, [structure.robot.tcp], chunk=chunk, dead=False).clamped


def tcp_stiffness(compliance: Array, robot: str = "robot") -> Array:
    """Return the stiffness at the TCP, (..., 6, 6), the inverse of its compliance (seed 003, eq. 27)."""
    flat = compliance.reshape(-1, 6, 6)
    inverse, unstable = solve_stable(flat, np.broadcast_to(np.eye(6), flat.shape), softest=STIFFEST)
    if unstable is not None:
        pose, motion = unstable
        names = ("fx", "fy", "fz", "mx", "my", "mz")
        most = names[int(np.argmax(np.abs(motion)))]
        raise BeamstiffError(
            f"{robot}: singular compliance at pose {pose}: the TCP is rigid against some wrench (mostly "
            f"{most}); its stiffness there is infinite, use the compliance instead"
        )
    return _symmetric(inverse).reshape(compliance.shape)


def rigid_wrenches(compliance: Array) -> Array:
    """Return a basis (R, 6) of the wrenches that displace nothing, of one compliance (6, 6).

    Each is 1 in a component that the others do not have, so that a rigid axis stands alone.
    """
    if not np.isfinite(compliance).all():
        return np.zeros((0, 6))
    size = np.abs(np.diagonal(compliance)).reshape(2, 3).max(axis=1)
    unit = np.repeat(np.sqrt(np.where(size > 0.0, size, 1.0)), 3)  # forces and moments of like effect
    _, singular, rows = np.linalg.svd(compliance / np.outer(unit, unit))
    basis = rows[singular <= STIFFEST * max(singular[0], 1e-300)]
    if not len(basis):
        return np.zeros((0, 6))
    pivots = qr(basis, mode="r", pivoting=True)[1][: len(basis)]
    basis = np.linalg.solve(basis[:, pivots], basis)[np.argsort(pivots)]
    basis = np.where(np.abs(basis) > FAINT_COMPONENT, basis, 0.0) / unit
    return np.asarray(basis / basis[np.arange(len(basis)), np.sort(pivots)][:, None])
