"""Wrenches carried from point to point and frame to frame: the same force does the same work."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.wrench import (
    transport_wrench,
    wrench_from_dead_weight,
    wrench_from_force,
    wrench_from_sensor,
)
from beamstiff.se3 import Array, displacement_transport, rotate_screw

VECTORS = arrays(np.float64, 3, elements=st.floats(-10, 10))
SCREWS = arrays(np.float64, 6, elements=st.floats(-10, 10))


@given(SCREWS, SCREWS, VECTORS, VECTORS)
def test_transport_keeps_the_work(wrench: Array, twist: Array, a: Array, b: Array) -> None:
    at_b = displacement_transport(b - a) @ twist  # the displacement of b, where a moves by `twist`
    work = transport_wrench(wrench, a, b) @ at_b
    assert work == pytest.approx(wrench @ twist, abs=1e-10)


@given(SCREWS, SCREWS, VECTORS, VECTORS, VECTORS)
def test_a_sensor_sees_the_work_of_its_own_point(
    reading: Array, twist: Array, turn: Array, sensor: Array, tcp: Array
) -> None:
    rotation = Rotation.from_rotvec(turn).as_matrix()
    in_sensor = rotate_screw(rotation).T @ displacement_transport(sensor - tcp) @ twist
    work = wrench_from_sensor(reading, rotation, sensor, tcp) @ twist
    assert work == pytest.approx(reading @ in_sensor, abs=1e-9)


def test_tare_and_reaction() -> None:
    reading, tare = np.array([0.0, 0, -120, 1, 2, 3]), np.array([0.0, 0, -20, 1, 2, 3])
    where = (np.eye(3), [0, 0, 1.0], [0, 0, 1.5])
    assert wrench_from_sensor(reading, *where, tare=tare).tolist() == [0, 0, -100, 0, 0, 0]
    assert wrench_from_sensor(reading, *where, tare=tare, reaction=True).tolist() == [0, 0, 100, 0, 0, 0]


def test_many_states_at_once() -> None:
    random = np.random.default_rng(2)
    readings = random.normal(size=(20, 6))
    rotations = Rotation.random(20, rng=random).as_matrix()
    sensor, tcp = random.normal(size=(2, 20, 3))
    found = wrench_from_sensor(readings, rotations, sensor, tcp)
    for at in (0, 13):
        alone = wrench_from_sensor(readings[at], rotations[at], sensor[at], tcp[at])
        np.testing.assert_allclose(found[at], alone, rtol=1e-14)


def test_a_force_beside_the_tcp_is_its_wrench_there_carried_over() -> None:
    direction, arm, tcp = np.array([1.0, 2, -2]), np.array([0.2, -0.1, 0.4]), np.array([1.0, 0, 1])
    found = wrench_from_force(direction, [300.0, 600.0], arm=arm)
    for wrench, magnitude in zip(found, (300.0, 600.0), strict=True):
        there = np.array([*(magnitude * direction / 3.0), 0, 0, 0])
        np.testing.assert_allclose(wrench, transport_wrench(there, tcp + arm, tcp), rtol=1e-14)


def test_a_lever_turns_as_the_right_hand_says() -> None:
    # 100 N upward, half a metre along x: turns about -y
    assert wrench_from_force([0, 0, 5], 100, arm=[0.5, 0, 0]).tolist() == [0, 0, 100, 0, -50, 0]
    assert wrench_from_force([0, 0, 1], 100, moment=[1, 2, 3]).tolist() == [0, 0, 100, 1, 2, 3]


def test_a_weight_hangs_straight_down() -> None:
    found = wrench_from_dead_weight([10.0, 20.0], [1.2, 0, 1], [1, 0, 1], gravity=[0, 0, -10])
    np.testing.assert_allclose(found, [[0, 0, -100, 0, 20, 0], [0, 0, -200, 0, 40, 0]], rtol=1e-14)


def test_a_pulley_turns_the_weight_towards_itself_and_eats_its_friction() -> None:
    attachment, pulley = np.array([1.5, 0.2, 1.0]), np.array([3.5, 0.2, 1.5])
    found = wrench_from_dead_weight(
        90, attachment, [1, 0, 1], pulley=pulley, gravity=[0, 0, -10], efficiency=0.9
    )
    assert np.linalg.norm(found[:3]) == pytest.approx(0.9 * 900)
    np.testing.assert_allclose(np.cross(found[:3], pulley - attachment), 0, atol=1e-10)
    assert found[:3] @ (pulley - attachment) > 0
    np.testing.assert_allclose(found[3:], np.cross(attachment - [1, 0, 1], found[:3]), atol=1e-12)


@pytest.mark.parametrize(
    ("call", "part"),
    [
        (lambda: wrench_from_force([0, 0, 0], 1.0), "direction of the force: found a zero vector"),
        (lambda: wrench_from_force([0, 0, np.nan], 1.0), "direction of the force: found nan"),
        (lambda: wrench_from_force([0, 0, 1], np.inf), "magnitude of the force: found inf"),
        (lambda: wrench_from_force([0, 1], 1.0), r"direction of the force: .*shape \(2,\)"),
        (lambda: transport_wrench(np.zeros(5), np.zeros(3), np.zeros(3)), r"wrench: .*shape \(5,\)"),
        (lambda: transport_wrench(["a"] * 6, np.zeros(3), np.zeros(3)), "expected an array of numbers"),
        (lambda: wrench_from_sensor(np.zeros(6), np.ones((3, 3)), [0] * 3, [0] * 3), "not orthonormal"),
        (lambda: wrench_from_dead_weight(-1.0, [0] * 3, [0] * 3), "mass: found -1.0"),
        (
            lambda: wrench_from_dead_weight(1.0, [0] * 3, [0] * 3, pulley=[0] * 3),
            "pulley: found no direction",
        ),
        (
            lambda: wrench_from_dead_weight(1.0, [0] * 3, [0] * 3, gravity=[0] * 3),
            "gravity: found no direction",
        ),
        (lambda: wrench_from_dead_weight(1.0, [0] * 3, [0] * 3, efficiency=1.1), "efficiency: found 1.1"),
    ],
)
def test_loads_that_are_none_are_refused(call: Callable[[], Any], part: str) -> None:
    with pytest.raises(BeamstiffError, match=part):
        call()
