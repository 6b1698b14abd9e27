"""Structures on which other programs crash, stop without a word or return a wrong number with status 0.

A mechanism (plain, turned in space, hidden, a closed loop), springs 1e25 apart: always the exact answer, or
one line that names the part. Parts of no length, disconnected ones and sections that are no numbers are in
`test_degenerate_parts.py`.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import event, given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, Material, Robot, compile_structure
from beamstiff.fem.condensation import tcp_compliance, tcp_stiffness
from beamstiff.fem.static_response import nodal_loads, respond
from tests.fem.builders import (
    FREE,
    RIGID,
    SECTION,
    STEEL,
    at_rest,
    compliance,
    displacement,
    frame,
    solve,
    some_rotation,
    turned,
)

HINGE = (RIGID, RIGID, FREE, RIGID)
Z = (0, 0, 1)


def refusal(robot: Robot, one: bool = True) -> str:
    """Return what is said of a structure, the same whichever way it is asked if it has one free motion."""
    said = []
    for ask in (
        lambda: tcp_compliance(structure := compile_structure(robot), at_rest(structure)),
        lambda: solve(robot, {}),
        lambda: solve(robot, {robot.tcp: [1, 2, 3, 4, 5, 6]}, gravity=True),
    ):
        with pytest.raises(BeamstiffError) as refused:
            ask()
        said.append(str(refused.value))
    assert not one or said[0] == said[1] == said[2]
    assert "\n" not in said[0]
    return said[0]


# ---------------------------------------------------------------- mechanisms

FOUR_BAR = [(0, 0, 0), (0, 0, 0), (0, 1, 0), (0, 1, 0), (1, 1, 0), (1, 1, 0), (1, 0, 0), (1, 0, 0)]
ROTATIONS = pytest.mark.parametrize("rotation", [np.eye(3), *map(some_rotation, range(4))])


@ROTATIONS
def test_a_beam_on_a_hinge(rotation: np.ndarray) -> None:
    robot = frame([(0, 0, 0), (0, 0, 0), (1, 0, 0)], beams=[(1, 2)], joints=[(0, 1, Z, HINGE)])
    said = refusal(turned(robot, rotation, (0.3, 0.2, 0.1)))
    assert said.startswith("robot 'frame' is a mechanism: node 'n2' ")
    assert said.endswith("freely, through j0.torsional; moving nodes: n2, n1")


@ROTATIONS
@pytest.mark.parametrize("links", ["beams", "rigids"])
def test_a_closed_loop_that_moves(rotation: np.ndarray, links: str) -> None:
    """A four-bar with four free hinges."""
    bars: dict[str, Any] = {links: [(1, 2), (3, 4), (5, 6)]}
    joints = [(i, j, Z, HINGE) for i, j in ((0, 1), (2, 3), (4, 5), (6, 7))]
    robot = frame(FOUR_BAR, joints=joints, fixed=(0, 7), tcp=3, **bars)
    said = refusal(turned(robot, rotation))
    assert said.startswith("robot 'frame' is a mechanism: node ")
    for joint in ("j0", "j1", "j2", "j3"):
        assert f"{joint}.torsional" in said
    held = turned(robot, rotation).with_parameters({"j0.torsional": 1e4})
    assert np.isfinite(compliance(held)).all()


def test_a_hinge_hidden_in_a_large_frame() -> None:
    """A tower of 16 storeys with one loose member among 112."""
    rng = np.random.default_rng(2)
    points, beams = [(x, y, 0.0) for x in (0, 1) for y in (0, 1)], []
    for storey in range(16):
        base = 4 * storey
        points += [(x + 0.05 * rng.random(), y, storey + 1.0) for x in (0, 1) for y in (0, 1)]
        beams += [(base + at, base + 4 + at) for at in range(4)]
        beams += [(base + 4 + i, base + 4 + j) for i, j in ((0, 1), (1, 3), (3, 2))]
    last = len(points) - 1
    points += [points[38], (2.0, 0.3, 9.5)]
    loose = {"beams": [*beams, (last + 1, last + 2)], "fixed": (0, 1, 2, 3), "tcp": last}
    robot = frame(points, joints=[(38, last + 1, (1, 1, 0), (FREE, RIGID, RIGID, RIGID))], **loose)
    assert refusal(robot) == (
        f"robot 'frame' is a mechanism: node 'n{last + 1}' moves along (0.71, 0.71, 0.00) freely, "
        f"through j0.axial; moving nodes: n{last + 1}, n{last + 2}"
    )


@ROTATIONS
def test_an_unbraced_panel_of_struts(rotation: np.ndarray) -> None:
    """A node between two struts in one line, and a square of struts that shears."""
    beam = [(5, 5, 5), (5, 5, 6)]
    line = frame(
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), *beam],
        struts=[(0, 1, 1e6), (1, 2, 1e6)],
        beams=[(3, 4)],
        fixed=(0, 2, 3),
    )
    said = refusal(turned(line, rotation), one=False)
    assert said.startswith("robot 'frame' is a mechanism: node 'n1' moves along (")
    assert said.endswith(") freely; moving nodes: n1")
    once = frame([(0, 0, 0), (1, 0, 0), *beam], struts=[(0, 1, RIGID)], beams=[(2, 3)], fixed=(0, 2))
    assert "node 'n1' moves along" in refusal(turned(once, rotation), one=False)


def test_the_free_motion_is_named_with_its_direction() -> None:
    slide = frame(
        [(0, 0, 0), (0, 0, 0), (1, 0, 0)],
        beams=[(1, 2)],
        joints=[(0, 1, (0, 0.6, 0.8), (FREE, RIGID, RIGID, RIGID))],
    )
    assert "moves along (0.00, 0.60, 0.80) freely, through j0.axial" in refusal(slide)
    ball = frame([(0, 0, 0), (0, 0, 0), (0.1, 0, 0)], beams=[(1, 2)], joints=[(0, 1, (1, 0, 0), HINGE)])
    assert "turns about (" in refusal(ball)


@pytest.mark.parametrize("modulus", [1e3, 1e20, 1e40])
def test_the_direction_is_named_however_stiff_the_rest_is(modulus: float) -> None:
    parts = {"beams": [(1, 2)], "joints": [(0, 1, (0, 1, 0), HINGE)]}
    robot = frame([(0, 0, 0), (0, 0, 0), (1, 0, 0)], material=Material(E=modulus, G=modulus), **parts)
    assert "node 'n2' moves along (0.00, 0.00, 1.00) freely, through j0.torsional" in refusal(robot)


def test_two_mechanisms_at_once_and_all_that_is_free() -> None:
    robot = frame([(0, 0, 0), (0, 0, 0), (1, 0, 0)], rigids=[(1, 2)], joints=[(0, 1, Z, (FREE,) * 4)])
    said = refusal(robot, one=False)
    assert said.startswith("robot 'frame' is a mechanism: node 'n")
    assert "through j0." in said


# ------------------------------------------------- a loop of rigid parts where it is singular


def rigid_four_bar(angle: float) -> Robot:
    """Return a parallelogram of rigid bars with hinges at a crank angle; flat at 0: it can fold over."""
    c, s = math.cos(angle), math.sin(angle)
    points = [(0, 0, 0), (0, 0, 0), (c, s, 0), (c, s, 0), (c + 2, s, 0), (c + 2, s, 0), (2, 0, 0), (2, 0, 0)]
    joints = [(i, j, Z, HINGE) for i, j in ((0, 1), (2, 3), (4, 5), (6, 7))]
    return frame(points, rigids=[(1, 2), (3, 4), (5, 6)], joints=joints, fixed=(0, 7), tcp=3)


def test_a_flat_parallelogram_of_rigid_bars_has_a_second_motion() -> None:
    """With one crank sprung it is held at any other angle; flat, the other end of the coupler is loose."""
    sprung = {"j0.torsional": 1e4}
    at_work = compliance(rigid_four_bar(0.7).with_parameters(sprung))
    assert at_work[1, 1] == pytest.approx(math.cos(0.7) ** 2 / 1e4, rel=1e-9)
    said = refusal(rigid_four_bar(0.0).with_parameters(sprung))
    assert said.startswith("robot 'frame' is a mechanism: node ")
    assert all(f"{joint}.torsional" in said for joint in ("j1", "j2", "j3"))
    # with both cranks sprung both ends of the flat coupler are held
    both = compliance(rigid_four_bar(0.0).with_parameters(sprung | {"j3.torsional": 3e4}))
    assert both[1, 1] == pytest.approx(1 / 1e4, rel=1e-9)
    assert both[5, 5] == pytest.approx((1 / 1e4 + 1 / 3e4) / 4, rel=1e-9)


def test_singular_positions_among_others_are_answered_pose_by_pose() -> None:
    robots = [rigid_four_bar(angle) for angle in (0.7, 0.0, 1.2, math.pi, 0.3)]
    springs = {"j0.torsional": 1e4, "j3.torsional": 3e4}
    structures = [compile_structure(robot.with_parameters(springs)) for robot in robots]
    poses = [at_rest(structure) for structure in structures]
    joined = type(poses[0])(
        *(
            np.concatenate([getattr(pose, item.name) for pose in poses])
            for item in dataclasses.fields(poses[0])
        )
    )
    apart = np.concatenate([tcp_compliance(one, pose) for one, pose in zip(structures, poses, strict=True)])
    for chunk in (1, 2, 512):
        together = tcp_compliance(structures[0], joined, chunk)
        assert np.abs(together - apart).max() <= 1e-14 * np.abs(apart).max()
    loads = nodal_loads(structures[0], 5, {"n3": np.arange(1.0, 7.0)})
    moved = respond(structures[0], joined, loads).displacement
    for at in range(5):
        alone = respond(structures[at], poses[at], loads[:1]).displacement[0]
        assert np.abs(moved[at] - alone).max() <= 1e-13 * np.abs(alone).max()
    loose = compile_structure(robots[0].with_parameters({"j0.torsional": 1e4}))
    with pytest.raises(BeamstiffError, match="is a mechanism at pose 1: "):
        tcp_compliance(loose, joined)
    with pytest.raises(BeamstiffError, match="is a mechanism at pose 1: "):
        tcp_compliance(loose, joined, chunk=1)


def test_a_locked_loop_of_rigid_bars_is_rigid() -> None:
    """Five hinges on skew axes cannot move: nothing is compliant, and nothing is a mechanism."""
    rng = np.random.default_rng(1)
    corners = rng.uniform(-1, 1, (5, 3))
    points = [corner for corner in corners for _ in (0, 1)]
    joints = [(2 * at, 2 * at + 1, rng.normal(size=3), HINGE) for at in range(5)]
    rigids = [(2 * at + 1, (2 * at + 2) % 10) for at in range(5)]
    robot = frame(points, joints=joints, rigids=rigids, fixed=(0,), tcp=4)
    assert np.abs(compliance(robot)).max() == 0.0
    structure = compile_structure(robot)
    with pytest.raises(BeamstiffError, match="frame: singular compliance at pose 0: the TCP is rigid"):
        tcp_stiffness(tcp_compliance(structure, at_rest(structure)), robot.name)


# ---------------------------------------------------------------- stiffness far apart


@pytest.mark.parametrize("first", [1e-10, 1e15], ids=["soft first", "stiff first"])
@pytest.mark.parametrize("kind", [0, 1, 2, 3], ids=["axial", "radial", "torsional", "tilting"])
def test_springs_in_series_1e25_apart(first: float, kind: int) -> None:
    """1e-10 and 1e15 in series give way by 1e10: exactly, whichever comes first."""
    one, other = [RIGID] * 4, [RIGID] * 4
    one[kind], other[kind] = first, 1e5 / first
    points = [(0, 0, 0)] * 4
    joints = [(0, 1, (1, 0, 0), one), (2, 1, (1, 0, 0), other)]
    robot = frame(points, joints=joints, rigids=[(2, 3)])
    direction = (0, 1, 3, 4)[kind]
    assert compliance(robot)[direction, direction] == pytest.approx(1e10, rel=1e-12)


@pytest.mark.parametrize("pair", [(1e-10, 1e15), (1e15, 1e-10)])
def test_springs_in_parallel_1e25_apart(pair: tuple[float, float]) -> None:
    joints = [(0, 1, (1, 0, 0), (k, RIGID, RIGID, RIGID)) for k in pair]
    robot = frame([(0, 0, 0), (0, 0, 0)], joints=joints)
    assert compliance(robot)[0, 0] == pytest.approx(1e-15, rel=1e-12)


LOST = "is lost in rounding beside far stiffer parts"


def answer(robot: Robot, load: Sequence[float]) -> np.ndarray | str:
    """Return the TCP's displacement, or why there is none."""
    try:
        return displacement(robot, {robot.tcp: load})
    except BeamstiffError as refused:
        return str(refused)


@pytest.mark.parametrize("k", [1e-12, 1e25])
def test_spring_between_beams(k: float) -> None:
    """A spring 1e20 times softer than the beams about it is as exact as one far stiffer."""
    points = [(0, 0, 0), (1, 0, 0), (1, 0, 0), (2, 0, 0)]
    joint = (1, 2, (1, 0, 0), (k, RIGID, RIGID, RIGID))
    robot = frame(points, beams=[(0, 1), (2, 3)], joints=[joint], up=(0, 1, 0))
    found = displacement(robot, {"n3": [1, 0, 0, 0, 0, 0]})
    assert found[0] == pytest.approx(1 / k + 2 / (STEEL.E * SECTION.A), rel=1e-12)


def in_series(parts: str, first: float, second: float) -> tuple[Robot, float]:
    """Return two parts in a row and how much they give way along x: exact."""
    points, x = [(0, 0, 0), (1, 0, 0), (2, 0, 0)], (1, 0, 0)
    slider = (second, RIGID, RIGID, RIGID)
    if parts == "struts":
        guides = [(3, 1, x, (FREE, RIGID, RIGID, RIGID)), (4, 2, x, (FREE, RIGID, RIGID, RIGID))]
        struts = [(0, 1, first), (1, 2, second)]
        robot = frame([*points, *points[1:]], struts=struts, joints=guides, fixed=(0, 3, 4), tcp=2)
        return robot, 1 / first + 1 / second
    if parts in ("beams", "bending beams"):
        made = [Material(E=k, G=k) for k in (first, second)]
        robot = frame(points, beams=[(0, 1), (1, 2)], material=made, up=(0, 1, 0))
        if parts == "beams":
            return robot, (1 / first + 1 / second) / SECTION.A
        upright = turned(robot, np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]]))
        return upright, (7 / first + 1 / second) / (3 * SECTION.Iz)
    one = Material(E=first / SECTION.A, G=first / SECTION.A)
    if parts == "beam and joint":
        ends, beam, joint = [points[0], points[1], points[1]], (0, 1), (1, 2, x, slider)
    else:
        ends, beam, joint = [points[0], points[0], points[1]], (1, 2), (0, 1, x, slider)
    return frame(ends, beams=[beam], material=one, joints=[joint], up=(0, 1, 0)), 1 / first + 1 / second


@given(
    parts=st.sampled_from(["beams", "bending beams", "struts", "beam and joint", "joint and beam"]),
    first=st.floats(-12, 18),
    second=st.floats(-12, 18),
    seed=st.integers(0, 3),
)
def test_parts_in_series_are_exact_or_refused(parts: str, first: float, second: float, seed: int) -> None:
    """Up to 1e30 apart, turned in space: no answer is off by a millionth, none is refused below 1e20."""
    robot, expected = in_series(parts, 10.0**first, 10.0**second)
    rotation = some_rotation(seed)
    along = np.concatenate([rotation @ [1, 0, 0], np.zeros(3)])
    found = answer(turned(robot, rotation), along)
    if isinstance(found, str):
        event("refused")
        assert LOST in found
        assert abs(first - second) > 20
    else:
        assert abs(along @ found / expected - 1) <= 1e-6
