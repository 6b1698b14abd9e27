"""The portal milling machine against hand formulas: all rigid but one part, which then is a textbook case."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.fem.loads import total_mass
from beamstiff.fem.placed_structure import place
from beamstiff.se3 import Array
from tests.robots.machine import at, compliance, corners, inside, nothing_gives_but, point

ROBOT = load_robot("gantry")
Q = inside(ROBOT, 20)
E, G = 210e9, 80e9
LEVER = 0.450  # m, from the bridge's axis to the ram's


def bends(*directions: Array) -> Array:
    """Return the sum of ``s s^T`` of some displacements (P, 6)."""
    result: Array = sum(s[:, :, None] * s[:, None, :] for s in directions)
    return result


def close(found: Array, expected: Array) -> bool:
    return bool(np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max())


def unit(direction: int) -> Array:
    return np.tile(np.eye(6)[direction], (len(Q), 1))


def test_the_tool_is_where_the_drives_put_it() -> None:
    tool = point(at(ROBOT, Q), "tool")
    assert tool == pytest.approx(Q * [1, 1, -1] + [LEVER, 0.0, 1.9], abs=1e-12)


def test_only_the_screw_along_the_bridge_gives() -> None:
    found = compliance(nothing_gives_but(ROBOT, {"screw_y": 2e8}), Q)
    assert close(found, bends(unit(1)) / 2e8)


def test_only_the_racks_give_and_carry_half_each() -> None:
    found = compliance(nothing_gives_but(ROBOT, {"X_left.axial": 1.5e8, "X_right.axial": 1.5e8}), Q)
    assert close(found, bends(unit(0)) / (2 * 1.5e8))


def test_only_the_screw_of_the_ram_gives() -> None:
    assert close(compliance(nothing_gives_but(ROBOT, {"Z.axial": 1.5e8}), Q), bends(unit(2)) / 1.5e8)


def test_only_the_saddles_guide_turns_about_the_bridge() -> None:
    turn = np.zeros((len(Q), 6))
    turn[:, 4] = 1.0  # about y: the tool is LEVER in front of the axis and below it
    turn[:, :3] = np.cross(
        [0.0, 1.0, 0.0], np.stack([np.full(20, LEVER), np.zeros(20), -0.2 - Q[:, 2]], axis=1)
    )
    assert close(compliance(nothing_gives_but(ROBOT, {"Y.torsional": 8e7}), Q), bends(turn) / 8e7)


def test_only_the_bridge_bends_and_twists_under_the_ram() -> None:
    # ends clamped by the carriages, load between them: Roark, table 8.1 case 1d, and the same for the twist
    found = compliance(nothing_gives_but(ROBOT, beams=("bridge_left_part", "bridge_right_part")), Q)
    length = 2.4
    a, b = 1.2 - Q[:, 1], 1.2 + Q[:, 1]
    second = (0.400 * 0.500**3 - 0.370 * 0.470**3) / 12
    around = 2 * (0.385 + 0.485)  # Bredt's shear flow around the box, and within its thin walls
    torsion = 4 * (0.385 * 0.485) ** 2 * 0.015 / around + around * 0.015**3 / 3
    sag = a**3 * b**3 / (3 * E * second * length**3)
    twist = a * b / (G * torsion * length)
    assert found[:, 2, 2] == pytest.approx(sag + LEVER**2 * twist, rel=1e-9)


def test_only_the_ram_bends_as_a_cantilever_as_long_as_it_sticks_out() -> None:
    found = compliance(nothing_gives_but(ROBOT, beams=("ram",)), Q)
    length = Q[:, 2]
    area, second = 0.280**2 - 0.230**2, (0.280**4 - 0.230**4) / 12
    assert found[:, 0, 0] == pytest.approx(length**3 / (3 * E * second), rel=1e-9)
    assert found[:, 1, 1] == pytest.approx(length**3 / (3 * E * second), rel=1e-9)
    assert found[:, 2, 2] == pytest.approx(length / (E * area), rel=1e-9)
    assert found[:, 3, 3] == pytest.approx(length / (E * second), rel=1e-9)
    assert np.abs(found[:, 0, 4]) == pytest.approx(length**2 / (2 * E * second), rel=1e-9)


def test_the_whole_machine_is_softer_than_any_part_alone() -> None:
    whole = compliance(ROBOT, Q)
    for part in ({"screw_y": 2e8}, {"Z.axial": 1.5e8}, {"Y.torsional": 8e7}):
        assert np.linalg.eigvalsh(whole - compliance(nothing_gives_but(ROBOT, part), Q)).min() > 0.0


def test_carriages_that_move_to_mirrored_places_leave_a_mirrored_machine() -> None:
    # in the plane y = 0: y and the rotations about x and z change sign; the screw, on the left, is left out
    stiff = ROBOT.with_parameters({"screw_y": 0.0, "Y.axial": np.inf})
    mirror = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    found, other = compliance(stiff, Q), compliance(stiff, Q * [1, -1, 1])
    assert close(mirror @ other @ mirror, found)


def test_it_weighs_as_much_wherever_the_carriages_are_but_for_the_ram() -> None:
    structure, posture = at(ROBOT, corners(ROBOT))
    mass = total_mass(structure, place(structure, posture))
    post, rail, bridge = 0.4**2 - 0.37**2, 0.3 * 0.4 - 0.27 * 0.37, 0.4 * 0.5 - 0.37 * 0.47
    ram = (0.28**2 - 0.23**2) * corners(ROBOT)[:, 2]
    steel = 7850.0 * (4 * 1.8 * post + 2 * 3.0 * rail + 2.4 * bridge + ram)
    assert mass == pytest.approx(steel + 150 + 150 + 350 + 120, rel=1e-12)
