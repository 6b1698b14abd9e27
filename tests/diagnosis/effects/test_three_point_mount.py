"""A tool on three seats: statics of a body on three points, and seats found again where they were planted."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, Mass
from beamstiff.diagnosis.effects.three_point_mount import (
    NAMES,
    Seats,
    _laws,
    by_seats,
    choices,
    seat_scales,
    seats_of,
)
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array
from tests.diagnosis.machines import (
    POSITION,
    ROTATION,
    arm_at,
    at_random,
    close,
    kr240,
    nominal,
    rows_of,
    shape_of,
)

PLANTED = Seats(distance=0.08, radius=0.05, angle=np.deg2rad(40.0), force=1.0)


HEAVY = np.array([0.0, 0.0, -9.81 * 20.0])  # N, at the TCP


def baseline(rows: int, seed: int = 1, heavy: bool = False) -> Baseline:
    table = at_random(kr240(), rows, seed=seed, sigma_position=POSITION, sigma_rotation=ROTATION)
    robot = kr240()
    if heavy:
        masses = (Mass(node="n6b", mass=20.0),)
        robot = robot.model_copy(update={"masses": masses, "gravity": (0.0, 0.0, -9.81)})
    return nominal(robot, table)


def places_of(seats: Seats) -> Array:
    """Return where the seats are, (3, 3) m, about their middle: each tilts about its direction."""
    x, y = seats.directions.T
    return seats.radius * np.stack([-y, x, np.zeros(3)], -1)


def on_a_body(there: Baseline, seats: Seats, wrench: Array) -> Array:
    """Return how a body on three points that give way by the size of their forces moves, (N, 6)."""
    tool = arm_at(there.rows.q).tool
    force, moment = (np.einsum("nai,na->ni", tool, part) for part in (wrench[:, :3], wrench[:, 3:]))
    arm = np.array([0.0, 0.0, seats.distance])
    about = moment + np.cross(arm, force)
    points = places_of(seats)
    # forces along z that balance the thrust and both moments across it; the plane through what they give
    balance = np.stack([np.ones(3), points[:, 1], -points[:, 0]])
    pressed = np.linalg.solve(balance, np.stack([force[:, 2], about[:, 0], about[:, 1]])).T
    given = np.abs(pressed) / seats.force
    plane = np.linalg.solve(balance.T, given.T).T  # lift, tilts about x and y
    tilt = np.concatenate([plane[:, 1:], np.zeros((len(plane), 1))], axis=1)
    moved = np.cross(tilt, arm) + plane[:, :1] * np.array([0.0, 0.0, 1.0])
    both = (np.einsum("nai,ni->na", tool, part) for part in (moved, tilt))
    return np.concatenate(list(both), axis=1)


def test_forces_on_the_seats_balance_the_wrench() -> None:
    wrench = np.random.default_rng(2).standard_normal((20, 6))
    force = PLANTED.forces(wrench)
    np.testing.assert_allclose(force.sum(axis=1), wrench[:, 2], atol=1e-12)
    pressed = force[..., None] * np.array([0.0, 0.0, 1.0])
    about = wrench[:, 3:] + np.cross([0.0, 0.0, PLANTED.distance], wrench[:, :3])
    moment = np.cross(places_of(PLANTED), pressed).sum(axis=1)
    np.testing.assert_allclose(moment[:, :2], about[:, :2], atol=1e-12)


@pytest.mark.parametrize(("heavy", "absolute"), [(False, False), (True, False), (True, True)])
def test_a_body_on_three_points_that_give_way_moves_as_the_seats_say(heavy: bool, absolute: bool) -> None:
    there = baseline(12, heavy=heavy)
    there = replace(there, rows=replace(there.rows, kind="absolute" if absolute else "displacement"))
    dead = np.tile(np.concatenate([HEAVY * heavy, np.zeros(3)]), (12, 1))
    moved = on_a_body(there, PLANTED, there.rows.wrench + dead)
    if not absolute:  # loaded less unloaded
        moved = moved - on_a_body(there, PLANTED, dead)
    tilt, lift = (by_seats(there, there.places.flange, PLANTED)[..., k] for k in (0, 1))
    close(tilt * 2.0 / (3.0 * PLANTED.radius) + lift, moved)


def test_every_law_is_one_under_the_largest_force_to_its_side() -> None:
    ends = np.array([-1.0, 1.0])
    assert [law.tolist() for law in _laws(ends)] == [[1, 1], [0, 1], [-1, 0], [0, 1], [-1, 0]]


@pytest.mark.parametrize("angle", [0.0, 17.0, 95.0])
def test_seats_are_found_where_they_were_planted(angle: float) -> None:
    there = baseline(120, seed=3)
    seats = replace(PLANTED, angle=np.deg2rad(angle))
    moved = on_a_body(there, seats, there.rows.wrench)
    moved *= 20.0 * POSITION / np.abs(moved[:, :3]).max()
    noise = np.random.default_rng(4).standard_normal(moved.shape) * there.sigma
    seen = replace(there, measured=there.predicted + moved + noise)
    found = seats_of(seen)
    # half a turn on is the same with the other sign of its force
    off = np.angle(np.exp(3j * (found.angle - seats.angle))) / 3.0
    assert min(abs(off), abs(abs(off) - np.pi / 3.0)) < np.deg2rad(8.0)
    assert found.distance == pytest.approx(seats.distance, rel=0.35)
    columns = shape_of(seen, "tool-compliance", None, "on three seats").columns
    flat = (columns / there.sigma[..., None]).reshape(moved.size, -1)
    target = (moved / there.sigma).ravel()
    left = target - flat @ np.linalg.lstsq(flat, target)[0]
    assert (left**2).sum() < 0.02 * (target**2).sum()


def test_seats_stand_where_they_were_whatever_the_noise_is_thought_to_be() -> None:
    there = baseline(60, seed=5)
    moved = on_a_body(there, PLANTED, there.rows.wrench) * 3e-4
    rng = np.random.default_rng(6)
    seen = replace(there, measured=there.predicted + moved + rng.standard_normal(moved.shape) * there.sigma)
    assert seats_of(seen) == seats_of(replace(seen, sigma=seen.sigma * np.repeat([1.0, 5.0], 3)))


def test_the_choice_of_the_seats_is_paid_for() -> None:
    there = baseline(30, seed=7)
    moved = on_a_body(there, PLANTED, there.rows.wrench) * 3e-4
    seen = replace(there, measured=there.predicted + moved)
    found = shape_of(seen, "tool-compliance", None, "on three seats")
    assert found.data_selected
    assert found.weight * choices() < 1.0


def test_a_robot_that_states_its_seats_has_them_and_one_that_states_none_has_none() -> None:
    there = baseline(20)
    scales = {f"seats_{name}": value for name, value in vars(PLANTED).items()}
    stated = replace(there, stated=scales)
    assert seats_of(stated) == PLANTED
    assert seat_scales(stated) == scales
    assert seats_of(replace(there, stated={})) is None
    assert seat_scales(replace(there, stated={})) == {}
    with pytest.raises(BeamstiffError, match="scales: seats_force missing"):
        seats_of(replace(there, stated={k: v for k, v in scales.items() if k != "seats_force"}))
    with pytest.raises(BeamstiffError, match="seats_radius: found 0, expected a positive number"):
        seats_of(replace(there, stated=scales | {"seats_radius": 0.0}))


def test_where_nothing_is_left_or_nothing_loads_them_there_are_no_seats() -> None:
    there = baseline(10)
    assert seats_of(replace(there, measured=there.predicted)) is None
    still = rows_of(kr240(), there.rows.q, np.zeros((10, 6)))
    unloaded = nominal(kr240(), still)
    noise = 1e-5 * np.random.default_rng(8).standard_normal((10, 6))
    assert seats_of(replace(unloaded, measured=noise)) is None
    assert len(NAMES) * 2 == by_seats(there, there.places.flange, PLANTED).shape[2]
