"""The compliance of a frame in a hundred digits: `reference_frame` done again in decimals, nothing rounded.

Whatever the stiffnesses, the answer is that of the numbers of the description as they stand.
"""

from decimal import Decimal, localcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.fem.reference_frame import ReferenceFrame

Exact = NDArray[Any]  # of decimals
DIGITS = 120
ZERO, ONE = Decimal(0), Decimal(1)
NONE = Decimal("1e-70")  # of what was there: a pivot below this is zero
RIGID = 1e-150  # m/N: what is left of a rigid structure in so many digits


def exact_compliance(made: ReferenceFrame, node: int) -> NDArray[np.float64] | None:
    """Return the displacement (6, 6) of a node under unit wrenches as columns; None of a mechanism."""
    with localcontext() as context:
        context.prec = DIGITS
        strains, rows = _system(made)
        basis = _null_space(rows, 6 * len(made.points))
        reduced = strains @ basis
        size = ((np.abs(strains) @ np.abs(basis)) ** 2).sum(axis=0)
        inverse = _solved(reduced.T @ reduced, basis[6 * node : 6 * node + 6].T, size)
        if inverse is None:
            return None
        found = np.array(basis[6 * node : 6 * node + 6] @ inverse, dtype=np.float64)
        return np.where(np.abs(found) > RIGID, found, 0.0)


def _decimals(values: Any) -> Exact:
    flat = np.asarray(values, dtype=np.float64)
    result = np.empty(flat.shape, dtype=object)
    for at in np.ndindex(flat.shape):
        result[at] = Decimal(float(flat[at]))
    return result


def _system(made: ReferenceFrame) -> tuple[Exact, Exact]:
    """Return the rows of the deformations times the roots of their stiffness, and those that are held."""
    count, points = len(made.points), _decimals(made.points)
    strains, rows = [np.full((0, 6 * count), ZERO)], [np.full((0, 6 * count), ZERO)]
    for i, j, properties, up in made.beams:
        strains.append(_beam(points[j] - points[i], up, properties) @ _relative(points, i, j))
    for i, j in made.rigids:
        rows.append(_relative(points, i, j))
    for i, j, axis, values in made.joints:
        local = _both(_axes(_decimals(axis), None)).T @ _relative(points, i, j)
        rows.append(local[np.isinf(values)])
        weights = np.array([Decimal(float(value)).sqrt() for value in values[np.isfinite(values)]])
        strains.append(weights[:, None] * local[np.isfinite(values)])
    for i, j, value in made.struts:
        way = points[j] - points[i]
        along = np.full((1, 6 * count), ZERO)
        along[0, 6 * j : 6 * j + 3] = way / _length(way)
        along[0, 6 * i : 6 * i + 3] = -way / _length(way)
        if np.isinf(value):
            rows.append(along)
        else:
            strains.append(Decimal(float(value)).sqrt() * along)
    every = _decimals(np.eye(6 * count))
    turning = {node for i, j, *_ in [*made.beams, *made.rigids, *made.joints] for node in (i, j)}
    for node in range(count):
        if node in made.fixed:
            rows.append(every[6 * node : 6 * node + 6])
        elif node not in turning:
            rows.append(every[6 * node + 3 : 6 * node + 6])
    return np.concatenate(strains), np.concatenate(rows)


def _length(vector: Exact) -> Decimal:
    return Decimal((vector * vector).sum()).sqrt()


def _relative(points: Exact, i: int, j: int) -> Exact:
    x, y, z = points[j] - points[i]
    rows = np.full((6, 6 * len(points)), ZERO)
    rows[range(6), range(6 * j, 6 * j + 6)] = ONE
    rows[range(6), range(6 * i, 6 * i + 6)] = -ONE
    turn = 6 * i + 3  # displacement of j by a rotation of i: rotation cross arm, taken off
    for row, column, value in ((0, 1, -z), (0, 2, y), (1, 0, z), (1, 2, -x), (2, 0, -y), (2, 1, x)):
        rows[row, turn + column] = value
    return rows


def _axes(along: Exact, up: Exact | None) -> Exact:
    """Return axes (columns): x along, y in the plane of x and `up`."""
    x = along / _length(along)
    if up is None:
        up = _decimals(np.eye(3)[int(np.argmin(np.abs(x.astype(float))))])
    y = up - x * (x * up).sum()
    y = y / _length(y)
    return np.stack([x, y, _cross(x, y)], axis=1)


def _cross(a: Exact, b: Exact) -> Exact:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _both(turn: Exact) -> Exact:
    result = np.full((6, 6), ZERO)
    result[:3, :3] = result[3:, 3:] = turn
    return result


def _beam(way: Exact, up: Any, properties: dict[str, float]) -> Exact:
    """Return roots of a beam's stiffness in its axes: the inverse of its flexibility, by Cholesky."""
    length = _length(way)
    E, G, A, Iy, Iz, J = (Decimal(float(properties[name])) for name in ("E", "G", "A", "Iy", "Iz", "J"))
    flexibility = np.full((6, 6), ZERO)
    flexibility[0, 0], flexibility[3, 3] = length / (E * A), length / (G * J)
    for side, slope, second, area, sign in ((1, 5, Iz, "Ay", 1), (2, 4, Iy, "Az", -1)):
        shear = ZERO if np.isinf(properties[area]) else length / (G * Decimal(float(properties[area])))
        flexibility[side, side] = length**3 / (3 * E * second) + shear
        flexibility[slope, slope] = length / (E * second)
        flexibility[side, slope] = flexibility[slope, side] = sign * length**2 / (2 * E * second)
    lower = np.full((6, 6), ZERO)
    for i in range(6):
        for j in range(i + 1):
            left = flexibility[i, j] - (lower[i, :j] * lower[j, :j]).sum()
            lower[i, j] = left.sqrt() if i == j else left / lower[j, j]
    root = np.full((6, 6), ZERO)  # the inverse of the lower triangle
    for i in range(6):
        right = _decimals(np.eye(6)[i]) - lower[i, :i] @ root[:i] if i else _decimals(np.eye(6)[0])
        root[i] = right / lower[i, i]
    return root @ _both(_axes(way, _decimals(up))).T


def _null_space(rows: Exact, size: int) -> Exact:
    """Return a basis (size, free) of what the rows allow: the free unknowns as they are."""
    left, pivots = rows.copy(), []
    for at in range(min(left.shape)):
        sizes = np.abs(left[at:])
        row, column = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
        if sizes[row, column] <= NONE:
            break
        left[[at, at + row]] = left[[at + row, at]]
        left[at] = left[at] / left[at, column]
        others = [other for other in range(len(left)) if other != at and left[other, column] != 0]
        left[others] = left[others] - left[others, column][:, None] * left[at]
        pivots.append(int(column))
    free = [at for at in range(size) if at not in pivots]
    basis = np.full((size, len(free)), ZERO)
    basis[free, range(len(free))] = ONE
    basis[pivots] = -left[: len(pivots)][:, free]
    return basis


def _solved(matrix: Exact, right: Exact, whole: Exact) -> Exact | None:
    """Return the solution of a positive definite system; None where a pivot is nothing of what is whole."""
    left, size = np.concatenate([matrix, right], axis=1), len(matrix)
    for at in range(size):
        if left[at, at] <= NONE * whole[at]:
            return None
        left[at, at:] = left[at, at:] / left[at, at]
        below = [row for row in range(at + 1, size) if left[row, at] != 0]
        left[below, at:] = left[below, at:] - left[below, at][:, None] * left[at, at:]
    for at in reversed(range(size)):
        above = [row for row in range(at) if left[row, at] != 0]
        left[above, size:] = left[above, size:] - left[above, at][:, None] * left[at, size:]
    return left[:, size:]
