"""Without its effects a robot is what a calibration without them finds, not what was fitted beside them."""

from dataclasses import replace
from typing import NoReturn

import numpy as np
import pytest

from beamstiff.calibration.calibrate import calibrate
from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.absorbed import absorbed_by, calibrated_without
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.decomposition.applied import applied, calibrated_beside
from beamstiff.diagnosis.decomposition.causes import Decomposition
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.verify import verify
from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot
from tests.diagnosis.test_absolute import UR10, far_away, measured

# of the geometry: more than a description that is right but for one part or two
OFF = {"q2": 2e-3, "q3": -3e-3, "q5": 2e-3, "f2.d": 5e-4, "f3.d": -8e-4, "f4.alpha": 1e-3, "f5.r": 6e-4}


def test_the_gap_before_is_that_of_a_calibration_without_the_cause() -> None:
    robot = load_robot(UR10)
    rows = measured(corrected(robot, OFF, np.zeros((1, 6))), 2)
    fitted, fresh = subset(rows, np.arange(56)), subset(rows, np.arange(56, 80))
    found = verify(extended(diagnose(robot, fitted)), fresh)
    calibration = calibrate(robot.model_copy(update={"identify": ()}), fitted, folds=0)
    alone = verify(calibration.robot, fresh, refit_frame=True)
    assert alone.after > 3e-4
    assert found.before == pytest.approx(alone.after, rel=0.05)
    assert found.promised == pytest.approx(found.true, abs=0.05)


@pytest.mark.parametrize("scatter", [3e-4, 1e-3])
def test_so_it_is_where_the_machine_scatters_far_beside_the_stated_noise(scatter: float) -> None:
    """How closely a calibration keeps to the description depends on what it has to make up for."""
    robot = load_robot(UR10)
    rows = far_away(corrected(robot, OFF, np.zeros((1, 6))), scatter, sag=4.0)
    fitted, fresh = subset(rows, np.arange(56)), subset(rows, np.arange(56, 80))
    found = verify(extended(diagnose(robot, fitted)), fresh, refit_frame=True)
    calibration = calibrate(robot.model_copy(update={"identify": ()}), fitted, folds=0)
    alone = verify(calibration.robot, fresh, refit_frame=True)
    assert found.before == pytest.approx(alone.after, rel=0.01)
    assert found.after < 1.3 * np.sqrt(3.0) * scatter  # the noise of the machine


def test_a_drive_is_as_soft_as_a_fit_without_the_effect_makes_it() -> None:
    """Whose slip is half its wind-up is half as soft again."""
    robot = load_robot("kr240-2")
    name, stiffness = "J2.torsional", robot.parameter("J2.torsional")
    tangent = np.random.default_rng(0).standard_normal((20, 1))
    absorbed = absorbed_by([name], tangent, 0.5 / stiffness * tangent[:, 0])
    other, _ = calibrated_without(robot, [absorbed], measured(load_robot(UR10), None))
    assert other.parameter(name) == pytest.approx(stiffness / 1.5, rel=1e-3)


def test_rows_move_into_the_base_frame_that_would_be_found() -> None:
    robot = load_robot(UR10)
    rows = measured(robot, None)
    base = {"base.x": 1e-3, "base.rz": 2e-3}
    _, there = calibrated_without(robot, [base], rows)
    moved = there.position + np.cross(np.array([0.0, 0.0, 2e-3]), there.position) + [1e-3, 0.0, 0.0]
    np.testing.assert_allclose(moved, rows.position, atol=1e-5)  # (2e-3)^2 of a metre
    part = np.where(np.arange(240).reshape(80, 3) == 8, np.nan, rows.position)  # one axis of the third row
    _, read = calibrated_without(robot, [base], replace(rows, position=part))
    expected = np.where(np.isnan(part), np.nan, there.position)
    np.testing.assert_allclose(read.position, expected, atol=1e-6)  # noise of that axis, turned


def test_nothing_absorbed_changes_nothing() -> None:
    robot = load_robot(UR10)
    rows = measured(robot, None)
    assert calibrated_without(robot, [], rows) == (robot, rows)


def test_joints_stay_whole_where_a_file_has_rounded_their_nodes() -> None:
    real = corrected(load_robot(UR10), OFF, np.zeros((1, 6)))
    off = np.random.default_rng(0).uniform(-5e-8, 5e-8, (len(real.nodes), 3))  # as 1e-7 is written
    short = [
        node.model_copy(update={"at": tuple((node.at + by).tolist())})
        for node, by in zip(real.nodes, off, strict=True)
    ]
    written = real.model_copy(update={"nodes": tuple(short)})
    again = corrected(written, {"f1.r": 2e-3, "f3.alpha": 2e-3}, np.zeros((1, 6)))
    kinematics = compile_kinematics(again)
    places = posture(kinematics, np.full((1, 6), 0.3)).node_positions[0]
    ends = np.array([[kinematics.node_index[name] for name in joint.nodes] for joint in again.joints])
    np.testing.assert_allclose(places[ends[:, 0]], places[ends[:, 1]], atol=1e-9)


@pytest.fixture(scope="module")
def found() -> Decomposition:
    """Return the causes in all readings of the machine."""
    robot = load_robot(UR10)
    several = diagnose(robot, measured(corrected(robot, OFF, np.zeros((1, 6))), 2)).decomposition
    assert several is not None
    return several


def test_what_the_readings_do_not_tell_apart_absorbs_nothing(found: Decomposition) -> None:
    effect = applied(found).effects[0]
    sizes = {name: abs(by) for name, by in effect.absorbed.items()}
    assert "base.x" in sizes
    assert "f1.gamma" not in sizes  # the base's own turn
    assert max(sizes.values()) < 0.02  # rad or m: a few times the sag itself


def test_a_machine_that_would_buckle_is_told_by_the_linear_step(
    found: Decomposition, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wrong rows make drives as soft as none is; the diagnosis stands all the same."""

    def buckles(*given: object, **options: object) -> NoReturn:
        raise BeamstiffError("robot 'UR10' buckles under its load")

    monkeypatch.setattr("beamstiff.diagnosis.decomposition.applied.open_geometry", buckles)
    assert calibrated_beside(found) == found.model.robot(found.change)


def test_no_calibration_makes_a_drive_stiffer_than_rigid() -> None:
    """Where a compliance comes to 0, the other parameters fit what is left: the bounded least squares."""
    tangent = np.random.default_rng(1).standard_normal((30, 3)) @ np.diag([1.0, 1e3, 1e6])
    tangent[:, 2] += 1e6 * tangent[:, 0]  # the drive looks like the length
    wanted = np.array([2e-3, 1e-6, -5e-9])
    names, moved = ["f2.d", "q2", "J2.torsional"], tangent @ wanted
    free = absorbed_by(names, tangent, moved)
    assert [*free.values()] == pytest.approx(wanted, rel=1e-3)
    found = absorbed_by(names, tangent, moved, {"J2.torsional": 2e-9})
    rest = np.linalg.lstsq(tangent[:, :2], moved + 2e-9 * tangent[:, 2], rcond=None)[0]
    assert [*found.values()] == pytest.approx([*rest, -2e-9], rel=1e-3)
    assert absorbed_by(names, tangent, moved, {"J2.torsional": 6e-9}) == free
