"""`frame-misalignment`: the measuring frame is turned, shifted or scaled against the base frame."""

from __future__ import annotations

import numpy as np

from beamstiff.gap.baseline import Baseline, nominal_pose
from beamstiff.gap.effects.effect import Effect, Quantity, Shape
from beamstiff.gap.effects.outside import each_by_each

TURN = 0.02  # rad, of displacements
PLACED_TURN, PLACED_SHIFT = 5e-4, 5e-4  # rad, m, of absolute positions
SCALE = 0.01
SKEWED = ((0, 1), (0, 2), (1, 2))
PRODUCTS = ((0, 0), (1, 1), (2, 2), *SKEWED)
ENTRIES = tuple(f"reading_{a}_by_{b}" for a in "xyz" for b in "xyz")


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
    # what measures by angles and lengths from a stand, or through lenses, errs by where it looks
    place = nominal_pose(baseline.nominal, baseline.rows)[0]
    every = np.concatenate([each_by_each(axes, seen[:, :3]), np.zeros((len(seen), 3, 9))], 1)
    where = [np.ones(len(seen)), *place.T]
    curved = [place[:, i] * place[:, j] for i, j in PRODUCTS]
    by_place = [
        (f"{what}{name}", unit, SCALE * share)
        for name, unit, share in [("", "1", 1.0), *((f"_by_{a}", "1/m", 1.0) for a in "xyz")]
        for what in ENTRIES
    ]
    by_square = [
        (f"{what}_by_{'xyz'[i]}{'xyz'[j]}", "1/m^2", 0.5 * SCALE) for i, j in PRODUCTS for what in ENTRIES
    ]
    linear = np.concatenate([every * course[:, None, None] for course in where], -1)
    square = np.concatenate([every * course[:, None, None] for course in curved], -1)
    return [
        Shape("turned", turn, turns),
        Shape(
            "other scales and turns elsewhere",
            linear,
            tuple(Quantity(*each) for each in by_place),
            weight=0.5,
        ),
        Shape(
            "other scales and turns elsewhere, by the square of the way",
            np.concatenate([linear, square], -1),
            tuple(Quantity(*each) for each in (*by_place, *by_square)),
            weight=0.5,
        ),
        Shape("turned and scaled", np.concatenate([turn, scale], -1), (*turns, growth), weight=0.5),
        Shape(
            "turned, scaled by axis and skewed",
            np.concatenate([turn, scales, skew], -1),
            (*turns, *growths, *skews),
            weight=0.5,
        ),
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
