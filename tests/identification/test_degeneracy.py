"""Springs that only act together are found, on random graphs by construction and on the papers' robots."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.identification.degeneracy import find_degeneracy
from beamstiff.identification.identify import identify
from beamstiff.identification.problem import build_problem
from beamstiff.model.linear import predict_displacements
from benchmarks.degeneracy_graphs import faults, random_case
from benchmarks.degeneracy_study import (
    CAMPAIGNS,
    JOINTS,
    campaign,
    expected,
    in_plane,
    loads_of,
    poses_of,
    with_bearings,
    wrist,
)

Groups = set[frozenset[str]]


def groups(name: str) -> tuple[Groups, str]:
    """Return the groups of an IR-663 under forces along x and z, and what else there is."""
    found = in_plane(name)
    assert not found.silent
    assert {group.kind for group in found.joined} == {"series"}
    return {frozenset(group.members) for group in found.joined}, str(found.mixed)


def radial(*joints: str) -> frozenset[str]:
    return frozenset(f"{joint}.radial" for joint in joints)


@pytest.mark.parametrize("planted", [True, False])
def test_groups_are_exact_on_random_graphs(planted: bool) -> None:
    wrong, count = {}, 0
    for seed in range(80):
        case = random_case(seed, planted)
        count += len(case.series) + len(case.parallel)
        found = find_degeneracy(build_problem(case.robot, case.tests))
        if fault := faults(case, found):
            wrong[seed] = fault
    assert wrong == {}
    assert count > 80 if planted else count == 0


def test_bearings_of_the_ir663_act_in_series_as_the_paper_says() -> None:
    # seed 003: 1/K12eq = 1/K12 + 1/K33', 1/K18eq = 1/K18 + 1/K99' + 1/K1010'
    assert groups("ir663") == ({radial("J12", "J33"), radial("J18", "J99", "J1010")}, "()")


def test_screws_load_the_bearings_at_the_column_with_forces_of_their_own() -> None:
    assert groups("ir663-screws") == ({radial("J99", "J1010")}, "()")


def test_the_sum_in_series_is_known_though_no_term_is() -> None:
    robot = load_robot("ir663")
    names = ["J12.torsional", "J18.torsional", *(f"{joint}.radial" for joint in JOINTS)]
    tests = campaign(robot, poses_of(robot), loads_of(("x", "z")), components="position")
    start = robot.with_parameters({name: 3 * robot.parameter(name) for name in names})
    found = identify(start, tests, names)
    [_, coupler] = found.degenerate
    assert coupler.relation == "1/J18.radial + 1/J99.radial + 1/J1010.radial"
    truth = sum(1 / robot.parameter(name) for name in coupler.parameters)
    assert abs(coupler.value - truth) < 3 * coupler.std
    assert coupler.std < 0.1 * truth
    for name in coupler.parameters:
        assert found[name].value is None
        assert 0 < found[name].lower_bound <= 1 / truth
        assert "acts only together with" in found[name].reason


def test_loads_out_of_the_plane_tell_axial_stiffness_in_sums_and_some_tilting() -> None:
    names = ("x, z", "x, y, z", "with moments, rotations read")
    plane, along_y, best = (expected(*CAMPAIGNS[name]) for name in names)
    for joint in JOINTS:
        assert plane[f"{joint}.axial"] == plane[f"{joint}.tilting"] == np.inf
        assert f"{joint}.axial" not in best
    assert {"1/J12.axial + 1/J33.axial", "1/J18.axial + 1/J99.axial + 1/J1010.axial"} < set(best)
    well = {name for name, std in best.items() if ".tilting" in name and std < 0.2}
    assert well == {"J12.tilting", "J33.tilting"}
    # forces along y alone, positions read: felt, but nothing is bounded
    assert all(std > 1 for name, std in along_y.items() if "tilting" in name)


@pytest.mark.parametrize("name", ["kr500", "kr240-2"])
def test_joints_4_and_6_are_one_spring_at_the_wrist_singularity(name: str) -> None:
    robot, found = load_robot(name), wrist(name, 0.0)
    [both] = found.degenerate
    assert both.relation == "1/J4.torsional + 1/J6.torsional"
    truth = sum(1 / robot.parameter(name) for name in both.parameters)
    assert abs(both.value - truth) < 3 * both.std
    assert [item.name for item in found.parameters if not item.identifiable] == list(both.parameters)


@pytest.mark.parametrize("name", ["kr500", "kr240-2"])
def test_near_the_singularity_they_are_ill_determined_and_said_to_be(name: str) -> None:
    robot, found = load_robot(name), wrist(name, np.radians(0.5))
    assert found.degenerate == ()
    [both] = found.ill_determined
    assert both.parameters == ("J4.torsional", "J6.torsional")
    truth = sum(1 / robot.parameter(name) for name in both.parameters)
    assert both.value == pytest.approx(truth, rel=0.05)
    assert both.std < 0.02 * both.value
    for parameter in both.parameters:
        assert found[parameter].value is None
    assert found.to_dict()["ill_determined"][0]["kind"] == "ill-determined"


def test_away_from_the_singularity_nothing_is_said_of_them() -> None:
    found = wrist("kr240-2", np.radians(30))
    assert (found.degenerate, found.ill_determined) == ((), ())
    assert all(item.identifiable for item in found.parameters)


def test_a_search_along_a_flat_valley_ends_with_what_is_known() -> None:
    # forces alone hardly feel which bearing tilts: a thousand steps more would change nothing that is known
    actual, names = with_bearings()
    tests = campaign(actual, poses_of(actual, 12), loads_of(("x", "y", "z")), components="position")
    doubled = {name: 2 * actual.parameter(name) for name in names if "axial" in name or "tilting" in name}
    found = identify(actual.with_parameters(doubled), tests, names, folds=0)
    assert "gained nothing beside the noise" in found.message
    assert found.evaluations < 500
    assert found.chi_square < 1.3
    for name in ("J12.torsional", "J18.torsional"):
        item = found[name]
        assert abs(item.value - actual.parameter(name)) < 3 * item.std
    assert not any(found[name].identifiable for name in names if "tilting" in name or "axial" in name)


@pytest.mark.parametrize("softer", [1.0, 1e-2, 1e-4])
def test_a_start_of_what_a_group_cannot_tell_does_not_spoil_the_fit(softer: float) -> None:
    # Z.axial, Z.radial and screw_y with Y.radial: three sums of four springs
    robot = load_robot("gantry")
    names = ["Z.axial", "Z.radial", "screw_y", "Y.radial"]
    tests = campaign(robot, poses_of(robot, 15), np.diag([900.0, 900, 900, 300, 300, 300]))
    [group] = find_degeneracy(build_problem(robot, tests, names)).mixed
    assert set(group.members) == set(names)
    values = {name: robot.parameter(name) for name in names}
    start = robot.with_parameters({name: softer * values[name] for name in group.held})
    found = identify(start, tests, names, folds=0)
    assert found.chi_square < 1.1
    truth = [total.value(values) for total in group.sums]
    for known, value in zip(found.degenerate, truth, strict=True):
        assert abs(known.value - value) < 3 * known.std
    assert not any(item.identifiable for item in found.parameters)
    again = predict_displacements(found.robot, tests)
    assert np.abs(again - found.predicted).max() < 1e-9 * np.abs(again).max()
