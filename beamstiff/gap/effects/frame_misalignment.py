"""`frame-misalignment`: the measuring frame is turned, shifted or scaled against the base frame."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline, nominal_pose
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.outside import each_by_each
from beamstiff.se3 import Array

TURN = 0.02  # rad, of displacements
PLACED_TURN, PLACED_SHIFT = 5e-4, 5e-4  # rad, m, of absolute positions
SCALE = 0.01
FEW_TIMES = 3.0  # its sizes: what errs by a tenth a metre nobody would measure with
SKEWED = ((0, 1), (0, 2), (1, 2))
PRODUCTS = ((0, 0), (1, 1), (2, 2), *SKEWED)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:  # noqa: ARG001
    axes = np.broadcast_to(np.eye(3), (len(baseline.rows), 3, 3))
    nothing = np.zeros_like(axes)
    if baseline.absolute:
        position = nominal_pose(baseline.nominal, baseline.rows)[0]
        turn = np.concatenate([np.cross(axes, position[:, :, None], axis=1), axes], 1)
        shift = np.concatenate([axes, nothing], 1)
        turns = tuple(Quantity(f"rotation_{axis}", "rad", PLACED_TURN) for axis in "xyz")
        shifts = tuple(Quantity(f"shift_{axis}", "m", PLACED_SHIFT) for axis in "xyz")
        grown = np.concatenate([position, np.zeros_like(position)], 1)[..., None]
        growth = Quantity("scale", "1", 1e-4)
        return [
            Shape("turned", turn, turns),
            Shape("turned and shifted", np.concatenate([turn, shift], -1), (*turns, *shifts)),
            Shape("scaled", grown, (growth,), weight=0.3),
        ]
    seen = baseline.predicted
    turn = np.concatenate([np.cross(axes, seen[:, s, None], axis=1) for s in (slice(3), slice(3, 6))], 1)
    scale = np.concatenate([seen[:, :3], np.zeros_like(seen[:, :3])], 1)[..., None]
    turns = tuple(Quantity(f"rotation_{axis}", "rad", TURN) for axis in "xyz")
    growth = Quantity("scale", "1", SCALE)
    scales = np.zeros((len(seen), 6, 3))
    scales[:, [0, 1, 2], [0, 1, 2]] = seen[:, :3]
    growths = tuple(Quantity(f"scale_{axis}", "1", SCALE) for axis in "xyz")
    # axes that are not square to each other, of a machine that measures along its own
    skew = np.zeros((len(seen), 6, 3))
    for at, (i, j) in enumerate(SKEWED):
        skew[:, i, at], skew[:, j, at] = seen[:, j], seen[:, i]
    skews = tuple(Quantity(f"skew_{'xyz'[i]}{'xyz'[j]}", "rad", SCALE) for i, j in SKEWED)
    return [
        Shape("turned", turn, turns),
        *_elsewhere(baseline),
        Shape("turned and scaled", np.concatenate([turn, scale], -1), (*turns, growth), weight=0.5),
        Shape(
            "turned, scaled by axis and skewed",
            np.concatenate([turn, scales, skew], -1),
            (*turns, *growths, *skews),
            weight=0.5,
        ),
    ]


def _elsewhere(baseline: Baseline) -> list[Shape]:
    """Return misreadings of displacements that change with the place, linearly and by its square.

    What measures by angles and lengths from a stand, or through lenses, errs by where it looks.
    """
    moved, place = baseline.predicted[:, :3], nominal_pose(baseline.nominal, baseline.rows)[0]
    axes = np.broadcast_to(np.eye(3), (len(moved), 3, 3))
    every = np.concatenate([each_by_each(axes, moved), np.zeros((len(moved), 3, 9))], 1)
    linear = {"": ("1", np.ones(len(moved)))} | {
        f"_by_{a}": ("1/m", place[:, k]) for k, a in enumerate("xyz")
    }
    square = {f"_by_{'xyz'[i]}{'xyz'[j]}": ("1/m^2", 0.5 * place[:, i] * place[:, j]) for i, j in PRODUCTS}

    def shape(name: str, courses: dict[str, tuple[str, Array]]) -> Shape:
        columns = [every * course[:, None, None] for _, course in courses.values()]
        entries = [(end, unit) for end, (unit, _) in courses.items() for _ in range(9)]
        names = [f"reading_{a}_by_{b}" for a in "xyz" for b in "xyz"] * len(courses)
        quantities = (
            Quantity(name + end, unit, SCALE) for name, (end, unit) in zip(names, entries, strict=True)
        )
        return Shape(name, np.concatenate(columns, -1), tuple(quantities), spread=FEW_TIMES, weight=0.5)

    return [
        shape("other scales and turns elsewhere", linear),
        shape("other scales and turns elsewhere, by the square of the way", linear | square),
    ]


EFFECT = Effect(
    name="frame-misalignment",
    family="measurement",
    meaning="The measuring frame is turned, shifted or scaled against the base frame.",
    components=lambda baseline: [None],  # noqa: ARG005
    shapes=_shapes,
    separation="unloaded moves along the base axes",
    look_alikes=("load-error", "geometry-error"),
    sources="0.2 to 3 deg, engineering estimate",
    place="readings",
)
