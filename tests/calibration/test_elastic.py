"""Geometry and compliances in one estimate, on loaded and unloaded absolute poses under gravity."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, calibrate, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.elastic import build_elastic, elastic_displacement, is_compliant
from beamstiff.calibration.validation import errors_on
from beamstiff.diagnosis.residual.baseline import nominal_pose, predict
from beamstiff.measure.rows import concatenate
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.se3 import Array
from tests.calibration.machines import JOINTS, SIGMA, machine, machined, measured, serial, within

SOFT = serial(stiff=False)
STIFFNESS = {name: SOFT.parameter(name) * (0.6 + 0.15 * at) for at, name in enumerate(JOINTS)}
REAL = machine(SOFT, machined(SOFT, 3)).with_parameters(STIFFNESS)


def loaded(count: int, seed: int, size: float = 1000.0) -> dict[str, Array]:
    wrench = np.zeros((count, 6))
    wrench[:, :3] = size * np.random.default_rng(seed).standard_normal((count, 3))
    return {"q": within(SOFT, count, seed), "wrench": wrench}


def test_the_displacement_is_that_of_the_diagnosis() -> None:
    rows = measured(SOFT, **loaded(10, 1))
    expected = predict(SOFT, rows)
    assert elastic_displacement(SOFT, rows) == pytest.approx(expected, abs=1e-15)
    assert np.abs(expected[:, :3]).max() > 1e-3
    assert not elastic_displacement(serial(), rows).any()
    assert is_compliant(SOFT)
    assert not is_compliant(serial())


def test_its_derivatives_are_those_by_compliance() -> None:
    rows = measured(SOFT, **loaded(6, 2))
    elastic = build_elastic(SOFT, rows, JOINTS)
    here = np.array([1 / SOFT.parameter(name) for name in JOINTS])
    assert elastic.displacement(here) == pytest.approx(elastic_displacement(SOFT, rows), abs=1e-12)
    for at in range(6):
        step = 1e-3 * here * np.eye(6)[at]
        change = (elastic.displacement(here + step) - elastic.displacement(here - step)) / (2 * step[at])
        assert elastic.columns(here)[:, :, at] == pytest.approx(change, rel=1e-6, abs=1e-3)


def test_weight_turns_no_vertical_axis() -> None:
    start = SOFT.model_copy(update={"unmeasured": ("J2.torsional",)})  # which weight does touch
    found = calibrate(start, measured(REAL, within(SOFT, 25, 5)), compliances=JOINTS[:3], folds=0)
    assert found.robot.unmeasured == ("J1.torsional",)
    assert found.robot.parameter("J1.torsional") == pytest.approx(SOFT.parameter("J1.torsional"))


def test_sag_spoils_a_calibration_of_geometry_alone_and_compliances_mend_it() -> None:
    rows = concatenate([measured(REAL, **loaded(25, 4)), measured(REAL, within(SOFT, 25, 5), seed=1)])
    fresh = measured(REAL, **loaded(200, 6), seed=2)
    alone = errors_on(calibrate(serial(), rows, folds=0), fresh).position_mean
    assert alone > 1e-3
    for start in (SOFT, serial()):  # from wrong values, and from rigid joints
        found = calibrate(start, rows, compliances=JOINTS, folds=0)
        errors = errors_on(found, fresh)
        assert errors.position_mean < 6.5e-5
        assert found.noise == pytest.approx(1.0, abs=0.2)
        for item in found.compliances:
            assert abs(item.value - 1 / STIFFNESS[item.name]) < 4 * item.std
            assert found.robot.parameter(item.name) == pytest.approx(1 / item.value, rel=1e-6)


def test_a_stiffness_of_the_robot_counts_without_being_sought() -> None:
    rows = measured(REAL, **loaded(50, 7), base=None)
    known = SOFT.with_parameters(STIFFNESS)
    found = calibrate(known, rows, folds=0)
    assert found.noise == pytest.approx(1.0, abs=0.25)
    assert found.compliances == ()
    assert calibrate(SOFT, rows, folds=0).noise > 5


def test_a_joint_that_does_not_give_way_is_as_good_as_rigid() -> None:
    real = REAL.with_parameters({"J3.torsional": np.inf})
    found = calibrate(SOFT, measured(real, **loaded(50, 8)), compliances=JOINTS, folds=0)
    item = found["J3.torsional"]
    assert 0 <= item.value < 3 * item.std
    if item.value == 0.0:
        assert found.robot.parameter("J3.torsional") == np.inf


def test_a_compliance_that_would_be_negative_is_none_and_written_as_rigid() -> None:
    rows = measured(SOFT, **loaded(40, 8), noise=0.0, stated=False)
    # more than the springs give: what moves against the load is no compliance
    against = replace(rows, position=rows.position - 1.2 * elastic_displacement(SOFT, rows)[:, :3])
    found = calibrate(SOFT, against, ["base"], compliances=JOINTS[:3], folds=0)
    fallen = [item.name for item in found.compliances if item.value == 0.0]
    assert fallen
    assert all(found.robot.parameter(name) == np.inf for name in fallen)
    assert not set(fallen) & set(found.robot.identify)
    assert f"{', '.join(fallen)}: no compliance shows" in found.notes[-1]
    assert parse_robot(robot_to_yaml(found.robot)) == found.robot


def test_a_joint_that_is_free_has_no_compliance_to_estimate() -> None:
    rows = measured(BAR, bar_poses(20))
    with pytest.raises(BeamstiffError, match=r"J33.torsional is free: there is no compliance"):
        calibrate(BAR, rows, compliances=["J33.torsional"])


def test_what_nothing_loads_is_held_and_named() -> None:
    rows = measured(REAL, within(SOFT, 40, 9))  # gravity alone, axis 1 upright
    found = calibrate(SOFT, rows, compliances=JOINTS, folds=0)
    assert [item.name for item in found.compliances] == list(JOINTS[1:])
    assert any("nothing loads J1.torsional" in note for note in found.notes)
    assert found.robot.parameter("J1.torsional") == SOFT.parameter("J1.torsional")


def bar_poses(count: int) -> Array:
    """Return joint values (P, 2) of the four-bar about the middle of its workspace."""
    spread = np.random.default_rng(1).uniform(-1, 1, (count, 2))
    return np.array([0.1, 0.8]) + np.array([0.4, 0.25]) * spread


BAR = load_robot("ir663")
BAR_ERRORS = {"q2": 1e-3, "q8": -2e-3, "f3.d": 5e-4, "f9.d": 3e-4, "f11.d": -6e-4, "f1.r": 1e-3, "f2.d": 4e-4}


def test_a_four_bars_compliances_are_found_with_its_geometry() -> None:
    names = ["J12.torsional", "J18.torsional", "J1010.radial"]
    truth = {name: BAR.parameter(name) * by for name, by in zip(names, (0.6, 0.8, 0.7), strict=True)}
    real = corrected(BAR, BAR_ERRORS, bar_poses(1)).with_parameters(truth)
    wrench = np.zeros((50, 6))
    wrench[:, :3] = 1000 * np.random.default_rng(0).standard_normal((50, 3))
    found = calibrate(BAR, measured(real, bar_poses(50), wrench=wrench), compliances=names, folds=0)
    assert found.noise == pytest.approx(1.0, abs=0.15)
    for item in found.compliances:
        assert abs(item.value - 1 / truth[item.name]) < 4 * item.std
        assert item.std < 0.05 * item.value


@pytest.mark.parametrize(
    ("robot", "errors", "q"),
    [(SOFT, machined(SOFT, 1), within(SOFT, 8, 1)), (BAR, BAR_ERRORS, bar_poses(8))],
    ids=["kr500", "ir663"],
)
def test_the_robot_found_is_whole_and_written_and_read_back(
    robot: Robot, errors: dict[str, float], q: Array
) -> None:
    built = corrected(robot, errors, q)
    again = parse_robot(robot_to_yaml(built))
    assert again == built
    rows = replace(measured(robot, q), wrench=np.full((8, 6), 100.0))
    moved = elastic_displacement(built, rows)  # joints' nodes coincide in every pose, or this is refused
    before = elastic_displacement(robot, rows)
    assert np.abs(moved - before).max() < 0.02 * np.abs(before).max()
    assert nominal_pose(built, rows)[0] == pytest.approx(nominal_pose(again, rows)[0], abs=1e-12)
    assert np.abs(nominal_pose(built, rows)[0] - nominal_pose(robot, rows)[0]).max() > SIGMA
    back = corrected(built, {name: -by for name, by in errors.items()}, q)
    assert nominal_pose(back, rows)[0] == pytest.approx(nominal_pose(robot, rows)[0], abs=1e-12)


def test_a_drive_is_no_softer_than_what_it_carries_in_other_postures_allows() -> None:
    """Rows in which a wrist hangs straight hardly load it: by these alone it could have any softness."""
    q = within(SOFT, 30, 5)
    q[:, 4] *= 1e-4
    hanging, others = measured(REAL, q), measured(REAL, within(SOFT, 200, 6))
    elastic = build_elastic(SOFT, hanging, JOINTS[1:])
    here = 1e3 * np.abs(elastic.columns(elastic.size)).max(axis=(0, 1)) * elastic.size
    anywhere = build_elastic(SOFT, others, JOINTS[1:], elastic.size)
    there = 1e3 * np.abs(anywhere.columns(elastic.size)).max(axis=(0, 1)) * elastic.size
    assert (here < 1.0 + 1e-9).all()
    assert here.min() < 0.5  # mm: by what these rows show alone it could be twice as soft and more
    assert (there < 1.5).all()
