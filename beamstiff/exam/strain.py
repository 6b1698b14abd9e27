"""Strains of the deformed machine's members, their derivatives, and the geometric part of the tangent.

A member's strain is the place and the rotation vector of its second end as seen from its first; a bar's
stretch counts what its bending shortens it by. A rod's is the change of its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.layout import Layout, Topology
from beamstiff.exam.rotations import cross_matrix, turned_by, vector_rate


@dataclass(frozen=True, eq=False)
class State:
    """The deformed machine; P states, B bodies with the ground.

    Attributes
    ----------
    moved : (P, B, 3) array, m
        Displacement of the bodies' reference points.
    turned : (P, B, 3, 3) array
        Rotation of the bodies.
    hold : (P, C) array, N and N m
        Forces that keep rigid directions closed.
    """

    moved: Array
    turned: Array
    hold: Array

    def point(self, body: object, arm: Array) -> Array:
        """Return the displacement of points of bodies."""
        turned = self.turned[:, body]  # type: ignore[index]
        shift = ((turned - np.eye(3)) @ arm[..., None])[..., 0]
        result: Array = self.moved[:, body] + shift  # type: ignore[index]
        return result


@dataclass(frozen=True, eq=False)
class Strain:
    """Strains of all members, M = 6 E + S rows.

    Attributes
    ----------
    rows : (P, M) array
    rates : (P, M, 6 B) array
        By displacement and spin of the bodies.
    plain : (P, E, 6, 12) array
        Rates of the members' strains before bending shortens bars, by either body.
    axes, rate, second, from_first : arrays
        Current axes, inverse Jacobian of the rotation vector, and arms, for the geometric part.
    bent : (P, E, 6) array
        Strains before bending shortens.
    along, length : (P, S, 3), (P, S) arrays
        Of the rods.
    """

    rows: Array
    rates: Array
    plain: Array
    axes: Array
    rate: Array
    second: Array
    from_first: Array
    bent: Array
    along: Array
    length: Array


def strain_of(topology: Topology, layout: Layout, state: State) -> Strain:
    """Return the strains of the members of the deformed machine."""
    a, b = topology.members.T
    poses, members = layout.axes.shape[:2]
    turn_a, turn_b = state.turned[:, a], state.turned[:, b]
    apart = state.point(b, layout.second) - state.point(a, layout.first)
    second = (turn_b @ layout.second[..., None])[..., 0]
    between = layout.rest + apart
    from_first = (turn_a @ layout.first[..., None])[..., 0] + between
    axes = turn_a @ layout.axes
    across = np.swapaxes(axes, -1, -2)
    back = (np.swapaxes(turn_a - np.eye(3), -1, -2) @ layout.rest[..., None])[..., 0]
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
    slope = (layout.bending @ e[..., None])[..., 0]
    shortened = e.copy()
    shortened[..., 0] += 0.5 * np.sum(slope * e, axis=-1)
    member_rates = plain.copy()
    member_rates[..., 0, :] += (slope[..., None, :] @ plain)[..., 0, :]

    c, d = topology.rods.T
    stretch = state.point(d, layout.rod_second) - state.point(c, layout.rod_first)
    span = layout.rod + stretch
    length = np.linalg.norm(span, axis=-1)
    rest = np.linalg.norm(layout.rod, axis=-1)
    along = span / length[..., None]
    longer = np.sum((2.0 * layout.rod + stretch) * stretch, axis=-1) / (length + rest)
    rods = len(c)
    rod_rates = np.zeros((poses, rods, 12))
    for bodies, arm, sign, at in ((c, layout.rod_first, -1.0, 0), (d, layout.rod_second, 1.0, 6)):
        rod_rates[..., at : at + 3] = sign * along
        lever = (state.turned[:, bodies] @ arm[..., None])[..., 0]
        rod_rates[..., at + 3 : at + 6] = sign * np.cross(lever, along)

    rates = np.zeros((poses, 6 * members + rods, topology.bodies, 6))
    for at in range(members):
        rates[:, 6 * at : 6 * at + 6, a[at]] += member_rates[:, at, :, :6]
        rates[:, 6 * at : 6 * at + 6, b[at]] += member_rates[:, at, :, 6:]
    for at in range(rods):
        rates[:, 6 * members + at, c[at]] += rod_rates[:, at, :6]
        rates[:, 6 * members + at, d[at]] += rod_rates[:, at, 6:]
    return Strain(
        rows=np.concatenate([shortened.reshape(poses, -1), longer], axis=1),
        rates=rates.reshape(poses, 6 * members + rods, -1),
        plain=plain,
        axes=axes,
        rate=rate,
        second=second,
        from_first=from_first,
        bent=e,
        along=along,
        length=length,
    )


def geometric(topology: Topology, layout: Layout, state: State, strain: Strain, force: Array) -> Array:
    """Return how the bodies' forces change with their motion at constant member forces, (P, 6 B, 6 B).

    Parameters
    ----------
    force : (P, M) array
        Of every row of the strains.
    """
    poses, members = layout.axes.shape[:2]
    result = np.zeros((poses, topology.bodies, 6, topology.bodies, 6))
    s = force[:, : 6 * members].reshape(poses, members, 6)
    slope = (layout.bending @ strain.bent[..., None])[..., 0]
    s = s + s[..., :1] * slope  # of the strains before bending shortens
    pull = strain.axes @ s[..., :3, None]
    F = cross_matrix(pull[..., 0])
    M = cross_matrix((strain.axes @ np.swapaxes(strain.rate, -1, -2) @ s[..., 3:, None])[..., 0])
    S_b, S_c = cross_matrix(strain.second), cross_matrix(strain.from_first)
    block = np.zeros((poses, members, 12, 12))
    block[..., 6:9, 3:6] = -F
    block[..., 9:12, 3:6] = -S_b @ F - 0.5 * M
    block[..., 9:12, 9:12] = F @ S_b - 0.5 * M
    block[..., 0:3, 3:6] = F
    block[..., 3:6, 0:3] = -F
    block[..., 3:6, 6:9] = F
    block[..., 3:6, 3:6] = S_c @ F + 0.5 * M
    block[..., 3:6, 9:12] = -F @ S_b + 0.5 * M
    stretch = force[:, : 6 * members : 6]
    block += np.swapaxes(strain.plain, -1, -2) @ (stretch[..., None, None] * layout.bending) @ strain.plain
    for at, (i, j) in enumerate(topology.members):
        _add(result, int(i), int(j), block[:, at])

    c, d = topology.rods.T
    pull_of_rods = force[:, 6 * members :]
    across = np.eye(3) - strain.along[..., :, None] * strain.along[..., None, :]
    K = (pull_of_rods / strain.length)[..., None, None] * across
    N = cross_matrix(pull_of_rods[..., None] * strain.along)
    A = cross_matrix((state.turned[:, c] @ layout.rod_first[..., None])[..., 0])
    B = cross_matrix((state.turned[:, d] @ layout.rod_second[..., None])[..., 0])
    rod = np.zeros((poses, len(c), 12, 12))
    ends = ((slice(0, 3), slice(3, 6), A, -1.0), (slice(6, 9), slice(9, 12), B, 1.0))
    for u, r, arm, sign in ends:
        for v, t, other, way in ends:
            both = sign * way
            rod[..., u, v] = both * K
            rod[..., u, t] = -both * K @ other
            rod[..., r, v] = both * arm @ K
            rod[..., r, t] = -both * arm @ K @ other
        rod[..., r, r] += sign * N @ arm
    for at, (i, j) in enumerate(topology.rods):
        _add(result, int(i), int(j), rod[:, at])
    n = 6 * topology.bodies
    return result.reshape(poses, n, n)


def _add(result: Array, i: int, j: int, block: Array) -> None:
    result[:, i, :, i] += block[:, :6, :6]
    result[:, i, :, j] += block[:, :6, 6:]
    result[:, j, :, i] += block[:, 6:, :6]
    result[:, j, :, j] += block[:, 6:, 6:]
