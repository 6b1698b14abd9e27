"""A verification counts a cause once, with all its shapes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.text import Text

import beamstiff
from beamstiff import Robot
from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.measured_torques import BESIDE_EFFECTS
from beamstiff.diagnosis.residual.baseline import nominal_pose, predict
from beamstiff.diagnosis.verify import verify
from beamstiff.diagnosis.without_effects import without_effects
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import concatenate, row_digests, subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.measure.writer import write_measurements
from beamstiff.report.tables import Table
from beamstiff.report.verification import verification_told, verification_verdict
from beamstiff.robot.reader import load_robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array, rotation_from_vector
from benchmarks.applied_effects import SIGMA, case_of, read, robot_of, rows_of
from tests.added import added


def played() -> Robot:
    """Return an arm with play in two shapes, one of which rounding made negative."""
    robot = load_robot("kr500")
    shapes = [("flank within 0.03", 2e-4), ("flank within 0.1", -6.7e-19)]
    play = [added("backlash:q2", shape, {"torque": 700.0}, half_width=value) for shape, value in shapes]
    return robot.model_copy(update={"effects": tuple(play)})


def fresh(robot: Robot) -> Measurements:
    rng = np.random.default_rng(0)
    q, wrench = rng.uniform(-0.5, 0.5, (8, len(robot.actuated))), np.zeros((8, 6))
    wrench[:, :3] = rng.uniform(-1000.0, 1000.0, (8, 3))
    names = [variable.name for variable in robot.actuated]
    rows = make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=np.zeros((8, 6)))
    return replace(rows, displacement=predict(robot, rows))


def test_a_cause_is_counted_with_all_its_shapes() -> None:
    robot = played()
    found = verify(robot, fresh(robot))
    ((name, after, closes),) = found.causes
    assert name == "backlash:q2"
    assert found.before > 1e-5
    assert after == found.after == pytest.approx(0.0, abs=1e-12)
    assert closes == found.true == pytest.approx(1.0)


def test_the_nominal_robot_is_compared_on_the_same_rows() -> None:
    """A rigid one predicts no displacement: all that was read is its error."""
    robot = played()
    rows = fresh(robot)
    rigid = load_robot("kr500")
    rigid = rigid.with_parameters(dict.fromkeys(stiffness_parameters(rigid), np.inf))
    found = beamstiff.verify(robot, rows, nominal=rigid)
    assert found.nominal == pytest.approx(np.sqrt((rows.displacement[:, :3] ** 2).sum() / len(rows)))
    first = next(
        row
        for shown in verification_told(found, "a", ["b"])
        if isinstance(shown, Table)
        for row in shown.rows
    )
    assert first[:2] == ["nominal robot, reflectors as in its file", f"{1e3 * found.nominal:.3f} mm"]


def test_a_nominal_robot_that_does_not_fit_the_rows_is_refused_by_name(tmp_path: Path) -> None:
    robot = load_robot("kr500")
    rows = fresh(robot)
    with pytest.raises(BeamstiffError, match="nominal: robot 'ir663': "):
        beamstiff.verify(robot, rows, nominal="ir663")
    names = [one.name for one in robot.actuated]
    turned = robot.model_copy(update={"variables": robot.variables[::-1]})
    assert [one.name for one in turned.actuated] == names[::-1]
    write_measurements(rows, tmp_path / "a.csv", robot)
    found = beamstiff.verify(robot, tmp_path / "a.csv", nominal=turned)
    assert found.nominal == pytest.approx(found.after, abs=1e-9)  # the joints in another order


def test_an_error_little_above_the_noise_may_be_noise_that_is_stated_too_small() -> None:
    found = verify(played(), fresh(played()))
    near, far = (replace(found, after=times * 2e-5, before=1e-3, noise=2e-5) for times in (1.8, 20.0))
    said = [verification_verdict(one, "a", ["b"]).action for one in (near, far)]
    assert "If the readings scatter by 0.021 mm per axis, this is noise" in said[0]
    assert "scatter" not in said[1]
    assert all("he model still lacks something" in one for one in said)


def test_what_a_diagnosis_could_not_explain_is_repeated_where_it_shows_again() -> None:
    robot = load_robot("kr500").model_copy(update={"unexplained": "q2 has play"})
    found = verify(robot, fresh(robot))
    large = replace(found, before=1e-3, after=1e-3, noise=2e-5)
    said = [verification_verdict(one, "a", ["b"]).action for one in (found, large)]
    assert ["which no effect explains: q2 has play. Mend that" in one for one in said] == [False, True]


def test_rows_that_were_fitted_are_counted() -> None:
    robot = played()
    rows = fresh(robot)
    assert verify(robot, rows).fitted == 0
    seen = robot.with_fitted_rows(row_digests(subset(rows, np.arange(5))))
    assert verify(seen, rows).fitted == 5
    read_again = replace(rows, displacement=rows.displacement + 1e-6)  # the same states, other readings
    assert verify(seen, read_again).fitted == 0
    rounded = replace(rows, displacement=rows.displacement + 1e-16)  # written and read in other units
    assert verify(seen, rounded).fitted == 5


def test_rows_that_were_fitted_say_to_measure_fresh_ones() -> None:
    robot = played().model_copy(
        update={"effects": tuple(e.model_copy(update={"closes": 0.9}) for e in played().effects[:1])}
    )
    rows = fresh(robot)
    some = robot.with_fitted_rows(row_digests(subset(rows, np.arange(5))))
    every = robot.with_fitted_rows(row_digests(rows))
    for seen, tests in ((some, True), (every, False)):
        found = verify(seen, rows)
        said = " ".join(
            str(one)
            for one in verification_told(found, "arm.yaml", ["rows.csv"])
            if isinstance(one, str | Text)
        )
        assert ("Use the robot within these postures" in said) == tests
        assert ("Next: Measure fresh postures" in said) != tests
        assert "Promised: 90 % of the gap closes." in said
        assert ("True: 100 %" in said) == tests


def test_no_more_than_the_whole_gap_is_promised_and_a_verification_shows_itself() -> None:
    effects = [effect.model_copy(update={"closes": 0.7}) for effect in played().effects]
    robot = played().model_copy(update={"effects": tuple(effects)})
    found = verify(robot, fresh(robot))
    assert found.promised == found.to_dict()["promised"] == 1.0
    assert repr(found).startswith("<Verification: Position error 0")
    for shown in (str(found), found._repr_html_()):
        assert "with backlash at q2" in shown
        assert "Promised: 100 % of the gap closes. True: 100 %." in shown
        assert "ROWS" not in shown
    assert "Mind: careful" in str(replace(found, notes=("careful",)))


def test_rows_before_a_joint_moved_do_not_count_but_where_there_are_no_others() -> None:
    robot = load_robot("kr240-2")
    effect = added("approach-direction:q2", "direction of the last motion", half_lost_motion=1e-3)
    q = np.array([0.0, -1.0, 1.5, 0.0, 0.5, 0.0]) + np.random.default_rng(4).uniform(-0.5, 0.5, (12, 6))
    names = [one.name for one in robot.actuated]
    plan = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((12, 3)))
    real = robot.model_copy(update={"effects": (effect,)})
    rows = replace(plan, position=nominal_pose(robot, plan)[0] + predict(real, plan)[:, :3])
    rows.position[0] += 2e-3
    found = verify(real, rows)
    said = f"left out: {rows.place(0)}: the rows do not say from which side the joints came"
    assert (found.rows, found.notes) == (11, (said,))
    assert found.after < 1e-9
    alone = verify(real, subset(rows, np.arange(1)))
    assert (alone.rows, alone.notes) == (1, ())
    assert alone.after == pytest.approx(2e-3 * np.sqrt(3.0), rel=1e-6)


def test_an_axis_that_was_not_read_leaves_the_others_of_its_row() -> None:
    """The tracker stands elsewhere; the robot is as described, and its readings are exact but for that."""
    robot = load_robot("kr240-2")
    q = np.array([0.0, -1.0, 1.5, 0.0, 0.5, 0.0]) + np.random.default_rng(2).uniform(-0.5, 0.5, (12, 6))
    names = [one.name for one in robot.actuated]
    plan = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((12, 3)))
    there = (nominal_pose(robot, plan)[0] + predict(robot, plan)[:, :3]) @ rotation_from_vector(
        np.array([0.1, -0.2, 0.7])
    ) + [1.0, 2.0, 3.0]
    there[2, 1] = np.nan
    found = verify(robot, replace(plan, position=there), refit_frame=True)
    assert found.after < 1e-9
    assert found.rows == 12
    np.testing.assert_allclose(found.base, [1.0, 2.0, 3.0, -0.1, 0.2, -0.7], atol=1e-9)
    assert "base stands at (1000.000, 2000.000, 3000.000) mm" in " ".join(
        one for one in verification_told(found, "a", ["b"], True) if isinstance(one, str)
    )
    there[2, 0] += 1e-3
    off = verify(robot, replace(plan, position=there), refit_frame=True)
    assert off.after == pytest.approx(1e-3 / np.sqrt(12.0), rel=1e-6)


# A robot that has effects already, on absolute readings in the frame of a tracker


TURN, SHIFT = rotation_from_vector(np.array([0.4, -1.1, 2.0])), np.array([3.0, -1.5, 0.7])
COMPLIANCE = added("joint-compliance:q3", "linear", {"torque": 1e3}, compliance=1e-6)


def through_a_tracker(rows: Measurements, noise: float = 0.0) -> Measurements:
    """Return absolute rows as a tracker that stands elsewhere reads them."""
    random = np.random.default_rng(1).standard_normal(rows.position.shape)
    return replace(rows, position=rows.position @ TURN.T + SHIFT + noise * random)


@pytest.fixture(scope="module")
def machine() -> Robot:
    """Return a machine with play, as a diagnosis writes it."""
    return case_of("kr240-2", "backlash").robot


def seen(machine: Robot, noise: float = 0.0) -> Measurements:
    return through_a_tracker(read(machine, rows_of("kr240-2", True, seed=5)), noise)


def test_readings_lose_their_effects_in_whatever_frame_they_are(machine: Robot) -> None:
    bare, left = without_effects(machine, seen(machine))
    expected = seen(robot_of("kr240-2"))
    assert not bare.effects
    assert np.abs(seen(machine).position - expected.position).max() > 1e-4
    np.testing.assert_allclose(left.position, expected.position, atol=1e-9)


def test_each_table_may_have_a_frame_of_its_own(machine: Robot) -> None:
    near, far = read(machine, rows_of("kr240-2", True, seed=5)), seen(machine)
    both = concatenate([near, far])
    _, left = without_effects(machine, both, stations=True)
    bare: Array = read(robot_of("kr240-2"), rows_of("kr240-2", True, seed=5)).position
    np.testing.assert_allclose(left.position[both.run == 0], bare, atol=1e-9)
    np.testing.assert_allclose(left.position[both.run == 1], bare @ TURN.T + SHIFT, atol=1e-9)


def test_a_second_diagnosis_of_the_readings_finds_nothing(machine: Robot) -> None:
    rows = seen(machine, SIGMA)
    torque = np.random.default_rng(2).standard_normal(rows.q.shape)
    found = beamstiff.diagnose(machine, replace(rows, torque=torque))
    assert found.verdict.effect == "none"
    assert BESIDE_EFFECTS in found.notes  # torques are those of a machine without effects
    assert found.known == machine.effects
    assert extended(found).effects == machine.effects


def test_what_is_missing_beside_the_effects_is_found_and_added(machine: Robot) -> None:
    more = machine.model_copy(update={"effects": (*machine.effects, COMPLIANCE)})
    rigid = machine.with_parameters({"J3.torsional": np.inf}).model_copy(update={"identify": ()})
    found = beamstiff.diagnose(rigid, seen(more.with_parameters({"J3.torsional": np.inf}), SIGMA))
    assert found.verdict.key == "joint-compliance:q3"
    assert [one.effect for one in extended(found).effects] == ["backlash", "joint-compliance"]


def test_a_frame_that_is_off_is_told_from_a_robot_that_is_off(machine: Robot) -> None:
    rows = seen(machine, SIGMA)
    off = verify(machine, rows)
    assert off.after > 1.0
    assert off.other_frame == pytest.approx(verify(machine, rows, refit_frame=True).after)
    assert off.to_dict()["true"] is None
    head = verification_verdict(off, "arm.yaml", ["rows.csv"]).headline
    assert head.startswith("These rows are not in the robot's base frame: position error ")
    assert "--refit-frame" in head
    near = read(machine, rows_of("kr240-2", True, seed=5))
    assert verify(robot_of("kr240-2"), near).other_frame is None  # the machine's play is no frame
    assert verify(machine, replace(rows, sigma=np.full_like(rows.sigma, 10.0))).other_frame is None


@pytest.mark.parametrize("refit", [False, True])
def test_a_reflector_that_was_mounted_anew_is_told_from_effects_that_fail(
    machine: Robot, refit: bool
) -> None:
    rows = read(machine, rows_of("kr240-2", True, seed=5))
    noise = SIGMA * np.random.default_rng(4).standard_normal(rows.position.shape)
    rows = seen(machine, SIGMA) if refit else replace(rows, position=rows.position + noise)
    by = {f"{machine.tcp}.x": 3e-3, f"{machine.tcp}.y": -2e-3, f"{machine.tcp}.z": 1e-3}
    elsewhere = corrected(machine, by, rows.q[:1])
    found = verify(elsewhere, rows, refit_frame=refit)
    ((name, moved),) = found.moved_points
    assert name == machine.tcp
    np.testing.assert_allclose(moved, (-3e-3, 2e-3, -1e-3), atol=3e-5)
    assert found.placed == pytest.approx(verify(machine, rows, refit_frame=refit).after, rel=0.1)
    told = verification_verdict(found, "arm.yaml", ["rows.csv"])
    assert told.headline.startswith(f"{machine.tcp} does not sit where the robot file says: position error ")
    assert "beamstiff calibrate arm.yaml rows.csv --parameters base,target --out NEW" in told.action
    assert not verify(machine, rows, refit_frame=refit).moved_points


def test_effects_that_hardly_change_rows_are_not_what_is_wrong_with_them() -> None:
    off = replace(verify(played(), fresh(played())), before=1e-3, noise=2e-5, true=-0.02)
    little, more = (
        verification_verdict(replace(off, after=after), "a", ["b"]).headline for after in (1.01e-3, 1.1e-3)
    )
    assert little.startswith("Position error 1.0 mm with the file's effects, 50.5 times the noise")
    assert more.startswith("The file's effects make these rows worse")


def test_a_row_that_is_far_off_all_others_is_named() -> None:
    robot = played()
    rows = fresh(robot)
    rng = np.random.default_rng(1)
    displacement = rows.displacement + rng.normal(0.0, 1e-5, rows.displacement.shape)
    assert verify(robot, replace(rows, displacement=displacement)).notes == ()
    displacement[3, 0] += 1e-2
    (told,) = verify(robot, replace(rows, displacement=displacement)).notes
    assert told.startswith(f"{rows.place(3)} (10 mm) is off")
