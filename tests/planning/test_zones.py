"""Zones of maps, and the singular lines that part them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.planning.dexterity import dexterity_map
from beamstiff.planning.poses import joint_grid
from beamstiff.planning.zones import find_zones, singular_lines
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot

KR240 = load_robot("kr240-2")
KINEMATICS = compile_kinematics(KR240)
TURN = np.radians(np.arange(-180, 180, 10))
GRID = joint_grid(KR240, {"q2": TURN, "q3": TURN})
PART = joint_grid(KR240, {"q2": np.linspace(0, 1, 11), "q3": np.linspace(0, 2, 21)})


def bumps(*centres: tuple[float, float], size: float = 0.6) -> np.ndarray:
    """Return values over the full turn: 1 at each centre (deg), falling with the distance around the turn."""
    a, b = np.meshgrid(TURN, TURN, indexing="ij")
    values = np.zeros(GRID.shape)
    for x, y in np.radians(centres):
        away = np.hypot(np.angle(np.exp(1j * (a - x))), np.angle(np.exp(1j * (b - y))))
        values = np.maximum(values, 1 - away / size)
    return values


def test_regions_are_told_apart_and_the_largest_comes_first() -> None:
    values = np.maximum(bumps((-90, 40)), bumps((60, -30), size=1.0))
    zones = find_zones(GRID, values, least=0.05)
    assert [zone.best for zone in zones] == [1.0, 1.0]
    assert [np.degrees(zone.at["q2"]).round() for zone in zones] == [60, -90]
    assert zones[0].share > zones[1].share
    assert not (zones[0].mask & zones[1].mask).any()
    assert sum(zone.mask.sum() for zone in zones) == (values >= 0.05).sum()


@settings(max_examples=50)
@given(st.integers(-18, 17), st.integers(-18, 17))
def test_a_region_is_the_same_wherever_it_lies_on_the_turn(i: int, j: int) -> None:
    [zone] = find_zones(GRID, bumps((10 * i, 10 * j)), least=0.1)
    assert zone.mask.sum() == find_zones(GRID, bumps((0, 0)), least=0.1)[0].mask.sum()
    widths = [np.degrees(high - low).round() for low, high in zone.ranges.values()]
    assert widths == [60, 60]
    middle = [np.degrees(0.5 * (low + high)) for low, high in zone.ranges.values()]
    assert np.exp(1j * np.radians(middle)) == pytest.approx(np.exp(1j * np.radians([10.0 * i, 10.0 * j])))


def test_a_grid_that_is_no_full_turn_is_not_closed() -> None:
    values = np.zeros(PART.shape)
    values[0], values[-1] = 1.0, 1.0
    assert len(find_zones(PART, values, least=0.5)) == 2


def test_missing_values_are_in_no_zone() -> None:
    values = np.zeros(PART.shape)
    values[2:4, 5:9] = 0.9
    values[3, 7] = 0.99
    values[5:, :] = np.nan
    [zone] = find_zones(PART, values, least=0.8)
    assert zone.mask.sum() == 8
    assert zone.best == 0.99
    assert zone.at == {"q2": PART.first[3], "q3": PART.second[7]}
    assert find_zones(PART, values, least=2.0) == []


def test_values_of_another_grid_are_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"found values of shape \(3, 3\), expected \(11, 21\)"):
        find_zones(PART, np.zeros((3, 3)), least=0.1)


def kr240_lines(wrist: float):
    angles = np.radians(np.arange(-180, 181, 3))
    held = {"q4": wrist, "q5": wrist, "q6": wrist}
    grid = joint_grid(KR240, {"q2": angles, "q3": angles}, held)
    return singular_lines(KINEMATICS, dexterity_map(KINEMATICS, grid, 0.682))


def test_singular_lines_are_those_of_the_papers_figure_3() -> None:
    """The oblique line: the wrist's centre on axis 1. The horizontal one: the arm folded or stretched."""
    lines = kr240_lines(np.pi / 4)
    shoulder = [line for line in lines if "q1" in line.joints]
    elbow = [line for line in lines if "q1" not in line.joints]
    assert len(shoulder) + len(elbow) == len(lines)
    assert shoulder
    assert elbow
    for line in shoulder:
        q = np.zeros((len(line.points), 6))
        q[:, 1:3] = line.points
        at = posture(KINEMATICS, q)
        wrist = at.node_positions[:, KINEMATICS.node_index["n5b"]]
        assert np.linalg.norm(wrist[:, :2], axis=1).max() < 1e-6
    # folded: the elbow, the wrist's centre and axis 2 in one line, tan(theta3) = RL4 / |d4| by hand
    stretched = np.degrees(np.arctan2(1.1, 0.055))
    heights = {round(float(np.degrees(line.points[:, 1]).mean()), 1) for line in elbow}
    assert heights == {round(stretched, 1), round(stretched - 180, 1)}
    assert all(np.ptp(line.points[:, 1]) < 1e-6 for line in elbow)
    assert all({"q2", "q3"} <= set(line.joints) for line in elbow)


def test_machines_without_a_determinant_have_no_singular_lines() -> None:
    robot = load_robot("ir663")
    kinematics = compile_kinematics(robot)
    over = {"q2": np.radians([-10, 0, 10]), "q8": np.radians([40, 45, 50])}
    found = dexterity_map(kinematics, joint_grid(robot, over), 0.682)
    with pytest.raises(BeamstiffError, match="'ir663' has 2 actuated variables: singular lines need"):
        singular_lines(kinematics, found)
