"""Calibrations against planted errors: what is found, how sure it is, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, calibrate, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.validation import errors_on, gap_of, in_base_frame
from beamstiff.measure.rows import concatenate, subset
from beamstiff.measure.table import make_measurements
from beamstiff.se3 import rotation_from_vector, transform, vector_from_rotation
from tests.calibration.machines import (
    JOINTS,
    SIGMA,
    four_bar,
    four_bar_poses,
    machine,
    machined,
    measured,
    serial,
    variables,
    within,
)

BASE = transform(rotation_from_vector(np.array([0.3, -0.2, 2.5])), np.array([3.0, -2.0, 0.5]))
TARGET = rotation_from_vector(np.array([0.5, 1.0, -0.4]))
REAL = machine(serial(), machined(serial(), 3) | {"ball.x": 2e-3, "ball.y": -1e-3, "ball.z": 1e-3})


def test_exact_readings_are_explained_exactly() -> None:
    rows = measured(REAL, within(serial(), 40, 1), noise=0.0, base=BASE, stated=False)
    found = calibrate(serial(), rows, folds=0)
    assert found.message == "converged"
    assert found.after.position_max == pytest.approx(0, abs=1e-10)
    fresh = measured(REAL, within(serial(), 50, 2), noise=0.0, base=BASE)
    assert errors_on(found, fresh).position_max == pytest.approx(0, abs=1e-8)
    assert found.before.position_mean > 1e-3


def test_poses_are_as_good_and_the_target_may_be_turned() -> None:
    rows = measured(
        REAL, within(serial(), 30, 1), noise=0.0, base=BASE, target=TARGET, turned=True, stated=False
    )
    found = calibrate(serial(), rows, folds=0)
    assert len(found.identifiability.identified) == 30
    fresh = measured(REAL, within(serial(), 50, 2), noise=0.0, base=BASE, target=TARGET, turned=True)
    errors = errors_on(found, fresh)
    assert errors.position_max == pytest.approx(0, abs=1e-8)
    assert errors.orientation_max == pytest.approx(0, abs=1e-8)


def test_single_errors_in_the_base_frame_are_named_and_sized() -> None:
    planted = {"q2": 1e-3, "f3.d": 5e-4, "f4.alpha": -8e-4, "ball.z": 2e-3}
    rows = measured(machine(serial(), planted), within(serial(), 50, 4))
    found = calibrate(serial(), rows, [*planted, "q3", "f5.d"])
    for item in found.parameters:
        assert abs(item.change - planted.get(item.name, 0.0)) < 4 * item.std
    assert found["f3.d"].value == pytest.approx(1.3005, abs=1e-4)
    assert found["f3.d"].nominal == 1.3
    assert found["q2"].nominal == 0.0
    assert found["f4.alpha"].nominal == pytest.approx(-np.pi / 2)


def test_a_point_tracker_with_50_poses_predicts_fresh_ones_to_0_057_mm_and_quickly() -> None:
    held = []
    for seed in range(4):
        real = machine(serial(), machined(serial(), 10 + seed))
        rows = measured(real, within(serial(), 50, seed), seed=seed)
        found = calibrate(serial(), rows, folds=0)
        assert len(found.identifiability.identified) == 27
        fresh = measured(real, within(serial(), 200, 50 + seed), seed=50 + seed)
        held.append(errors_on(found, fresh).position_mean)
    assert np.mean(held) < 5.7e-5


def test_standard_deviations_are_those_of_repeated_campaigns() -> None:
    names = ["q2", "q3", "q4", "f3.d", "f4.d", "f4.alpha", "base.x", "base.rz"]
    scores = []
    for seed in range(50):
        rows = measured(REAL, within(serial(), 20, seed), seed=seed)
        found = calibrate(REAL, rows, names, folds=0)
        scores.append([item.change / item.std for item in found.parameters if item.std])
    assert np.std(scores) == pytest.approx(1.0, abs=0.1)
    assert np.abs(np.mean(scores, axis=0)).max() < 0.5


def test_noise_that_is_not_stated_is_read_from_what_is_left() -> None:
    rows = measured(REAL, within(serial(), 60, 5), noise=2e-4, stated=False)
    stated = replace(rows, sigma=np.where(rows.measured_mask, 2e-4, np.nan))
    one, other = calibrate(serial(), rows, folds=0), calibrate(serial(), stated, folds=0)
    assert not one.claimed
    assert one.noise * 3e-5 == pytest.approx(2e-4, rel=0.15)
    assert one["q2"].std == pytest.approx(other["q2"].std, rel=0.15)


def test_a_model_that_lacks_something_is_told_by_its_stated_noise() -> None:
    rows = measured(REAL, within(serial(), 60, 5), noise=10 * SIGMA)
    found = calibrate(serial(), rows, folds=0)
    assert found.noise == pytest.approx(10, rel=0.2)
    assert "the model is incomplete" in found.notes[-1]


def test_a_robot_off_by_more_than_is_realistic_is_sought_in_full_though_the_noise_is_large() -> None:
    """Errors of some 10 mm and 10 mrad, read to 2 mm: nothing that shows beyond the noise is held."""
    noise = 2e-3
    real = machine(serial(), machined(serial(), 3, size=1e-2))
    rows = measured(real, within(serial(), 60, 1), noise=noise, base=BASE)
    rows = replace(rows, sigma=rows.sigma * noise / SIGMA, sigma_position=noise)
    found = calibrate(serial(), rows, folds=0)
    assert found.noise == pytest.approx(1.0, abs=0.15)
    exact = measured(real, within(serial(), 200, 2), noise=0.0, base=BASE)
    assert errors_on(found, exact).position_rms < 1.2 * noise


def test_held_out_errors_are_those_of_fresh_poses() -> None:
    rows = measured(REAL, within(serial(), 60, 6), base=BASE)
    found = calibrate(serial(), rows, folds=10)
    fresh = errors_on(found, measured(REAL, within(serial(), 300, 7), base=BASE, seed=1))
    assert found.held_out.position_rms == pytest.approx(fresh.position_rms, rel=0.2)
    assert found.after.position_rms < found.held_out.position_rms
    assert calibrate(serial(), rows, folds=0).held_out is None


@pytest.mark.parametrize(("noise", "off"), [(3e-3, 0.0), (3e-3, 3e-4), (3e-3, 1e-3), (1e-3, 1e-3)])
def test_noise_that_is_stated_far_too_small_is_not_taken_for_geometry(noise: float, off: float) -> None:
    """Of few poses and many parameters what is known beforehand counts beside what the readings scatter.

    Fresh poses, without noise, come out no worse than by the robot as described: six machines each, whose
    lengths, angles and zeros are `off` by so much. Without the prior: 1.3 to 8 times as far off as described
    at 3 mm.
    """
    described, calibrated = [], []
    for seed in range(6):
        real = machine(serial(), machined(serial(), seed, off))
        seen = measured(real, within(serial(), 15, 50 + seed), noise=noise, base=BASE, seed=seed)
        fresh = measured(real, within(serial(), 100, 90 + seed), noise=0.0, base=BASE)
        placed = calibrate(serial(), seen, ["base", "ball"], folds=0)
        found = calibrate(serial(), seen, folds=0)
        assert noise / SIGMA / 2 < found.noise < 1.5 * noise / SIGMA
        described.append(errors_on(placed, fresh).position_rms)
        calibrated.append(errors_on(found, fresh).position_rms)
    assert np.mean(calibrated) < 1.05 * np.mean(described)


def test_noise_that_is_stated_right_leaves_the_estimate_to_the_readings() -> None:
    """By the prior they would be pulled: weighted least squares, solved here, and its covariance."""
    rows = measured(REAL, within(serial(), 60, 6), base=BASE)
    found = calibrate(serial(), rows, folds=0)
    problem = found.statement.problem
    theta = np.array([item.change for item in found.parameters])
    sought = [item.identified for item in found.parameters]
    residual, jacobian = problem.linearised(problem.expected + theta)
    assert np.abs(np.linalg.pinv(jacobian[:, sought]) @ residual / problem.size[sought]).max() < 1e-4
    covariance = np.linalg.pinv(jacobian[:, sought].T @ jacobian[:, sought], rcond=1e-14)
    assert found.covariance[np.ix_(sought, sought)] == pytest.approx(covariance, rel=1e-3, abs=1e-14)


def test_a_calibration_that_makes_held_out_poses_worse_than_as_described_says_so() -> None:
    """A robot as described: whatever is fitted beside base and reflector, also left out, is noise."""
    few = calibrate(serial(), measured(serial(), within(serial(), 13, 6), base=BASE), folds=13)
    assert "do not use this calibration" in few.notes[-1]
    enough = calibrate(serial(), measured(REAL, within(serial(), 60, 6), base=BASE), folds=6)
    assert not any("do not use" in note for note in enough.notes)


def test_readings_of_one_pose_are_held_out_together_though_the_encoders_tremble() -> None:
    # each pose has an error of its own, common to its four rows: whoever fits three of them knows the fourth
    q, common = np.repeat(within(serial(), 14, 6), 4, axis=0), np.repeat(np.arange(14), 4)
    seen = measured(REAL, q, noise=0.0, base=BASE)
    shift = 1e-4 * np.random.default_rng(3).standard_normal((14, 3))[common]
    rows = replace(seen, position=seen.position + shift, pose=common.astype(np.int64))
    tremble = 1e-10 * np.random.default_rng(4).standard_normal(q.shape)
    still, moving = (calibrate(serial(), one).held_out for one in (rows, replace(rows, q=q + tremble)))
    assert moving.position_rms == pytest.approx(still.position_rms, rel=1e-3)


def test_several_reflectors_share_one_geometry() -> None:
    q = within(serial(), 20, 8)
    rows = concatenate([measured(REAL, q, point=point, base=BASE) for point in ("ball", "other")])
    found = calibrate(serial(), rows)
    assert {"ball.x", "other.x"} <= set(found.identifiability.identified)
    assert found.noise == pytest.approx(1.0, abs=0.25)
    for point in ("ball", "other"):
        fresh = measured(REAL, within(serial(), 100, 9), point=point, base=BASE)
        assert errors_on(found, fresh).position_rms == pytest.approx(1.732 * SIGMA, rel=0.3)


def test_a_reflector_guessed_on_the_last_axis_hides_nothing_in_the_end() -> None:
    """Guessed there it does not move with the last joint, whose zero seems unobservable until it is found."""
    real = serial()
    there = {"ball.x": -0.05, "ball.y": -0.02}
    guessed = corrected(real, there, within(real, 1, 0))
    rows = measured(real, within(real, 60, 1))
    off = calibrate(real, rows, folds=0).identifiability.identified
    found = calibrate(guessed, rows, folds=0)
    assert set(found.identifiability.identified) == set(off)
    moved = {one.name: one.change for one in found.parameters}
    assert [moved["ball.x"], moved["ball.y"]] == pytest.approx([0.05, 0.02], abs=2e-3)
    whole = calibrate(guessed, rows, parameters=["base", "ball"], folds=0).identifiability.names
    assert {"ball.x", "ball.y", "ball.z"} <= set(whole)


def test_tables_from_several_stations_share_one_geometry() -> None:
    other = transform(rotation_from_vector(np.array([0.0, 0.1, -2.0])), np.array([-1.0, 4.0, 0.2]))
    tables = [
        measured(REAL, within(serial(), 25, seed), base=base, seed=seed)
        for seed, base in ((1, BASE), (2, other))
    ]
    found = calibrate(serial(), tables, stations=True)
    assert found.noise == pytest.approx(1.0, abs=0.25)
    assert found.bases.shape == (2, 4, 4)
    for station, base in enumerate((BASE, other)):
        fresh = measured(REAL, within(serial(), 100, 9), base=base, seed=9)
        assert errors_on(found, fresh, station).position_rms == pytest.approx(1.732 * SIGMA, rel=0.3)
    moved = in_base_frame(found, concatenate(tables))
    assert np.nanmax(np.abs(gap_of(found.robot, moved))) < 6 * SIGMA
    wrong = calibrate(serial(), tables, folds=0)
    assert wrong.after.position_rms > 0.1


def test_priors_hold_back_what_the_poses_hardly_show() -> None:
    rows = measured(REAL, within(serial(), 12, 10))
    fresh = measured(REAL, within(serial(), 200, 11), seed=1)
    every = [item.name for item in calibrate(serial(), rows, folds=0).parameters]
    priors = {name: 1e-3 for name in every if not name.startswith(("base", "ball", "target"))}
    free, held = calibrate(serial(), rows, folds=0), calibrate(serial(), rows, priors=priors, folds=0)
    assert len(held.identifiability.identified) > len(free.identifiability.identified)
    one, other = errors_on(free, fresh).position_rms, errors_on(held, fresh).position_rms
    assert other < one
    nailed = calibrate(serial(), rows, ["q2", "q3"], priors={"q2": 1e-9}, folds=0)
    assert nailed["q2"].value == pytest.approx(0, abs=1e-7)
    assert nailed["q2"].std == pytest.approx(1e-9, rel=1e-2)  # as stated, however much the readings scatter


def test_a_four_bar_with_ball_screws_is_calibrated() -> None:
    names = ["f9.d", "f10.d", "lug8.d", "pivot2.d", "q1", "f4.alpha", "f5.d", "screw2"]
    planted = dict(zip(names, 1e-3 * np.random.default_rng(0).standard_normal(8), strict=True))
    rows = measured(corrected(four_bar(), planted, four_bar_poses()), four_bar_poses(), turned=True)
    found = calibrate(four_bar(), rows, [name for name in names if name != "f9.d"] + ["f11.d"])
    assert found.after.position_rms is not None
    exact = measured(
        corrected(four_bar(), planted, four_bar_poses()), four_bar_poses(), turned=True, noise=0.0
    )
    again = calibrate(four_bar(), exact, names, noticed=0.0, folds=0)
    assert again.after.position_max == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("name", ["kr240-2", "gantry", "tripod"])
def test_robots_that_come_along_are_calibrated_in_ten_times_their_tolerances(name: str) -> None:
    robot = load_robot(name)
    q = within(robot, 40, 1)
    q = q.mean(axis=0) + 0.5 * (q - q.mean(axis=0))
    errors = dict.fromkeys([*variables(robot)[:2], f"{robot.frames[1].name}.d"], 1e-2)
    rows = measured(corrected(robot, errors, q[:1]), q, turned=name == "tripod")
    found = calibrate(robot, rows, folds=0)
    assert found.message == "converged"
    assert found.noise == pytest.approx(1.0, abs=0.15)


def test_few_values_leave_little_to_check() -> None:
    found = calibrate(serial(), measured(REAL, within(serial(), 10, 15)), folds=0)
    assert found.notes == (
        "30 measured values in 10 poses for 27 parameters: little is left to check the fit",
    )


def test_a_name_that_was_not_sought_is_told() -> None:
    found = calibrate(serial(), measured(REAL, within(serial(), 20, 16)), ["q2", "q3"], folds=0)
    assert list(found.values) == ["q2", "q3"]
    with pytest.raises(BeamstiffError, match=r"'q4' was not among the parameters"):
        _ = found["q4"]


def test_gauss_newton_ends_where_levenberg_marquardt_does() -> None:
    rows = measured(REAL, within(serial(), 40, 12), base=BASE)
    one, other = (
        calibrate(serial(), rows, method=x, folds=0) for x in ("levenberg-marquardt", "gauss-newton")
    )
    assert one.predicted == pytest.approx(other.predicted, abs=1e-9)
    assert len(other.costs) <= len(one.costs)
    assert (np.diff(one.costs) <= 0).all()


def test_readings_in_the_base_frame_need_no_base() -> None:
    rows = measured(REAL, within(serial(), 40, 13), base=BASE, target=TARGET, turned=True)
    found = calibrate(serial(), rows, folds=0)
    moved = in_base_frame(found, rows)
    gap, other = gap_of(found.robot, moved), gap_of(found.robot, rows, found.base, found.target)
    assert np.linalg.norm(gap, axis=1) == pytest.approx(np.linalg.norm(other, axis=1), rel=1e-6)
    assert np.nan_to_num(found.residual) == pytest.approx(other, abs=1e-9)


def test_what_cannot_be_calibrated_is_refused_in_one_line() -> None:
    q = within(serial(), 40, 14)
    rows = measured(REAL, q)
    few = subset(rows, np.arange(8))
    with pytest.raises(
        BeamstiffError, match=r"<arrays>: 24 measured values in 8 poses for 51 parameters, .* 24"
    ):
        calibrate(serial(), few)
    moved = make_measurements(variables(serial()), q, tcp="ball", displacement=np.zeros((40, 3)))
    with pytest.raises(BeamstiffError, match=r"found displacements .* expected absolute positions"):
        calibrate(serial(), moved)
    nothing = replace(rows, position=np.full((40, 3), np.nan))
    with pytest.raises(BeamstiffError, match="no row holds a whole position"):
        calibrate(serial(), nothing)
    with pytest.raises(BeamstiffError, match=r"did you mean 'f3\.d'\?"):
        calibrate(serial(), rows, ["f3,d"])
    with pytest.raises(BeamstiffError, match=r"no stiffness 'J2.tosional' \(did you mean 'J2.torsional'\?\)"):
        calibrate(serial(), rows, compliances=["J2.tosional"])
    with pytest.raises(BeamstiffError, match=r"no method 'newton'.*known"):
        calibrate(serial(), rows, method="newton")
    with pytest.raises(BeamstiffError, match=r"priors: q2: found -1.0, expected a positive"):
        calibrate(serial(), rows, priors={"q2": -1.0})
    with pytest.raises(BeamstiffError, match=r"priors: 'q9' is no geometric parameter"):
        calibrate(serial(), rows, priors={"q9": 1.0})
    some = replace(rows, sigma=np.where(np.arange(40)[:, None] < 5, np.nan, rows.sigma))
    with pytest.raises(BeamstiffError, match="the noise of some values is stated"):
        calibrate(serial(), some)
    weightless = serial().model_copy(update={"masses": ()})
    with pytest.raises(BeamstiffError, match=r"nothing loads J1.torsional, J2.torsional"):
        calibrate(weightless, rows, compliances=JOINTS[:2])


def test_rotations_read_worse_than_stated_do_not_pull_positions_away() -> None:
    rng, fresh = np.random.default_rng(5), measured(REAL, within(serial(), 60, 2), noise=0.0, base=BASE)
    wrong = []
    for seed in range(4):
        rows = measured(REAL, within(serial(), 40, 10 + seed), turned=True, base=BASE, seed=seed)
        off = rotation_from_vector(2e-3 * rng.standard_normal((40, 3)))  # 40 times as stated
        rough = replace(rows, rotation=vector_from_rotation(off @ rotation_from_vector(rows.rotation)))
        right = replace(rough, sigma=np.where(np.arange(6) < 3, SIGMA, 2e-3 * np.ones((40, 6))))
        errors = [errors_on(calibrate(serial(), one, folds=0), fresh).position_rms for one in (rough, right)]
        found = calibrate(serial(), rough, folds=0)
        assert np.median(found.sigma[:, 3]) == pytest.approx(2e-3, rel=0.2)
        assert any("rotations scatter" in note for note in found.notes)
        wrong.append(errors)
    assert np.mean(wrong, axis=0)[0] < 1.1 * np.mean(wrong, axis=0)[1]


def test_a_sag_by_start_values_is_told_unless_they_are_fitted() -> None:
    rows = measured(machine(serial(False), machined(serial(), 3)), within(serial(), 40, 1))
    guessed = serial(False).with_unmeasured((), ["J2.torsional"])
    notes = [
        calibrate(guessed, rows, compliances=fitted, folds=0).notes for fitted in ((), ("J2.torsional",))
    ]
    told = [
        any("start values that no measurement determined: J2.torsional" in one for one in own)
        for own in notes
    ]
    assert told == [True, False]
    assert not any("start values" in one for one in calibrate(serial(False), rows, folds=0).notes)


def test_a_row_that_is_far_off_all_others_is_named() -> None:
    rows = measured(REAL, within(serial(), 40, 1), base=BASE)
    assert not any("wrong reading" in note for note in calibrate(serial(), rows, folds=0).notes)
    position = rows.position.copy()
    position[7, 2] += 5e-3
    notes = calibrate(serial(), replace(rows, position=position), folds=0).notes
    (told,) = (note for note in notes if "wrong reading" in note)
    assert told.startswith(rows.place(7))


def test_a_zero_that_no_robot_has_is_told() -> None:
    rows = measured(machine(serial(), {"q2": np.radians(20.0)}), within(serial(), 40, 1))
    (told,) = (note for note in calibrate(serial(), rows, ["q2", "q3"]).notes if "no robot has" in note)
    assert told.startswith("q2 by 20 deg is an error")
