"""Displacements that are misread by where they are read: one of the shapes of `frame-misalignment`.

What measures by angles and lengths from a stand, through lenses or along guides errs by where it looks. Its
errors are those of each place, or, where a displacement is the difference of two places that were read, of a
space that is bent. What reads rotations beside it is turned by itself.
"""

from collections.abc import Iterator
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from beamstiff.diagnosis.effects.drifts import along
from beamstiff.diagnosis.effects.effect import Quantity, Shape
from beamstiff.diagnosis.effects.external import each_by_each
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

SCALE = 0.01
FEW_TIMES = 5.0  # its sizes: what errs by a tenth a metre nobody would measure with
PRODUCTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
LINEAR = 36  # nine gains, constant and by each coordinate
DEGREES = (3, 4)


def misread(baseline: Baseline, turn: Array, turns: tuple[Quantity, ...]) -> Iterator[Shape]:
    """Yield shapes of displacements that are misread by where they are.

    `baseline`: of displacements.
    `turn`: (N, 6, 3) array; what another frame reads, turned about its axes; of it the rotations.
    `turns`: its angles.
    """
    moved, place = baseline.predicted[:, :3], baseline.described[0]
    turned = np.concatenate([0.0 * turn[:, :3], turn[:, 3:]], 1)
    of_place, bent = _of_each_place(moved, place), _bent(moved, place, max(DEGREES))
    ways = {
        "other scales and turns elsewhere": (of_place, LINEAR),
        "other scales and turns elsewhere, by the square of the way": (of_place, len(of_place[1])),
    }
    ways |= {
        f"places read in a bent space, of degree {degree}": (bent, 3 * (comb(degree + 3, 3) - 1))
        for degree in DEGREES
    }
    for name, ((columns, quantities), first) in ways.items():
        both = np.concatenate([turned, columns[..., :first]], -1)
        yield Shape(name, both, (*turns, *quantities[:first]), prior_factor=FEW_TIMES, weight=0.5)


def _of_each_place(moved: Array, place: Array) -> tuple[Array, list[Quantity]]:
    """Return nine gains (N, 6, c) of displacements that change with the place, squares after `LINEAR`."""
    axes = np.broadcast_to(np.eye(3), (len(moved), 3, 3))
    every = np.concatenate([each_by_each(axes, moved), np.zeros((len(moved), 3, 9))], 1)
    courses = {"": ("1", np.ones(len(moved)))} | {
        f"_by_{a}": ("1/m", place[:, k]) for k, a in enumerate("xyz")
    }
    for i, j in PRODUCTS:
        courses[f"_by_{'xyz'[i]}{'xyz'[j]}"] = "1/m^2", 0.5 * place[:, i] * place[:, j]
    columns = [every * course[:, None, None] for _, course in courses.values()]
    quantities = [
        Quantity(f"reading_{a}_by_{b}{end}", unit, SCALE)
        for end, (unit, _) in courses.items()
        for a in "xyz"
        for b in "xyz"
    ]
    return np.concatenate(columns, -1), quantities


def _bent(moved: Array, place: Array, degree: int) -> tuple[Array, list[Quantity]]:
    """Return what a bent space adds to displacements (N, 3), (N, 6, c), lower degrees first.

    Read instead of a place x is ``x + sum c_m m(x)``, m the monomials up to a degree, each over its own
    degree; to a displacement d that adds ``c_m (grad m . d)``.
    """
    columns: list[Array] = []
    quantities: list[Quantity] = []
    for order in range(1, degree + 1):
        unit = "1" if order == 1 else "1/m" if order == 2 else f"1/m^{order - 1}"
        for monomial in combinations_with_replacement(range(3), order):
            slope = np.zeros(len(moved))
            for at, k in enumerate(monomial):
                slope += moved[:, k] * place[:, [*monomial[:at], *monomial[at + 1 :]]].prod(axis=1)
            columns.append(along(slope / order))
            names = "".join("xyz"[k] for k in monomial)
            quantities += [Quantity(f"reading_{a}_by_{names}", unit, SCALE) for a in "xyz"]
    return np.concatenate(columns, -1), quantities
