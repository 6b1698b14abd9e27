"""Tools on three seats: jaws, feet or bolts at a radius r, 120 degrees apart, each compliant by a law.

From a wrench about their middle, a distance a behind the TCP, a seat in direction ``t_i`` carries
``f_i = F_z / 3 + 2 M t_i / (3 r)``; how far the seats yield tilts the tool about the ``t_i`` and lifts it.
Where each follows any law of its force, and lifts off or opens, the tool is softer in some directions than in
others, and softer to one side of each: no compliance, and no law by axis, does that. Where the seats stand is
not known beforehand: they are taken where they explain most of the gap, and the choice is paid for.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from beamstiff.diagnosis.effects.data_selected import best_of, left_by
from beamstiff.diagnosis.effects.effect import Normalisation, stated_scale
from beamstiff.diagnosis.effects.torque_laws import any_compliance, most_of
from beamstiff.diagnosis.residual.baseline import ROUNDING, Baseline
from beamstiff.diagnosis.residual.place import Place
from beamstiff.errors import BeamstiffError, listed
from beamstiff.se3 import Array

DISTANCES, RADII = (0.06, 0.1), (0.035, 0.065)  # m
ANGLES = tuple(np.deg2rad(np.arange(0.0, 120.0, 15.0)).tolist())
NEARER, TURNED = (0.75, 1.0, 1.3), tuple(np.deg2rad([-5.0, 0.0, 5.0]).tolist())
KNEES = (0.15, 0.35)  # of the largest force on a seat
NAMES = ("by_side", *(f"{side}_{knee:g}" for knee in KNEES for side in ("pressed_beyond", "lifted_beyond")))


@dataclass(frozen=True)
class Seats:
    """Where three seats stand.

    `distance`: m; along z behind the TCP.
    `radius`: m.
    `angle`: rad; of the first one's direction of tilt from x about z.
    `force`: N; largest one on a seat, against which its laws count.
    """

    distance: float
    radius: float
    angle: float
    force: float

    def forces(self, load: Array) -> Array:
        """Return the forces on the seats (N, 3) of wrenches (N, 6) about the TCP in the tool's axes, N."""
        moment = load[:, 3:5] + self.distance * np.stack([-load[:, 1], load[:, 0]], -1)
        return load[:, 2:3] / 3.0 + 2.0 / (3.0 * self.radius) * moment @ self.directions.T

    @property
    def directions(self) -> Array:
        """The directions (3, 2) about which the seats tilt the tool."""
        angle = self.angle + 2.0 * np.pi / 3.0 * np.arange(3)
        return np.stack([np.cos(angle), np.sin(angle)], -1)


def seat_scales(baseline: Baseline) -> Normalisation:
    """Return where the seats stand and their largest force, by the names that `seats_of` finds again."""
    seats = seats_of(baseline)
    if seats is None:
        return {}
    return {f"seats_{name}": value for name, value in vars(seats).items()}


def seats_of(baseline: Baseline) -> Seats | None:
    """Return the seats that explain most of the gap of the rows that were fitted, or those stated.

    None where no row loads them, or where the robot states none.
    """
    if baseline.stated is not None:
        return _stated(baseline)
    fit, place = baseline.fit, baseline.fit.places.flange
    left = left_by(fit, any_compliance(fit, place))

    def chosen(*where: Sequence[float]) -> Seats | None:
        tried = [seats for one in product(*where) if (seats := _at(fit, *one)) is not None]
        return best_of(tried, left, lambda seats: by_seats(fit, place, seats))

    best = chosen(DISTANCES, RADII, ANGLES)
    if best is None:
        return None
    distances, radii = ([size * by for by in NEARER] for size in (best.distance, best.radius))
    return chosen(distances, radii, [best.angle + by for by in TURNED])


def choices() -> int:
    """Return among how many places of the seats one is chosen first."""
    return len(DISTANCES) * len(RADII) * len(ANGLES)


def by_seats(baseline: Baseline, place: Place, seats: Seats) -> Array:
    """Return how seats that yield by laws displace the rows, (N, 6, 2 laws): tilts in turn with lifts.

    Each law is 1 under the largest force to its side; the lift is the mean of the three seats', in m, and the
    tilt the sum about their directions, in rad.
    """
    loaded, dead = (seats.forces(wrench) / seats.force for wrench in (place.load + place.dead, place.dead))
    # the seats' tilt moves the TCP too, which is in front of them
    tilt = place.shift[:, :, 3:5] + seats.distance * np.stack(
        [-place.shift[:, :, 1], place.shift[:, :, 0]], -1
    )
    turned = tilt @ seats.directions.T  # (N, 6, 3)
    columns = []
    for by_load, by_weight in zip(_laws(loaded), _laws(dead), strict=True):
        given = by_load - (0.0 if baseline.absolute else by_weight)
        columns += [
            np.einsum("nas,ns->na", turned, given),
            place.shift[:, :, 2] * given.mean(axis=1)[:, None],
        ]
    return np.stack(columns, -1)


def _laws(force: Array) -> Iterator[Array]:
    yield np.abs(force)
    for knee in KNEES:
        yield np.maximum(force - knee, 0.0) / (1.0 - knee)
        yield np.minimum(force + knee, 0.0) / (1.0 - knee)


def _stated(baseline: Baseline) -> Seats | None:
    names = [f"seats_{name}" for name in ("distance", "radius", "angle", "force")]
    values = [stated_scale(baseline, name) for name in names]
    known = [value for value in values if value is not None]
    if not any(name in (baseline.stated or {}) for name in names):
        return None
    if len(known) < len(names):
        missing = [name for name, value in zip(names, values, strict=True) if value is None]
        raise BeamstiffError(
            f"scales: {listed(missing)} missing, expected a number for each of {listed(names)}"
        )
    for name, value in zip(names, known, strict=True):
        if name in ("seats_radius", "seats_force") and value <= 0:
            raise BeamstiffError(f"scales.{name}: found {value:g}, expected a positive number")
    return Seats(*known)


def _at(baseline: Baseline, distance: float, radius: float, angle: float) -> Seats | None:
    """Return seats with their largest force; None where no row loads them."""
    seats, place = Seats(distance, radius, angle, 1.0), baseline.places.flange
    every = most_of(place)
    largest = float(np.abs(seats.forces(every)).max(initial=0.0))
    most = np.linalg.norm(every[:, :3], axis=1) + np.linalg.norm(every[:, 3:], axis=1) / radius
    loaded = largest > ROUNDING * float(most.max(initial=0.0))
    return replace(seats, force=largest) if loaded else None
