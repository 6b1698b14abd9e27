"""Strains of the deformed machine's members, their derivatives, and the geometric part of the tangent.

A member's strain is the place and the rotation vector of its second end as seen from its first; a bar's
stretch counts what its bending shortens it by. A rod's is the change of its length.
"""

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Integers
from beamstiff.exam.layout import Layout, Topology
from beamstiff.exam.rotations import apply, cross_matrix, turned_by, vector_rate


@dataclass(frozen=True, eq=False)
class State:
    """The deformed machine; P states, B bodies with the ground."""

    moved: Array  # (P, B, 3): m; displacement of the bodies' reference points
    turned: Array  # (P, B, 3, 3): rotation of the bodies
    hold: Array  # (P, C): N and N m; forces that keep rigid directions closed

    def point(self, body: Integers, arm: Array, states: Integers | slice = slice(None)) -> Array:
        """Return the displacement of points of bodies, in all states or in one for each point."""
        return self.moved[states, body] + apply(self.turned[states, body] - np.eye(3), arm)


@dataclass(frozen=True, eq=False)
class Strain:
    """Strains of all members, M = 6 E + S rows; rates by displacement and spin of both bodies."""

    rows: Array  # (P, M)
    rates: Array  # (P, E, 6, 12): of the members' strains
    plain: Array  # (P, E, 6, 12): the same before bending shortens bars
    axes: Array  # current axes
    rate: Array  # inverse Jacobian of the rotation vector
    second: Array  # arms
    from_first: Array
    bent: Array  # (P, E, 6): strains before bending shortens
    rod_rates: Array  # (P, S, 12): of the rods' change of length
    rod_arms: Array  # (2, P, S, 3): current arms of their ends
    along: Array  # (P, S, 3): of the rods
    length: Array  # (P, S)


@dataclass(frozen=True, eq=False)
class Tangent:
    """Slopes of the members' forces by their strains."""

    members: Array  # (P, E, 6, 6)
    rods: Array  # (P, S)
    between: list[tuple[int, int, Array | float]]  # slopes of a row's force by another member's row

    def add(self, row: int, other: int, slope: Array | float) -> None:
        """Add to the slope of one row's force by another row's strain."""
        count = 6 * self.members.shape[1]
        if row >= count and row == other:
            self.rods[:, row - count] += slope
        elif max(row, other) < count and row // 6 == other // 6:
            self.members[:, row // 6, row % 6, other % 6] += slope
        else:
            self.between.append((row, other, slope))

    def force(self, strain: Array) -> Array:
        """Return the forces (P, M) of strains (P, M)."""
        poses, members = self.members.shape[:2]
        of_members, of_rods = np.split(strain, [6 * members], axis=1)
        stretched = self.members @ of_members.reshape(poses, members, 6, 1)
        force = np.concatenate([stretched.reshape(poses, -1), self.rods * of_rods], axis=1)
        for row, other, slope in self.between:
            force[:, row] += slope * strain[:, other]
        return force


def strain_of(topology: Topology, layout: Layout, state: State) -> Strain:
    """Return the strains of the members of the deformed machine."""
    a, b = topology.members.T
    poses, members = layout.axes.shape[:2]
    turn_a, turn_b = state.turned[:, a], state.turned[:, b]
    apart = state.point(b, layout.second) - state.point(a, layout.first)
    second = apply(turn_b, layout.second)
    between = layout.rest + apart
    from_first = apply(turn_a, layout.first) + between
    axes = turn_a @ layout.axes
    across = np.swapaxes(axes, -1, -2)
    back = apply(np.swapaxes(turn_a - np.eye(3), -1, -2), layout.rest)
    place = (across @ apart[..., None] + np.swapaxes(layout.axes, -1, -2) @ back[..., None])[..., 0]
    angle = turned_by(across @ turn_b @ layout.axes)
    rate = vector_rate(angle)
    e = np.concatenate([place, angle], axis=-1)

    spin = rate @ across
    plain = np.zeros((poses, members, 6, 12))
    plain[..., :3, 0:3] = -across
    plain[..., :3, 3:6] = across @ cross_matrix(from_first)
    plain[..., :3, 6:9] = across
    plain[..., :3, 9:12] = -across @ cross_matrix(second)
    plain[..., 3:, 3:6], plain[..., 3:, 9:12] = -spin, spin
    shortened, rates = e, plain
    if bars := layout.bending.shape[1]:
        slope = (layout.bending @ e[:, -bars:, :, None])[..., 0]
        shortened, rates = e.copy(), plain.copy()
        shortened[:, -bars:, 0] += 0.5 * np.sum(slope * e[:, -bars:], axis=-1)
        rates[:, -bars:, 0] += (slope[..., None, :] @ plain[:, -bars:])[..., 0, :]

    longer, rod_rates, rod_arms, along, length = _rods_of(topology, layout, state)
    rows = np.concatenate([shortened.reshape(poses, -1), longer], axis=1)
    return Strain(rows, rates, plain, axes, rate, second, from_first, e, rod_rates, rod_arms, along, length)


def _rods_of(topology: Topology, layout: Layout, state: State) -> tuple[Array, Array, Array, Array, Array]:
    """Return the rods' change of length, its rates, and their present arms, directions and lengths."""
    c, d = topology.rods.T
    stretch = state.point(d, layout.rod_second) - state.point(c, layout.rod_first)
    span = layout.rod + stretch
    length = np.linalg.norm(span, axis=-1)
    rest = np.linalg.norm(layout.rod, axis=-1)
    along = span / length[..., None]
    longer = np.sum((2.0 * layout.rod + stretch) * stretch, axis=-1) / (length + rest)
    first, second = apply(state.turned[:, c], layout.rod_first), apply(state.turned[:, d], layout.rod_second)
    rates = np.concatenate([-along, -np.cross(first, along), along, np.cross(second, along)], axis=-1)
    return longer, rates, np.stack([first, second]), along, length


def row_rates(topology: Topology, strain: Strain, rows: Integers) -> Array:
    """Return the rates (P, R, 6 B) of some strains by the motion of all bodies."""
    poses, members = len(strain.rows), 6 * len(topology.members)
    ends = np.concatenate([np.repeat(topology.members, 6, axis=0), topology.rods])
    rates = np.concatenate([strain.rates.reshape(poses, members, 12), strain.rod_rates], axis=1)[:, rows]
    result = np.zeros((poses, len(rows), topology.bodies, 6))
    for body, some in zip(ends[rows].T, np.split(rates, 2, axis=2), strict=True):
        result[:, np.arange(len(rows)), body] += some
    return result.reshape(poses, len(rows), 6 * topology.bodies)


def resisting(topology: Topology, strain: Strain, force: Array) -> Array:
    """Return the bodies' forces and moments (P, 6 B) that balance forces of the members (P, M)."""
    poses, members = strain.rates.shape[:2]
    of_members = np.swapaxes(strain.rates, -1, -2) @ force[:, : 6 * members].reshape(poses, members, 6, 1)
    pairs = [(ends, of_members[:, at, :, 0]) for at, ends in enumerate(topology.members)]
    of_rods = strain.rod_rates * force[:, 6 * members :, None]
    pairs += [(ends, of_rods[:, at]) for at, ends in enumerate(topology.rods)]
    result = np.zeros((poses, topology.bodies, 6))
    for (first, second), both in pairs:
        result[:, first] += both[:, :6]
        result[:, second] += both[:, 6:]
    return result.reshape(poses, -1)


def add_stiffness(
    system: Array, topology: Topology, layout: Layout, strain: Strain, force: Array, tangent: Tangent
) -> None:
    """Add to a system (P, n, n) how bodies' forces change with their motion, of members' forces (P, M)."""
    poses, members = layout.axes.shape[:2]
    s = force[:, : 6 * members].reshape(poses, members, 6)
    bars = layout.bending.shape[1]
    if bars:  # forces of the strains before bending shortens
        slope = (layout.bending @ strain.bent[:, -bars:, :, None])[..., 0]
        s = s.copy()
        s[:, -bars:] += s[:, -bars:, :1] * slope
    pull = strain.axes @ s[..., :3, None]
    F = cross_matrix(pull[..., 0])
    M = 0.5 * cross_matrix((strain.axes @ np.swapaxes(strain.rate, -1, -2) @ s[..., 3:, None])[..., 0])
    S_b, S_c = cross_matrix(strain.second), cross_matrix(strain.from_first)
    back = F @ S_b
    block = np.swapaxes(strain.rates, -1, -2) @ (tangent.members @ strain.rates)
    block[..., 6:9, 3:6] -= F
    block[..., 9:12, 3:6] -= S_b @ F + M
    block[..., 9:12, 9:12] += back - M
    block[..., 0:3, 3:6] += F
    block[..., 3:6, 0:3] -= F
    block[..., 3:6, 6:9] += F
    block[..., 3:6, 3:6] += S_c @ F + M
    block[..., 3:6, 9:12] += M - back
    if bars:
        stretch, plain = force[:, 6 * (members - bars) : 6 * members : 6], strain.plain[:, -bars:]
        block[:, -bars:] += np.swapaxes(plain, -1, -2) @ (stretch[..., None, None] * layout.bending) @ plain
    for at, (i, j) in enumerate(topology.members):
        _add(system, i, j, block[:, at])
    if len(topology.rods):
        _add_rods(system, topology, strain, force[:, 6 * members :], tangent)
    n = 6 * topology.bodies
    for row, other, its_slope in tangent.between:
        its, others = np.split(row_rates(topology, strain, np.array([row, other])), 2, axis=1)
        system[:, :n, :n] += np.reshape(its_slope, (-1, 1, 1)) * np.swapaxes(its, -1, -2) * others


def _add_rods(system: Array, topology: Topology, strain: Strain, pull: Array, tangent: Tangent) -> None:
    across = np.eye(3) - strain.along[..., :, None] * strain.along[..., None, :]
    K = (pull / strain.length)[..., None, None] * across
    N = cross_matrix(pull[..., None] * strain.along)
    A, B = cross_matrix(strain.rod_arms)
    rod = np.zeros((*pull.shape, 12, 12))
    ends = ((slice(0, 3), slice(3, 6), A, -1.0), (slice(6, 9), slice(9, 12), B, 1.0))
    for u, r, arm, sign in ends:
        for v, t, other, way in ends:
            both = sign * way
            rod[..., u, v] = both * K
            rod[..., u, t] = -both * K @ other
            rod[..., r, v] = both * arm @ K
            rod[..., r, t] = -both * arm @ K @ other
        rod[..., r, r] += sign * N @ arm
    rates = strain.rod_rates
    rod += (tangent.rods[..., None] * rates)[..., :, None] * rates[..., None, :]
    for at, (i, j) in enumerate(topology.rods):
        _add(system, i, j, rod[:, at])


def _add(system: Array, i: int, j: int, block: Array) -> None:
    """Add a block (P, 12, 12) of two bodies."""
    first, second = slice(6 * i, 6 * i + 6), slice(6 * j, 6 * j + 6)
    system[:, first, first] += block[:, :6, :6]
    system[:, first, second] += block[:, :6, 6:]
    system[:, second, first] += block[:, 6:, :6]
    system[:, second, second] += block[:, 6:, 6:]
