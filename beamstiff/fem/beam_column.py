"""Beams under large axial forces: the exact stability functions, beyond what is of first order in the force.

Of the geometrically exact beam (Simo and Vu-Quoc, see `initial_stress`) under a pull N, with t the rotation
of its sections and w its deflection::

    EI t'' + (G A_s - N) (w' - t) = 0,     (G A_s - N) (w' - t) + N w' = const

With ``n = N L^2 / 4EI``, ``s = 1 - N / G A_s`` and ``v = sqrt(n s)``, imaginary under a push, the ends
turning against one another meet ``(2EI/L) v coth v``, and turning alike, against the chord,
``(2EI/L) s / (s r + phi/3)``, with ``r = (v coth v - 1) / v^2``. Without shear these are the stability
functions of Livesley and Chandler (1956), with it they give the columns of Haringx (Timoshenko and Gere, art.
2.17). One element a beam is exact at any share of the critical load.
"""

import math

import numpy as np

from beamstiff.fem.loads import beam_weight, gravity_wrenches
from beamstiff.fem.mechanism import BUCKLES, PoseError
from beamstiff.fem.placed_structure import Geometry
from beamstiff.fem.static_response import Response
from beamstiff.fem.structure import Structure
from beamstiff.se3 import Array

TERMS = 10  # of the series for v^2 between -1 and 1
COARSE = 0.05  # of the moment that buckles a beam: beyond, the first order is off by a thousandth
CLAMPED = -(np.pi**2)  # v^2 at which a beam buckles between clamped ends


def stability_change(stiffness: Array, shear: Array, pull: Array, length: Array) -> tuple[Array, Array]:
    """Return what is of second and higher order in the pull in the stiffness of a beam's bending, N m/rad.

    For ``E I`` and shear parameters ``12 E I / (G A_s L^2)`` about y and z (..., 2), tension and length
    (...). Two (..., 2): the end moments per rotation against the chord, the ends turning against one another,
    and alike.
    """
    n, s, square = _reduced(stiffness, shear, pull, length)
    ratio = _ratio(square)
    first = 9 * ((1 / 6 - shear / 3) * (1 + shear) / 3 - (1 / 30 - shear / 18)) / (1 + shear) ** 2
    changes = (square * ratio - n / 3, s / (s * ratio + shear / 3) - 3 / (1 + shear) - n * first)
    unit = 2 * stiffness / length[..., None]
    against, both = (np.where(n == 0.0, 0.0, unit * change) for change in changes)
    return against, both


def beam_bending(structure: Structure, geometry: Geometry) -> tuple[Array, Array]:
    """Return ``E I`` of beams about y and z (B, 2), and their shear parameters (P, B, 2)."""
    properties, length = structure.beam_properties, geometry.beam_length
    bending = [properties["E"] * properties[second] for second in ("Iy", "Iz")]
    shear = [
        12 * stiffness / (properties["G"] * properties[area] * length**2)
        for stiffness, area in zip(bending, ("Az", "Ay"), strict=True)
    ]
    return np.stack(bending, axis=-1), np.stack(shear, axis=-1)


def check_beams(structure: Structure, geometry: Geometry, pull: Array) -> None:
    """Refuse beams that buckle between their nodes under tension (P, B): no unknown shows it."""
    square = _reduced(*beam_bending(structure, geometry), pull, geometry.beam_length)[2]
    share = (square / CLAMPED).max(axis=-1)
    if (buckled := np.argwhere(~(share < 1.0))).size:
        pose, beam = buckled[0]
        where = f" at pose {geometry.number[pose]}"
        raise PoseError(
            f"robot {structure.robot.name!r} {BUCKLES}: beam {structure.robot.beams[beam].name!r}{where}, at "
            f"{share[pose, beam]:.3g} times what it bears between clamped ends",
            int(geometry.number[pose]),
            where,
        )


def pulled_weight(structure: Structure, geometry: Geometry, pull: Array) -> Array:
    """Return the dead weight on every node (P, N, 6), beams clamped at their ends under tension (P, B)."""
    result, couples = gravity_wrenches(structure, geometry), beam_weight(structure, geometry)[..., 3:]
    _, s, square = _reduced(*beam_bending(structure, geometry), pull, geometry.beam_length)
    couples[..., 0] = 0.0
    couples[..., 1:] *= (3 * s * _ratio(square) - 1)[:, :, None]
    change = (geometry.beam_rotation[:, :, None] @ couples[..., None])[..., 0]
    for end in (0, 1):
        nodes = structure.elements[: len(structure.robot.beams), end]
        np.add.at(result[..., 3:].swapaxes(0, 1), nodes, change[:, :, end].swapaxes(0, 1))
    return result


def _reduced(stiffness: Array, shear: Array, pull: Array, length: Array) -> tuple[Array, Array, Array]:
    """Return n, s and v^2."""
    n = (pull * length**2)[..., None] / (4 * stiffness)
    s = 1 - n * shear / 3
    return n, s, n * s


def _ratio(square: Array) -> Array:
    """Return h/g, ``(v coth v - 1) / v^2``, for v^2 above `CLAMPED`."""
    near = np.clip(square, -1.0, 1.0)
    g = sum(near**k / math.factorial(2 * k + 1) for k in range(TERMS))
    h = sum(2 * k * near ** (k - 1) / math.factorial(2 * k + 1) for k in range(1, TERMS))
    v = np.sqrt(np.maximum(np.abs(square), 1.0))
    far = np.where(square > 0.0, v / np.tanh(v), v / np.tan(v))
    return np.where(np.abs(square) < 1.0, h / g, (far - 1) / np.where(square > 0.0, v**2, -(v**2)))


def coarse_beams(response: Response) -> list[str]:
    """Return notes on the beams whose moments change their stiffness by more than the first order holds.

    For the response to loads and dead weight together. Axial forces are exact, moments and torques of one
    element are of first order. A beam between forks buckles under ``M = pi sqrt(EI GJ)/L`` (Timoshenko and
    Gere, art. 6.2), or under a torque of ``2 pi EI/L`` (art. 2.21).
    """
    structure, length = response.structure, response.geometry.beam_length
    if not structure.robot.beams:
        return []
    least = beam_bending(structure, response.geometry)[0].min(axis=-1)
    twist = structure.beam_properties["G"] * structure.beam_properties["J"]
    couples = np.abs(response.beam_forces[..., 3:]).max(axis=2)
    shares = length * np.maximum(
        couples[..., 1:].max(axis=-1) / (np.pi * np.sqrt(least * twist)),
        couples[..., 0] / (2 * np.pi * least),
    )
    worst = shares.max(axis=0)
    return [
        f"beam {structure.robot.beams[at].name!r}: its moments are {worst[at]:.0%} of what buckles it; one "
        f"element takes them to first order, which may be off by {min(worst[at] ** 2 / 2, 1.0):.1%} of the "
        "compliance: make it several beams"
        for at in np.flatnonzero(worst > COARSE)
    ]
