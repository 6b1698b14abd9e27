"""What is said to tell springs apart does, when it is measured; the reduced model does as the full one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.degeneracy import Degeneracy, find_degeneracy
from beamstiff.identification.identify import identify
from beamstiff.identification.problem import build_problem
from beamstiff.identification.reduced_model import reduce_model
from beamstiff.identification.separating_rows import find_separations, separation_text, with_separations
from beamstiff.identification.series_parallel import Joined, Spring
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from benchmarks.degeneracy_graphs import random_case
from benchmarks.degeneracy_study import JOINTS, SIGMA_POSITION, campaign, loads_of, poses_of

RADIAL = [f"{joint}.radial" for joint in JOINTS]
NAMES = ["J12.torsional", "J18.torsional", *RADIAL]


def test_other_postures_tell_joints_4_and_6_apart_as_well_as_said() -> None:
    robot = load_robot("kr500")
    poses = np.random.default_rng(3).uniform(-1, 1, (20, 6))
    poses[:, 4] = 0.0
    loads = np.array([[500.0, 300, -800, 100, 50, 0], [0, 600, 0, 0, 200, 100]])
    tests = campaign(robot, poses, loads)
    pair = ("J4.torsional", "J6.torsional")
    [[best, *_]] = find_separations(robot, tests, [pair])
    assert best.measure == "other postures under the same loads"
    assert best.parts == (("J4.torsional",), ("J6.torsional",))
    bent = np.random.default_rng(4).uniform(-np.pi, np.pi, (20, 6))
    found = identify(robot, concatenate([tests, campaign(robot, bent, loads, seed=1)]))
    assert found.degenerate == ()
    worst = max(found[name].std / found[name].value for name in pair)
    assert worst == pytest.approx(best.std, rel=1.0)  # other postures than those tried


def test_no_load_at_the_tool_parts_bearings_in_series_but_a_reflector_between_does() -> None:
    """And the noise of the table says how well it does."""
    robot, pair = load_robot("ir663"), ("J99.radial", "J1010.radial")
    tests = campaign(robot, poses_of(robot), loads_of(("x", "z")), components="position")
    [[best, *others]] = find_separations(robot, tests, [pair], NAMES)
    assert best.measure.startswith("the displacement of n")
    assert not any("at the tool" in other.measure for other in others)
    node = best.measure.split()[3]
    there = replace(tests, point=np.full(len(tests), node))
    both = find_degeneracy(build_problem(robot, [tests, there], NAMES))
    assert not any(set(pair) <= set(group.members) for group in both.joined)
    exact = replace(tests, sigma=tests.sigma * 1e-3, sigma_position=SIGMA_POSITION * 1e-3)
    assert find_separations(robot, exact, [pair], NAMES)[0][0].std == pytest.approx(1e-3 * best.std, rel=1e-6)


def test_a_load_along_y_makes_axial_stiffness_felt() -> None:
    robot = load_robot("ir663").with_parameters({"J12.axial": 1e6})
    tests = campaign(robot, poses_of(robot), loads_of(("x", "z")), components="position")
    found = with_separations(identify(robot, tests, [*NAMES[:2], "J12.axial"]), robot, tests)
    assert found["J12.axial"].silent
    assert "along y" in found["J12.axial"].separate or "moments about" in found["J12.axial"].separate
    assert found.to_dict()["parameters"]["J12.axial"]["separate"] == found["J12.axial"].separate


def test_nothing_parts_springs_in_parallel_between_two_nodes() -> None:
    case = next(case for case in (random_case(seed, True) for seed in range(50)) if case.parallel)
    [group, *_] = case.parallel
    [found] = find_separations(case.robot, case.tests, [sorted(group)])
    assert found == ()
    assert separation_text(sorted(group), found).startswith("no load on the tool")


def test_the_reduced_robot_does_the_same_on_the_rows_and_has_no_groups_left() -> None:
    robot = load_robot("ir663")
    names = [*NAMES, "J12.axial"]
    tests = campaign(robot, poses_of(robot), loads_of(("x", "z")), components="position")
    found = identify(robot, tests, names)
    problem = build_problem(robot, tests, names)
    values = dict(zip(names, found.stiffness.tolist(), strict=True))
    reduced = reduce_model(robot, find_degeneracy(problem), values, names)
    assert reduced.held == ("J12.axial",)
    assert [one.kept for one in reduced.lumped] == ["J33.radial", "J1010.radial"]
    assert reduced.robot.identify == ("J12.torsional", "J18.torsional", "J33.radial", "J1010.radial")
    assert reduced.robot.parameter("J12.axial") == robot.parameter("J12.axial") == np.inf
    before, after = (predict_displacements(one, tests)[:, :3] for one in (found.robot, reduced.robot))
    assert np.abs(after - before).max() < 1e-9 * np.abs(before).max()
    again = identify(reduced.robot, tests)
    assert again.degenerate == ()
    assert again.rms == pytest.approx(found.rms, rel=1e-6)
    std = found.degenerate[1].std
    lumped = again["J1010.radial"]
    assert lumped.std / lumped.value**2 == pytest.approx(std, rel=0.01)


@pytest.mark.parametrize("seed", range(30))
def test_random_groups_are_reduced_without_a_change_at_the_tool(seed: int) -> None:
    case = random_case(seed, planted=True)
    found = find_degeneracy(build_problem(case.robot, case.tests))
    values = {name: case.robot.parameter(name) for name in case.robot.identify}
    reduced = reduce_model(case.robot, found, values)
    before, after = (predict_displacements(one, case.tests) for one in (case.robot, reduced.robot))
    assert np.abs(after - before).max() <= 1e-8 * np.abs(before).max()
    if reduced.robot.identify:
        left = find_degeneracy(build_problem(reduced.robot, case.tests))
        assert (left.silent, left.joined, left.mixed) == ((), (), ())


def test_groups_within_groups_and_lever_arms_are_lumped_as_stiff_as_the_whole() -> None:
    # k = 1/(1/a + 4/b) + 2 c, seen from a
    inner = Joined("series", (Spring("J12.radial"), Spring("J33.radial")), (1.0, 4.0))
    outer = Joined("parallel", (inner, Spring("J18.radial")), (1.0, 2.0))
    values = {"J12.radial": 4e6, "J33.radial": 8e6, "J18.radial": 1e5}
    [one] = reduce_model(load_robot("ir663"), Degeneracy((), (outer,), ()), values, list(values)).lumped
    whole = 1 / (1 / 4e6 + 4 / 8e6) + 2e5
    assert one.kept == "J33.radial"  # half as stiff as seen from the whole
    assert one.value == pytest.approx(4 * whole)
    assert one.gone == {"J12.radial": np.inf, "J18.radial": 0.0}


def test_a_beam_is_not_lumped_away() -> None:
    group = Joined("series", (Spring("J12.radial"), Spring("arm.E")), (1.0, 1e3))
    with pytest.raises(BeamstiffError, match=r"arm\.E: only acts together"):
        reduce_model(
            load_robot("ir663"), Degeneracy((), (group,), ()), {"J12.radial": 1.0, "arm.E": 1e12}, ["arm.E"]
        )


def nested(seed: int) -> Robot:
    """Return a joint made of four and bypassed by a fifth: 1 and 4 in series with 2 beside 3."""
    random = np.random.default_rng(seed)
    hub, tool = random.uniform(-1, 1, (2, 3)).tolist()
    places = {"ground": [0, 0, 0], "a": hub, "b": hub, "c": hub, "d": hub, "tool": tool}
    axis = tuple(random.normal(size=3).tolist())
    both = ("torsional", "tilting")

    def joint(name: str, ends: tuple[str, str], rest: str, kinds: tuple[str, ...] = both) -> dict[str, Any]:
        values: dict[str, Any] = dict.fromkeys(("axial", "radial", *both), rest)
        values |= {kind: 10 ** random.uniform(5, 7) for kind in kinds}
        return {"name": name, "nodes": ends, "frame": "base", "axis": axis, "stiffness": values}

    parts: dict[str, Any] = {
        "nodes": [{"name": name, "at": tuple(at)} for name, at in places.items()],
        "rigids": [{"name": "post", "nodes": ("ground", "a")}, {"name": "arm", "nodes": ("d", "tool")}],
        "joints": [
            joint("j1", ("a", "b"), "rigid"),
            joint("j2", ("b", "c"), "rigid"),
            joint("j3", ("b", "c"), "free"),
            joint("j4", ("c", "d"), "rigid"),
            joint("j5", ("a", "d"), "free", ("tilting",)),
        ],
    }
    names = [f"j{number}.{kind}" for number in range(1, 5) for kind in both]
    return Robot(name="nested", **parts, fixed=["ground"], tcp="tool", identify=[*names, "j5.tilting"])


@pytest.mark.parametrize("seed", range(10))
def test_springs_in_series_within_springs_in_parallel_are_found_and_reduced(seed: int) -> None:
    robot = nested(seed)
    tests = make_measurements(
        [],
        np.zeros((6, 0)),
        tcp="tool",
        wrench=np.diag([1e3, 1e3, 1e3, 3e2, 3e2, 3e2]),
        displacement=np.zeros((6, 6)),
        sigma_position=3e-5,
        sigma_rotation=3e-5,
    )
    found = find_degeneracy(build_problem(robot, tests))
    assert (found.silent, found.mixed) == ((), ())
    assert {group.text() for group in found.joined} == {
        "1/j1.torsional + 1/j4.torsional + 1/(j2.torsional + j3.torsional)",
        "1/(1/j1.tilting + 1/j4.tilting + 1/(j2.tilting + j3.tilting)) + j5.tilting",
    }
    reduced = reduce_model(robot, found, {name: robot.parameter(name) for name in robot.identify})
    before, after = (predict_displacements(one, tests) for one in (robot, reduced.robot))
    assert np.abs(after - before).max() < 1e-9 * np.abs(before).max()
    assert len(reduced.robot.identify) == 2
