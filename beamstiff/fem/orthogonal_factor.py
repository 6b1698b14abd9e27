"""The answer from an orthogonal factor of the weighted deformations, and how far rounding reaches it.

The stiffness is ``K = A^T A``, with a row of A for every way an element deforms, weighed by the root of its
stiffness. In K a soft part is lost beside one 1e16 times stiffer. The factor R of ``A = Q R`` is never
squared: with the rows in the order of their size and the columns pivoted, each row is in error by some 1e-16
of itself, however unlike the rows are (Cox and Higham, BIT 38 (1998) 34; Higham, Accuracy and Stability of
Numerical Algorithms, 2002, section 19.4).

How far the answer can be trusted is tried out: the same again with deformations and loads changed by rounding
errors. What this changes by more than a millionth is refused.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack, solve_triangular

from beamstiff.errors import BeamstiffError
from beamstiff.fem.constraints import beam_rows, joint_rows, strut_row, unknown_sizes
from beamstiff.fem.mechanism import BUCKLES, MECHANISM, NEARLY, NEARLY_BUCKLES, mechanism_error
from beamstiff.fem.placed_structure import Geometry, strut_directions, strut_stiffness
from beamstiff.fem.structure import Structure
from beamstiff.se3 import Array, rotate_screw

KNOWN = 1e-6  # relative error of an answer that is given
TRIES = 3
# what positions, directions and their products are rounded by, as a share of their size
ROUNDED = 4 * np.finfo(float).eps
SURE = 1e-3  # a pivot that rounding changes by more than this is none
# share of what meets at a port that is rounding: nothing but its own spring holds it; and of what a load does
# on a motion, by the sizes of both
NOTHING = 1e-13
BUCKLED = 1e-13  # stiffness of the loaded machine, as a share of the unloaded one's, that is none


@dataclass(frozen=True)
class Factored:
    """A structure at one pose under c loads, with p ports held (`condensation` says what ports are)."""

    port_stiffness: Array  # (p, p)
    port_force: Array  # (p, c): what the loads do at the ports
    work: Array  # (c, c): of each load on the displacements of each
    solution: Array  # (n, c): unknowns
    strains: Array  # (m, c): deformations of the elements, weighed, in the order of `weighted_strains`


class Doubtful(Exception):  # noqa: N818 - caught where pose and robot are known
    """No answer, and why: a motion (n,) that meets no stiffness, or one that rounding does not tell."""

    def __init__(self, motion: Array, what: str) -> None:
        super().__init__()
        self.motion, self.what = motion, what


def weighted_strains(structure: Structure, geometry: Geometry) -> tuple[Array, Array]:
    """Return A of ``K = A^T A`` (P, m, n): six rows a beam and chord, one a strut and spring.

    A deformation is that of an element's second end against the first carried along. What moves both ends as
    one body is left out, for its difference would be rounding. And what motions as large as the machine put
    into a row before it adds up to less, (P, m).
    """
    poses, unknowns = len(geometry.number), structure.unknowns.count
    levers = np.repeat([structure.kinematics.size, 1.0], 3)  # displacements, rotations
    rows, sizes = [np.zeros((poses, 0, unknowns))], [np.zeros((poses, 0))]
    for at in range(len(structure.robot.beams)):
        one = {name: value[at] for name, value in structure.beam_properties.items()}
        length, moved = geometry.beam_length[:, at], _own(structure, beam_rows(structure, geometry, at), at)
        weight = np.zeros((poses, 6))
        for direction, value in ((0, one["E"] * one["A"]), (3, one["G"] * one["J"])):
            weight[:, direction] = np.sqrt(value / length)
        for second, area, v, r, sign in _BENDING:
            weight[:, r], weight[:, v] = _bending(one["E"] * one[second], one["G"] * one[area], length)
            moved[:, v] -= sign * 0.5 * length[:, None] * moved[:, r]
        rows.append(weight[:, :, None] * moved)
        sizes.append(weight * levers)
    first = len(structure.robot.beams)
    for number, (joint, values) in enumerate(zip(structure.chords, structure.chord_values, strict=True)):
        moved = _own(structure, joint_rows(structure, geometry, int(joint)), first + number)
        rows.append(np.sqrt(values)[:, None] * moved)
        sizes.append(np.broadcast_to(np.sqrt(values) * levers, (poses, 6)))
    first += len(structure.chords)
    for number, (strut, value) in enumerate(
        zip(structure.struts, strut_stiffness(structure, geometry).T, strict=True)
    ):
        moved = _own(structure, strut_row(structure, geometry, int(strut)), first + number)
        rows.append(np.sqrt(value)[:, None, None] * moved)
        sizes.append(np.sqrt(value)[:, None] * levers[0])
    springs = np.zeros((poses, structure.springs.size, unknowns))
    springs[:, range(structure.springs.size), structure.springs] = np.sqrt(structure.spring_values)
    rows.append(springs)
    sizes.append((springs * unknown_sizes(structure)).max(axis=2, initial=0.0))
    return np.concatenate(rows, axis=1), np.concatenate(sizes, axis=1)


# second moment, shear area, deflection, slope, and the sign of the slope that goes with the deflection
_BENDING = (("Iz", "Ay", 1, 5, 1.0), ("Iy", "Az", 2, 4, -1.0))


def _bending(stiffness: Array, shear: Array, length: Array) -> tuple[Array, Array]:
    """Return the weights of a beam's ends turning against one another, and of its chord against both.

    ``EI/L r^2 + 12 EI/((1 + phi) L^3) (v - r L/2)^2`` is twice the energy of its bending.
    """
    slope = np.sqrt(stiffness / length)
    return slope, slope * np.sqrt(12 / (1 + 12 * stiffness / (shear * length**2))) / length


def _own(structure: Structure, rows: Array, element: int) -> Array:
    """Return the rows of an element without the unknowns that move both its ends as one body."""
    unknowns = structure.unknowns
    a, b = structure.elements[element]
    blocks = [set(unknowns.term_block[unknowns.term_node == node].tolist()) for node in (a, b)]
    for block in blocks[0] & blocks[1]:
        numbers = unknowns.blocks[block]
        rows[:, :, numbers[numbers >= 0]] = 0.0
    return rows


def strain_forces(structure: Structure, geometry: Geometry, strains: Array) -> tuple[Array, Array]:
    """Return what `assembly.element_forces` does at one pose, (E, 2, 6) and (E,), from strains (m,)."""
    beams, chords = len(structure.robot.beams), len(structure.chords)
    local = np.zeros((len(structure.elements), 6))
    local[: beams + chords] = strains[: 6 * (beams + chords)].reshape(-1, 6)
    local[beams + chords :, 0] = strains[6 * (beams + chords) :][: len(structure.struts)]
    energy = 0.5 * (local**2).sum(axis=1)
    one, length = structure.beam_properties, geometry.beam_length[0]
    bars = local[:beams]
    bars[:, 0] *= np.sqrt(one["E"] * one["A"] / length)
    bars[:, 3] *= np.sqrt(one["G"] * one["J"] / length)
    for second, area, v, r, sign in _BENDING:
        slope, side = _bending(one["E"] * one[second], one["G"] * one[area], length)
        bars[:, v] *= side
        bars[:, r] = slope * bars[:, r] - sign * 0.5 * length * bars[:, v]
    local[beams : beams + chords] *= np.sqrt(structure.chord_values)
    local[beams + chords :, 0] *= np.sqrt(strut_stiffness(structure, geometry)[0])
    far = np.zeros_like(local)
    turns = np.concatenate([geometry.beam_rotation[0], geometry.joint_rotation[0, structure.chords]])
    far[: beams + chords] = (rotate_screw(turns) @ local[: beams + chords, :, None])[..., 0]
    along = strut_directions(structure, geometry, structure.struts)[0][0]
    far[beams + chords :, :3] = local[beams + chords :, :1] * along
    first, second_end = structure.elements.T
    positions = geometry.posture.node_positions[0]
    arm = positions[second_end] - positions[first]
    arm[beams:] = 0.0
    near = -far
    near[:, 3:] -= np.cross(arm, far[:, :3])
    return np.stack([near, far], axis=1), energy


def factored_at(
    structure: Structure,
    geometry: Geometry,
    pose: int,
    rest: Array,
    loads: Array,
    moved: Array | None = None,
    by_load: Array | None = None,
    works: bool = False,
) -> Factored:
    """Return the answer at one of many poses from the strains, for loads (n, c) on the unknowns.

    `rest` (n, r) are the motions that are possible with the ports held, ``z = rest y + moved e``, `moved` (n,
    p) the unit motions of the ports; `by_load` (n, n) is what loads add to the stiffness (without ports), and
    `works` says that the works are asked (a compliance), not the solution.
    """
    moved, one = np.zeros((len(rest), 0)) if moved is None else moved, geometry.only(np.array([pose]))
    try:
        return _factored(structure, one, rest, loads, moved, by_load, works)
    except Doubtful as doubt:
        raise mechanism_error(structure, geometry, pose, doubt.motion, doubt.what) from None


def _factored(
    structure: Structure,
    geometry: Geometry,
    rest: Array,
    loads: Array,
    moved: Array,
    by_load: Array | None,
    works: bool,
) -> Factored:
    (strains,), (size,) = weighted_strains(structure, geometry)
    units = unknown_sizes(structure)
    if not np.isfinite(strains).all():
        raise BeamstiffError(
            "found a stiffness or compliance that is not a finite number, expected one in the range of "
            "numbers; check the units"
        )
    met = size[:, None] * (np.abs(strains) @ np.abs(moved) != 0.0)  # what cancels leaves rounding too
    port_size = np.linalg.norm(met, axis=0) * np.abs(moved / units[:, None]).max(axis=0, initial=0.0)
    factor = _factor(strains, rest, moved, None)
    answer, lengths = None, _longest(loads * units[:, None])
    if np.diagonal(factor.triangle).all():
        answer = _answer(factor, rest, loads, moved, port_size, by_load, units, lengths)
    draws = [np.random.default_rng(number) for number in range(TRIES)]
    others = [_factor(_rounded(strains, size, units, rng), rest, moved, factor.order) for rng in draws]
    pivots, *changed = (np.abs(np.diagonal(one.triangle)) for one in (factor, *others))
    lost = (pivots == 0.0) | (np.abs(np.array(changed) - pivots) > SURE * pivots).any(axis=0)
    if answer is None or lost.any():
        raise Doubtful(_null_motion(factor, rest, int(np.argmax(lost))), MECHANISM)
    for other, rng in zip(others, draws, strict=True):
        load = _rounded(loads.T, lengths, units, rng).T
        again = _answer(other, rest, load, moved, port_size, by_load, units, lengths)
        if (motion := _difference(answer, again, loads, None if works else units)) is not None:
            raise Doubtful(motion, NEARLY if by_load is None else NEARLY_BUCKLES)
    return answer


@dataclass(frozen=True)
class _Factor:
    """``A rest`` with its rows and columns in order, as a product of reflections and a triangle."""

    reflectors: Array
    scales: Array
    rows: NDArray[np.int64]
    order: NDArray[np.int64]
    triangle: Array
    port_strains: Array


def _factor(strains: Array, rest: Array, moved: Array, order: NDArray[np.int64] | None) -> _Factor:
    count = rest.shape[1]
    both = strains @ np.concatenate([rest, moved], axis=1)
    missing = max(0, count - len(both))
    both = np.concatenate([both, np.zeros((missing, both.shape[1]))])
    rows = np.argsort(-np.abs(both).max(axis=1, initial=0.0), kind="stable")
    left = both[rows]
    if count == 0:
        empty = np.zeros((0, 0))
        return _Factor(empty, empty, rows, np.zeros(0, dtype=np.int64), empty, left)
    if order is None:
        packed, pivots, scales, _, _ = lapack.dgeqp3(left[:, :count])
        order = pivots.astype(np.int64) - 1
    else:
        packed, scales, _, _ = lapack.dgeqrf(left[:, order])
    ports = left[:, count:]
    if ports.shape[1]:
        ports, _, _ = lapack.dormqr("L", "T", packed, scales, ports, 64 * max(1, ports.shape[1]))
    return _Factor(packed, scales, rows, order, np.triu(packed[:count]), ports)


def _answer(
    factor: _Factor,
    rest: Array,
    loads: Array,
    moved: Array,
    port_size: Array,
    by_load: Array | None,
    units: Array,
    lengths: Array,
) -> Factored:
    ordered, count = rest[:, factor.order], rest.shape[1]
    pulls = ordered.T @ loads
    # a load across a motion does no work on it, but for rounding: with rigid links, of a whole plane
    pulls[np.abs(pulls) < NOTHING * np.outer(_longest(ordered / units[:, None]), lengths)] = 0.0
    forces = _backward(factor.triangle, pulls, transposed=True)
    solved = forces
    if by_load is not None:
        half = _backward(factor.triangle, ordered.T @ by_load @ ordered, transposed=True)
        shares = np.eye(count) + _backward(factor.triangle, half.T, transposed=True).T
        values, vectors = np.linalg.eigh(0.5 * (shares + shares.T))
        if count and values[0] < BUCKLED:
            raise Doubtful(ordered @ _backward(factor.triangle, vectors[:, :1])[:, 0], BUCKLES)
        solved = np.asarray(np.linalg.solve(shares, forces), dtype=np.float64)
    strains = np.zeros((len(factor.rows), loads.shape[1]))
    strains[:count] = solved
    if count and strains.shape[1]:
        strains, _, _ = lapack.dormqr(
            "L", "N", factor.reflectors, factor.scales, strains, 64 * strains.shape[1]
        )
    back = np.empty_like(strains)
    back[factor.rows] = strains
    held, loose = factor.port_strains[:count], factor.port_strains[count:]
    loose = np.where(np.linalg.norm(loose, axis=0) > NOTHING * port_size, loose, 0.0)
    return Factored(
        port_stiffness=loose.T @ loose,
        port_force=moved.T @ loads - held.T @ forces,
        work=forces.T @ solved,
        solution=ordered @ _backward(factor.triangle, solved),
        strains=back,
    )


def _longest(columns: Array) -> Array:
    """Return the largest entry of each column, (c,)."""
    return np.asarray(np.abs(columns).max(axis=0, initial=0.0))


def _backward(triangle: Array, right: Array, transposed: bool = False) -> Array:
    if not triangle.size or not right.size:
        return np.zeros_like(right)
    how: Literal["T", "N"] = "T" if transposed else "N"
    return np.asarray(solve_triangular(triangle, right, trans=how, check_finite=False), dtype=np.float64)


def _rounded(rows: Array, size: Array, units: Array, rng: np.random.Generator) -> Array:
    """Return rows (., n) of a size (.,) changed as rounding might have; a zero is none that came of it."""
    noise: Array = ROUNDED * size[:, None] / units * rng.standard_normal(rows.shape)
    return np.where(rows != 0.0, rows + noise, 0.0)


def _null_motion(factor: _Factor, rest: Array, at: int) -> Array:
    """Return the motion (n,) of the first pivot that is rounding: what came before it follows."""
    motion = np.zeros(len(factor.order))
    motion[at] = 1.0
    motion[:at] = -_backward(factor.triangle[:at, :at], factor.triangle[:at, at : at + 1])[:, 0]
    return rest[:, factor.order] @ motion


def _difference(one: Factored, other: Factored, loads: Array, units: Array | None) -> Array | None:
    """Return the motion (n,) by which two answers differ too much, or None; `units` to judge motions too."""
    change = other.solution - one.solution
    works = np.sqrt(np.maximum(np.diagonal(one.work), 0.0))
    wrong = np.asarray((np.abs(other.work - one.work) > KNOWN * np.outer(works, works)).any(axis=0))
    if units is not None:
        size = np.abs(one.solution / units[:, None]).max(axis=0, initial=0.0)
        wrong = wrong | (np.abs(change / units[:, None]).max(axis=0, initial=0.0) > KNOWN * size)
    pulls = np.abs(one.port_force).max(axis=0, initial=0.0)
    pulls = np.maximum(pulls, np.abs(loads).max(axis=0, initial=0.0))
    wrong = wrong | ((np.abs(other.port_force - one.port_force) > KNOWN * pulls).any(axis=0))
    held = np.sqrt(np.diagonal(one.port_stiffness))
    if (np.abs(other.port_stiffness - one.port_stiffness) > KNOWN * np.outer(held, held)).any():
        wrong[:] = True
    return np.asarray(change[:, int(np.argmax(wrong))]) if wrong.any() else None
