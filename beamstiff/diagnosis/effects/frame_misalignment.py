"""`frame-misalignment`: the measuring frame is turned, shifted or scaled against the base frame."""

from collections.abc import Iterator
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.effects.data_selected import best_of, left_by
from beamstiff.diagnosis.effects.effect import (
    Effect,
    Normalisation,
    Quantities,
    Quantity,
    Shape,
    Term,
    named,
    stated_scale,
)
from beamstiff.diagnosis.effects.external import (
    CLOSE,
    anew,
    clock,
    clock_of,
    moments,
    row_before,
    shift_alone,
)
from beamstiff.diagnosis.effects.misread import SCALE, misread
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

TURN = 0.02  # rad, of displacements
PLACED_TURN, PLACED_SHIFT = 5e-4, 5e-4  # rad, m, of absolute positions
PLACED_SCALE = 1e-4
SKEWED = ((0, 1), (0, 2), (1, 2))
MOMENTS = 40  # at most, at which the frame may have moved
MOVED = "then moved"
ONCE = "moved"  # of a frame that a calibration finds as it was before


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    found = _of_positions(baseline) if baseline.absolute else _of_displacements(baseline)
    return [replace(one, against=None if _in_time(one.name) else ()) for one in found]


def _in_time(shape: str) -> bool:
    return shape.endswith(MOVED) or shape.startswith(ONCE)


def _of_displacements(baseline: Baseline) -> list[Shape]:
    turn = _turned(baseline)
    stretched = _stretched(baseline.predicted[:, :3])
    return [
        Shape.of("turned", turn),
        *misread(baseline, *turn),
        Shape.of("turned and scaled", turn, _scale(stretched, SCALE), weight=0.5),
        Shape.of("turned, scaled by axis and skewed", turn, (stretched, _stretches(SCALE)), weight=0.5),
        *_moved(baseline, "turned", turn),
        *anew("turned, another way in every posture", baseline, *turn),  # set up again for each
    ]


def _of_positions(baseline: Baseline) -> list[Shape]:
    placed, entries = _turned(baseline)
    both, stretched = (placed, entries), _stretched(baseline.described[0])
    skewed = (stretched, _stretches(PLACED_SCALE))
    bent = Shape.of("scaled by axis and skewed", skewed)
    if baseline.given is not None:  # a calibration beside it finds where the frame stands
        return [bent, *_moved_between(baseline, both)]
    return [
        Shape("turned", placed[..., :3], entries[:3]),
        Shape.of("turned and shifted", both),
        Shape.of("scaled", _scale(stretched, PLACED_SCALE), weight=0.3),
        Shape.of("turned, shifted, scaled by axis and skewed", both, skewed, weight=0.3),
        *_moved(baseline, "turned and shifted", both),
        *([bent] if baseline.stated is not None else ()),
    ]


def _turned(baseline: Baseline) -> Term:
    """Return what another frame reads: turned by 3 angles; of positions shifted too."""
    axes = np.broadcast_to(np.eye(3), (len(baseline.rows), 3, 3))
    if not baseline.absolute:
        seen = baseline.predicted
        parts = [np.cross(axes, seen[:, some, None], axis=1) for some in (slice(3), slice(3, 6))]
        return np.concatenate(parts, 1), named("rotation", "rad", TURN)
    position = baseline.described[0]
    turn = np.concatenate([np.cross(axes, position[:, :, None], axis=1), axes], 1)
    quantities = (*named("rotation", "rad", PLACED_TURN), *named("shift", "m", PLACED_SHIFT))
    return np.concatenate([turn, shift_alone(axes)], -1), quantities


def _stretched(length: Array) -> Array:
    """Return how scales by axis and axes that are not square to each other change lengths (N, 3), (N, 6, 6).

    So reads a machine that measures along its own axes.
    """
    result = np.zeros((len(length), 6, 6))
    result[:, [0, 1, 2], [0, 1, 2]] = length
    for at, (i, j) in enumerate(SKEWED, 3):
        result[:, i, at], result[:, j, at] = length[:, j], length[:, i]
    return result


def _stretches(size: float) -> Quantities:
    return (*named("scale", "1", size), *named("skew", "rad", size, ("xy", "xz", "yz")))


def _scale(stretched: Array, size: float) -> Term:
    return stretched[..., :3].sum(axis=-1), (Quantity("scale", "1", size),)


def _moved(baseline: Baseline, name: str, term: Term) -> Iterator[Shape]:
    """Yield the shape of a frame that was moved: of all its columns those after the moment too."""
    at = _moment(baseline)
    if at is not None:
        # the choice of the moment is paid for
        later = _later(at, baseline, term)
        yield Shape.of(f"{name}, {MOVED}", term, later, weight=1.0 / MOMENTS, data_selected=True)


def _moved_between(baseline: Baseline, term: Term) -> Iterator[Shape]:
    """Yield the shapes of a frame that moved at some moment; a calibration finds it as it was before.

    The machine has no use for where the instrument stood later: they are of these postures alone.
    """
    columns, quantities = term
    of_these = columns, tuple(replace(one, posture_specific=True) for one in quantities)
    every = moments(baseline.fit, CLOSE)
    for at in every:
        name = f"{ONCE}, after {row_before(at, baseline.fit)}"
        yield Shape.of(name, _later(at, baseline, of_these), weight=1.0 / len(every))


def _later(at: float, baseline: Baseline, term: Term) -> Term:
    """Return a term of the rows that were read after a moment alone."""
    columns, quantities = term
    after = np.where(_later_than(at, baseline)[:, None, None], columns, 0.0)
    return after, tuple(replace(one, name=f"{one.name}_later") for one in quantities)


def _later_than(at: float, baseline: Baseline) -> NDArray[np.bool_]:
    """Return which rows were read after a moment, (N,).

    Other rows than those of the campaign are, where times do not say otherwise: it is the frame of today.
    """
    rows, fitted = baseline.rows, clock_of(baseline)
    own = baseline.stated is None and baseline.fit_rows is None
    told = np.isfinite(rows.time).all() if fitted.duration > 0 else len(rows) == fitted.rows
    return clock(baseline) > at if own or told else np.ones(len(rows), dtype=np.bool_)


def _moment(baseline: Baseline) -> float | None:
    """Return by the clock when the frame was moved: as stated, or between which postures explains most.

    NaN where a robot does not state it.
    """
    if baseline.stated is not None:
        at = stated_scale(baseline, "moved_at")
        return np.nan if at is None else at
    fit = baseline.fit
    columns, time = _turned(fit)[0], clock(fit)
    some = moments(fit, MOMENTS)
    if not some:
        return None
    return best_of(some, left_by(fit, columns), lambda at: np.where((time > at)[:, None, None], columns, 0.0))


def _normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    at = _moment(baseline)
    return {} if at is None else {"moved_at": at, **asdict(clock_of(baseline))}


EFFECT = Effect(
    name="frame-misalignment",
    family="measurement",
    meaning="The measuring frame is turned, shifted or scaled against the base frame.",
    components=lambda baseline: [None],
    shapes=_shapes,
    separation="move the unloaded robot along the base axes, and read points of the floor from time to time",
    look_alikes=("load-error", "geometry-error"),
    sources="0.2 to 3 deg, engineering estimate",
    place="readings",
    scales=_normalisation,
)
