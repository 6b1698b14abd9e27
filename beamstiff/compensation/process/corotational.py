"""A clamped beam under large displacements: corotational beam elements, loads that follow its tip.

Dimensionless: length 1, EI = 1. Every element turns with its chord and is a shallow arch in it (M. A.
Crisfield, Non-linear finite element analysis of solids and structures 1, ch. 7), whose mean axial strain
counts how much bending shortens the chord, so that the tip converges with the fourth power of the element's
length. The beam does not stretch: its EA is 1e8.

At the tip the tool pushes with beta along the normal of the beam and with beta tau along its tangent::

    q = beta (m + tau t),    t = (cos theta, sin theta),    m = (-sin theta, cos theta)

x runs along the undeformed beam from the clamp, y to the side that the tool pushes it to.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

ELEMENTS = 24
AXIAL = 1e8
ITERATIONS = 30
CLOSE = 1e-11
LARGEST_RATIO = 0.8  # of deflection to distance
DEGREE = 24


@dataclass(frozen=True, eq=False)
class Bent:
    """A bent beam in equilibrium."""

    load: float  # beta, the normal force times length squared over EI
    nodes: Array  # (n + 1, 3): x, y and rotation of every node, from the clamp on

    @property
    def ratio(self) -> float:
        """Of the tip's deflection to its distance from the clamp along x."""
        return float(self.nodes[-1, 1] / self.nodes[-1, 0])


def straight(elements: int = ELEMENTS) -> Bent:
    """Return the beam without load."""
    nodes = np.zeros((elements + 1, 3))
    nodes[:, 0] = np.linspace(0.0, 1.0, elements + 1)
    return Bent(0.0, nodes)


def under_load(beam: Bent, load: float, friction: float = 0.0, increments: int = 8) -> Bent:
    """Return the beam under a load, reached in increments with the geometry updated.

    `beam`: where to begin. `load`: beta. `friction`: tau, the tangential over the normal force on the beam,
    along its tangent.
    """
    for step in np.linspace(beam.load, load, increments + 1)[1:]:
        beam = _equilibrium(beam.nodes, float(step), friction, None)
    return beam


def at_ratio(beam: Bent, ratio: float, friction: float = 0.0) -> Bent:
    """Return the beam whose tip is in a direction, deflection over distance, from the one before."""
    return _equilibrium(beam.nodes, beam.load, friction, ratio)


def _equilibrium(nodes: Array, load: float, friction: float, ratio: float | None) -> Bent:
    """Newton's method in the nodes and, where the tip's direction is given, in the load as well."""
    nodes = nodes.copy()
    for _ in range(ITERATIONS):
        internal, stiffness = _assembled(nodes)
        turn = nodes[-1, 2]
        tangent, normal = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        push = np.zeros(internal.size)
        push[-3:-1] = normal + friction * tangent
        stiffness[-3:-1, -1] -= load * (friction * normal - tangent)  # the load turns with the tip
        rest = load * push - internal
        solved = np.linalg.solve(stiffness, np.stack([rest, push], axis=1))
        change, more = solved[:, 0], 0.0
        if ratio is not None:
            gap = nodes[-1, 1] - ratio * nodes[-1, 0]
            moved = solved[-2] - ratio * solved[-3]
            more = -(gap + moved[0]) / moved[1]
            change = change + more * solved[:, 1]
        largest = np.abs(change).max()
        change *= min(1.0, 0.5 / max(largest, 1e-30))
        nodes[1:] += change.reshape(-1, 3)
        load += more * min(1.0, 0.5 / max(largest, 1e-30))
        if largest < CLOSE:
            return Bent(float(load), nodes)
    raise BeamstiffError("the bent beam finds no equilibrium: it is deflected too far")


def _assembled(nodes: Array) -> tuple[Array, Array]:
    """Return the internal forces (3n,) and the tangent stiffness (3n, 3n) of the free nodes."""
    count = len(nodes) - 1
    length = 1.0 / count
    way = np.diff(nodes[:, :2], axis=0)
    chord = np.linalg.norm(way, axis=1)
    c, s = way[:, 0] / chord, way[:, 1] / chord
    angle = np.unwrap(np.arctan2(s, c))
    first, second = nodes[:-1, 2] - angle, nodes[1:, 2] - angle
    zero, one = np.zeros(count), np.ones(count)
    r = np.stack([-c, -s, zero, c, s, zero], axis=1)
    z = np.stack([s, -c, zero, -s, c, zero], axis=1)
    by_angle = np.stack([-z, -z], axis=1) / chord[:, None, None]
    by_angle[:, 0, 2] += one
    by_angle[:, 1, 5] += one
    rows = np.concatenate([r[:, None], by_angle], axis=1)  # of elongation and both end rotations
    bow = np.stack([4 * first - second, 4 * second - first], axis=1) / 30
    strain = (chord - length) / length + (2 * first**2 - first * second + 2 * second**2) / 30
    pull = AXIAL * strain
    ends = np.stack([4 * first + 2 * second, 2 * first + 4 * second], axis=1) / length
    ends += pull[:, None] * length * bow
    local = np.zeros((count, 3, 3))
    local[:, 0, 0] = AXIAL / length
    local[:, 0, 1:] = local[:, 1:, 0] = AXIAL * bow
    local[:, 1:, 1:] = AXIAL * length * bow[:, :, None] * bow[:, None, :]
    local[:, 1:, 1:] += np.array([[4.0, 2.0], [2.0, 4.0]]) / length
    local[:, 1:, 1:] += pull[:, None, None] * length * np.array([[4.0, -1.0], [-1.0, 4.0]]) / 30
    forces = np.einsum("ea,eai->ei", np.concatenate([pull[:, None], ends], axis=1), rows)
    both = r[:, :, None] * z[:, None, :]
    blocks = rows.swapaxes(1, 2) @ local @ rows
    blocks += (pull / chord)[:, None, None] * z[:, :, None] * z[:, None, :]
    blocks += (ends.sum(axis=1) / chord**2)[:, None, None] * (both + both.swapaxes(1, 2))
    internal, stiffness = np.zeros(3 * count + 3), np.zeros((3 * count + 3, 3 * count + 3))
    for element in range(count):
        at = slice(3 * element, 3 * element + 6)
        internal[at] += forces[element]
        stiffness[at, at] += blocks[element]
    return internal[3:], stiffness[3:, 3:]


@dataclass(frozen=True, eq=False)
class Contact:
    """A tool on N beams: normal force over EI, 1/m^2, length of beam up to it, m, and slope there, rad."""

    normal: Array
    length: Array
    slope: Array


def contact(distance: Array, deflection: Array, friction: float = 0.0) -> Contact:
    """Return where and how hard a tool at a place presses on a beam, along which it slides.

    Beams whose contact lies in the same direction from the clamp are alike: the ratio of deflection to
    distance alone decides the dimensionless load, the length bent and the slope, tabulated once for each
    friction.

    `distance` (N,), m: of the tool from the clamp along the undeformed beam. `deflection` (N,), m: at most
    `LARGEST_RATIO` of the distance. `friction`: tangential over normal force on the beam, positive away from
    the clamp.
    """
    ratio = deflection / distance
    load, length, slope = (series(ratio) for series in _tables(friction))
    arc = distance * length
    return Contact(ratio * load / arc**2, arc, ratio * slope)


@lru_cache(maxsize=64)
def _tables(friction: float) -> tuple[Chebyshev, Chebyshev, Chebyshev]:
    """Return load over ratio, length over distance and slope over ratio, as functions of the ratio."""
    nodes = 0.5 * LARGEST_RATIO * (1 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)))
    values, beam = [], straight()
    for ratio in nodes.tolist():
        beam = at_ratio(beam, ratio, friction)
        x, _, slope = beam.nodes[-1]
        values.append((beam.load / ratio, 1.0 / x, slope / ratio))
    domain = (0.0, LARGEST_RATIO)
    first, second, third = (
        Chebyshev.fit(nodes, column, DEGREE, domain=domain) for column in np.array(values).T
    )
    return first, second, third
