"""What the forces inside an element add to its stiffness, to first order in them: initial stress matrices.

An element that carries a wrench answers a small motion of its ends with more than its elastic stiffness: the
wrench turns with the element, and its own deformation gives it new lever arms. With Phi the element's energy,
both are the second-order part of the strains times the wrench. For the beam, a geometrically exact one whose
end rotations against the chord are small, with r the position and t the rotation vector along it::

    e2     = |d_perp|^2 / 2L                       stretch of the chord
    ta2    = -w2 - w1 x wa / 2                     end rotation against the chord, which turns by w1 + w2
    kappa2 = -t x t' / 2,   gamma2 = -t x r' + t x (t x x) / 2          curvature and strain inside

(Crisfield, Non-linear Finite Element Analysis of Solids and Structures 2, ch. 17; Simo and Vu-Quoc, Comput.
Methods Appl. Mech. Eng. 58 (1986) 79.) With the Hermite shapes the axial force gives the beam-column's
``N L/30 [4 -1; -1 4]``. Blocks act on displacements ``[d, w]`` and give wrenches, w an infinitesimal rotation
after the present one: moments make them unsymmetric by ``-skew(m)/2``, since rotations do not commute.
"""

import numpy as np

from beamstiff.se3 import Array, skew

# three points on [0, 1]: exact up to the fifth power
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
GAUSS = tuple(zip((0.5 + 0.5 * _POINTS).tolist(), (0.5 * _WEIGHTS).tolist(), strict=True))

# rows of [da, wa, db, wb]: the ends' rotations, and the second end's displacement against the first's
TURN_A, TURN_B, APART = np.zeros((3, 3, 12))
TURN_A[:, 3:6] = TURN_B[:, 9:12] = APART[:, 6:9] = np.eye(3)
APART[:, 0:3] = -np.eye(3)


def beam_initial_stress(length: Array, ends: Array, load: Array, shear: Array) -> Array:
    """Return the initial stress matrix of beams in local axes on ``[da, wa, db, wb]``, (..., 12, 12).

    One element is exact to first order in the wrench: its shapes are those of the unloaded beam. `ends` (...,
    2, 6) are wrenches in equilibrium with the dead load (..., 3), N/m, whose resultant acts on the nodes and
    whose couples follow the chord; `shear` (..., 2) is ``12 E I / (G A_s L^2)`` about y and about z.
    """
    force, couple_a, couple_b = ends[..., 0, :3], ends[..., 0, 3:], ends[..., 1, 3:]
    span = length[..., None, None]
    turn = np.zeros((*length.shape, 3, 12))  # of the chord, first order; about x the mean of both ends
    turn[..., 0, :] = 0.5 * (TURN_A[0] + TURN_B[0])
    turn[..., 1:, :] = np.stack([-APART[2], APART[1]]) / span
    bent_a, bent_b = TURN_A - turn, TURN_B - turn
    pull = 0.5 * (ends[..., 1, 0] - force[..., 0])
    both = (couple_a + couple_b)[..., 1:]
    stretch = APART[0] / span[..., 0]

    form = 0.5 * (pull / length)[..., None, None] * (APART[1:].T @ APART[1:])
    across = np.stack([-turn[..., 2, :], turn[..., 1, :]], axis=-2)  # x cross the chord's turn
    form = form + 0.5 * _outer(turn[..., 0, :], _along(both, across))
    form = form + _outer(_along(both, turn[..., 1:, :]), stretch)
    form = form - 0.5 * (_triple(couple_a, turn, TURN_A) + _triple(couple_b, turn, TURN_B))
    # the dead load, on the deflection carried along by the chord
    bow = -skew(np.array([1.0, 0.0, 0.0])) @ (bent_a - bent_b)  # (ta - tb) cross x
    form = form - length[..., None, None] ** 2 / 12 * _triple(load, turn, bow)
    for point, weight in GAUSS:
        form = form + weight * span * _inside(point, length, ends, load, shear, bent_a, bent_b, stretch)
    stiffness = form + _transpose(form)
    stiffness[..., 3:6, 3:6] -= 0.5 * skew(couple_a)
    stiffness[..., 9:12, 9:12] -= 0.5 * skew(couple_b)
    return stiffness


def bending_stress(length: Array, against: Array, alike: Array) -> Array:
    """Return the stiffness (..., 12, 12) of end moments (..., 2) of ends that turn against or alike."""
    turn = np.stack([-APART[2], APART[1]]) / length[..., None, None]
    bent_a, bent_b = TURN_A[1:] - turn, TURN_B[1:] - turn
    half = 0.5 * np.concatenate([against, alike], axis=-1)[..., None]
    modes = np.concatenate([bent_a - bent_b, bent_a + bent_b], axis=-2)
    return np.asarray(_transpose(modes) @ (half * modes))


def _inside(
    point: float,
    length: Array,
    ends: Array,
    load: Array,
    shear: Array,
    bent_a: Array,
    bent_b: Array,
    stretch: Array,
) -> Array:
    """Return the quadratic form of the strains of second order at a point, for a metre, (..., 12, 12)."""
    x, at = np.array([1.0, 0.0, 0.0]), (point * length)[..., None]
    force = -ends[..., 0, :3] - at * load
    moment = -ends[..., 0, 3:] + at * np.cross(x, ends[..., 0, :3]) + 0.5 * at**2 * np.cross(x, load)
    # linear twist; cubic deflection, quadratic rotation and constant shear (Przemieniecki 1968, ch. 5)
    near, far, near_slope, far_slope = np.ones((4, *shear.shape[:-1], 3, 1))
    near[..., 0, 0], far[..., 0, 0], near_slope[..., 0, 0] = 1 - point, point, -1
    near[..., 1:, 0] = (3 * point**2 - (4 + shear) * point + 1 + shear) / (1 + shear)
    far[..., 1:, 0] = (3 * point**2 - (2 - shear) * point) / (1 + shear)
    near_slope[..., 1:, 0] = (6 * point - 4 - shear) / (1 + shear)
    far_slope[..., 1:, 0] = (6 * point - 2 + shear) / (1 + shear)
    bent = near * bent_a + far * bent_b
    curved = (near_slope * bent_a + far_slope * bent_b) / length[..., None, None]
    across = -skew(x) @ bent  # bent cross x
    half = 0.5 * shear / (1 + shear)
    slip = skew(x) @ (np.concatenate([0 * half[..., :1], half], axis=-1)[..., None] * (bent_a + bent_b))
    form = -0.5 * _triple(moment, bent, curved)
    form = form - _triple(force, bent, across + slip) + 0.5 * _triple(force, bent, across)
    return form - _outer(_along(force, across), stretch)


def joint_initial_stress(wrench: Array) -> Array:
    """Return the initial stress matrix of joints, (..., 12, 12), whose frames turn with their first nodes.

    For the wrench on the second node (..., 6), what rigid directions carry included, in the wrench's axes.
    """
    force, couple = wrench[..., :3], wrench[..., 3:]
    form = -_triple(force, TURN_A, APART) - 0.5 * _triple(couple, TURN_A, TURN_B)
    stiffness = form + _transpose(form)
    stiffness[..., 3:6, 3:6] += 0.5 * skew(couple)
    stiffness[..., 9:12, 9:12] -= 0.5 * skew(couple)
    return stiffness


def strut_initial_stress(along: Array, length: Array, pull: Array) -> Array:
    """Return the initial stress of struts (..., 12, 12), ``P/L`` across, by direction, length, tension."""
    across = APART - along[..., :, None] * (along[..., None, :] @ APART)
    return (pull / length)[..., None, None] * (_transpose(across) @ across)


def arm_initial_stress(force: Array, arm: Array) -> Array:
    """Return the stiffness against turning that a constant force on a turning arm adds, (..., 3, 3).

    The force on the node counts as load; a force by which the node loads others has the opposite sign.
    """
    return -skew(force) @ skew(arm)


def _triple(vector: Array, left: Array, right: Array) -> Array:
    """Return the quadratic form of ``vector . (left u x right u)``."""
    return -_transpose(left) @ skew(vector) @ right


def _outer(left: Array, right: Array) -> Array:
    return left[..., :, None] * right[..., None, :]


def _along(vector: Array, rows: Array) -> Array:
    return (vector[..., None, :] @ rows)[..., 0, :]


def _transpose(matrix: Array) -> Array:
    return matrix.swapaxes(-1, -2)
