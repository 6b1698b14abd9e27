"""Laws that no effect of the library has: what they explain is told as a part of the remainder.

Play of the structure, seats that slip, joints that lose their zero and drives that creep, soften or give more
to one side are selected like causes. Without them those that come nearest to them would stand in for them.
"""

from collections.abc import Callable, Collection, Iterator
from functools import partial

import numpy as np

from beamstiff.diagnosis.decomposition.forms import UNMODELLED, Form
from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.effects.effect import Quantity, Shape
from beamstiff.diagnosis.effects.external import CLOSE, clock, moments, row_before
from beamstiff.diagnosis.effects.geometry_error import pose_change
from beamstiff.diagnosis.effects.torque_laws import drives
from beamstiff.diagnosis.inference.component_subspaces import (
    HINGES,
    OPENING,
    PLAY,
    SLIPPING,
    SOFTENING,
    TETHERED,
    opening_of,
    play_of,
    softening_of,
    structure_places,
    unmodelled_of_drive,
)
from beamstiff.diagnosis.inference.external_friction import slipping
from beamstiff.diagnosis.inference.tool_ground_spring import weakly_tethered
from beamstiff.diagnosis.prior import SELDOM, key_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

SIZE = 1e-3  # m, usual RMS of what a mode moves; as of the effects of the library it may be ten times that
MODES = 6  # of a law: those that move the readings most, as many as directions of a wrench
SHOWS = 1e-2  # of the largest mode
LOSES_ZERO = "loses its zero"
SMALLEST = 1e-3  # m that a joint moves the points by for 1 rad: less is none


def unmodelled_forms(model: OpenModel, keys: Collection[str] | None = None) -> list[Form]:
    """Return a form for every unmodelled law of every place: its main modes beside the open geometry.

    `keys`: of these alone.
    """
    baseline = model.baseline
    found = []
    for place, does, law, positive in _laws(baseline):
        if keys is not None and key_of(UNMODELLED, f"{place} {does}") not in keys:
            continue
        columns = baseline.rows.along(law())
        modes = columns @ (np.eye(columns.shape[-1]) if positive else _main(model, columns))
        size = np.sqrt((modes[:, :3] ** 2).sum(axis=1).mean(axis=0))
        moving = np.flatnonzero(size > 0)
        if not moving.size:
            continue
        modes = modes[:, :, moving] / size[moving]
        parameters = tuple(Quantity(f"mode_{at + 1}", "m", SIZE, positive) for at in moving.tolist())
        shape = Shape(does, modes, parameters)
        found.append(Form(UNMODELLED, f"{place} {does}", shape, model.weighed(SIZE * modes), 0.0, SELDOM))
    return [*found, *_lost_zeros(model, keys)]


def _lost_zeros(model: OpenModel, keys: Collection[str] | None) -> Iterator[Form]:
    """Yield a form for every joint and moment at which it may have lost its zero, as by a belt that slips.

    The calibration finds it as it is in the end, so that the form is of the rows before. Not with several
    stations: what differs between these, such as the height of a column, it would stand in for.
    """
    baseline = model.baseline
    if not baseline.absolute or (model.problem is not None and model.problem.geometry.stations > 1):
        return
    every = moments(baseline.fit, CLOSE)
    before = clock(baseline)[:, None] <= np.array(every)  # (N, k)
    for variable in baseline.nominal.actuated:
        component = f"{variable.name} {LOSES_ZERO}"
        if keys is not None and key_of(UNMODELLED, component) not in keys:
            continue
        try:
            change = baseline.rows.along(pose_change(baseline, variable.name)[:, :, None])
        except BeamstiffError:  # a loop that cannot close otherwise
            continue
        columns = -change * before[:, None]
        size = SIZE / max(float(np.sqrt((change[:, :3] ** 2).sum(axis=(1, 2)).mean())), SMALLEST)
        unit = "rad" if variable.kind == "angle" else "m"
        parameters = (Quantity("jump", unit, size, posture_specific=True),)
        seen = model.weighed(size * columns)
        for k, at in enumerate(every):
            shape = Shape(f"after {row_before(at, baseline.fit)}", columns[:, :, [k]], parameters)
            yield Form(UNMODELLED, component, shape, seen[:, [k]], -float(np.log(len(every))), SELDOM)


def _laws(baseline: Baseline) -> Iterator[tuple[str, str, Callable[[], Array], bool]]:
    """Yield place, what it does, how its columns (N, 6, c) are found, and whether none can be negative."""
    for name, place in structure_places(baseline):
        yield name, PLAY, partial(play_of, baseline, place), False
        if place is baseline.places.base or place is baseline.places.flange:
            yield name, SLIPPING, partial(slipping, baseline, place), False
    yield "base", OPENING, partial(opening_of, baseline), True
    yield "tool", TETHERED, partial(weakly_tethered, baseline), False
    for drive in map(str, drives(baseline)):
        for does, law in unmodelled_of_drive(baseline, drive).items():
            yield drive, does, law, False
        yield drive, SOFTENING, partial(softening_of, baseline, drive), True


def lifted_side(form: Form, theta: Array) -> float | None:
    """Return the direction in which a base that opens lifts most, rad from its x about z; of others None."""
    if form.shape.name != OPENING:
        return None
    at = np.array([int(item.name.removeprefix("mode_")) - 1 for item in form.shape.parameters])
    # as `opening_of` has them: to one side turns and lifts, then to the other
    turn = at % (2 * HINGES) < HINGES
    # a foot that turns about a line to the right lifts on its left
    side = np.pi * (at % HINGES / HINGES + at // (2 * HINGES) + 0.5)
    return float(np.angle((theta * np.exp(1j * side))[turn].sum()))


def _main(model: OpenModel, columns: Array) -> Array:
    """Return how the columns (N, 6, c) combine to the modes that move most of the readings, (c, k)."""
    basis = model.open_basis
    seen = model.weighed(columns)
    length = np.linalg.norm(seen, axis=0)
    unit = seen / np.where(length > 0, length, 1.0)
    values, vectors = np.linalg.eigh((unit - basis @ (basis.T @ unit)).T @ unit)
    kept = np.flatnonzero(values > SHOWS**2 * values.max(initial=0.0))[::-1][:MODES]
    combined: Array = vectors[:, kept] / np.where(length > 0, length, np.inf)[:, None]
    return combined
