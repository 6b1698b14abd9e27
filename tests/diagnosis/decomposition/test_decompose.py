"""Several causes at once beside a calibration: machines moved by plain rigid-body motion and statics."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.decomposed import diagnosis_of
from beamstiff.diagnosis.decomposition import decompose as module
from beamstiff.diagnosis.decomposition.answer import unsteady
from beamstiff.diagnosis.decomposition.applied import applied, of_the_campaign
from beamstiff.diagnosis.decomposition.fit import Step
from beamstiff.diagnosis.decomposition.folds import Folds
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects.approach_direction import last_direction
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.verify import verify
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.diagnosis_text import verdict
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import Frame, Node, Rigid
from beamstiff.se3 import Array, rotation_from_vector

UR10 = Path(__file__).resolve().parents[3] / "examples" / "data" / "ur10.yaml"
NOISE = 1e-5  # m, of a laser tracker
POSES = 90
STOPS_SHORT, GEAR, SLIP = 4e-4, 3e-4, np.array([6e-4, -4e-4, 3e-4])  # rad, rad, m
THREE = {"q1": 1e-4, "q3": 3e-4, "q5": 2e-4}  # rad
LITTLE = np.array([9.0, 12, 15, 18, 21, 24]) * 1e-6  # rad, by which every joint stops short
SLIPS_AT = 40
HALL = np.array([5e-4, 0.0, -8e-4])  # m
FRAME = np.array([0.3, -0.2, 1.1])  # rad: the tracker stands somewhere
PLACE = np.array([2.0, -1.0, 0.4])  # m


def machine_changes() -> dict[str, float]:
    """Return by how much the robot is made otherwise than described, m and rad."""
    rng = np.random.default_rng(3)
    names = ("f2.d", "f3.d", "f4.r", "f2.alpha", "f5.alpha", "q2", "q3", "q4", "q5")
    return {name: 3e-4 * rng.standard_normal() for name in names}


def machine(robot: Robot) -> Robot:
    """Return the robot as it is made: not quite as described."""
    return corrected(robot, machine_changes(), np.zeros((1, 6)))


def read(robot: Robot, q: Array, causes: tuple[str, ...], rng: np.random.Generator) -> Measurements:
    """Return positions of the tool in the tracker's frame, one pose after another."""
    names = [variable.name for variable in robot.actuated]
    plan = make_measurements(names, q, tcp=robot.tcp, position=np.zeros((len(q), 3)))
    true = q.copy()
    if "approach" in causes:
        true[:, 1] += STOPS_SHORT * last_direction(plan, "q2")
    if "three" in causes:
        for name, half in THREE.items():
            true[:, names.index(name)] += half * last_direction(plan, name)
    if "friction" in causes:
        true += LITTLE * np.stack([last_direction(plan, name) for name in names], axis=1)
    if "gear" in causes:
        true[:, 2] += GEAR * np.cos(2 * q[:, 2])
    kinematics = compile_kinematics(machine(robot))
    pose = pose_of(kinematics, posture(kinematics, true), robot.tcp)
    position = pose[:, :3, 3].copy()
    for cause, at in (("slip", SLIPS_AT), ("slipped", 0)):
        if cause in causes:
            position[at:] += pose[at:, :3, :3] @ SLIP
    time = None
    if "hall" in causes:  # which a heater warms and lets cool, every quarter of an hour
        time = 60.0 * np.arange(len(q))
        position += HALL * (np.abs((time / 900.0) % 1.0 - 0.5))[:, None]
    position = position @ rotation_from_vector(FRAME).T + PLACE
    position = position + NOISE * rng.standard_normal(position.shape)
    return make_measurements(names, q, tcp=robot.tcp, position=position, sigma_position=NOISE, time=time)


def table(
    causes: tuple[str, ...], count: int = POSES, made: Robot | None = None
) -> tuple[Robot, Measurements]:
    """Return the robot, its drives rigid, and positions of it, or of one that is `made` otherwise."""
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(1)
    return robot, read(made or robot, rng.uniform(-2.5, 2.5, (count, 6)), causes, rng)


@cache
def found(*causes: str) -> tuple[Diagnosis, Robot]:
    robot, rows = table(causes)
    return diagnose(robot, rows), robot


def test_geometry_alone_is_no_gap() -> None:
    diagnosis, _ = found()
    assert diagnosis.verdict.effect == "none"
    assert not diagnosis.to_dict()["causes"]
    assert diagnosis.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.4)


def test_three_causes_are_named_with_their_sizes_beside_an_unknown_geometry_and_frame() -> None:
    causes = found("approach", "gear", "slip")[0].to_dict()["causes"]
    by_key = {(cause["effect"], cause["component"]): cause for cause in causes}
    assert set(by_key) == {("approach-direction", "q2"), ("angle-curve", "q3"), ("target-slip", None)}
    half = by_key["approach-direction", "q2"]["parameters"]["half_lost_motion"]
    assert half["value"] == pytest.approx(STOPS_SHORT, abs=4 * half["std"])
    assert half["std"] < 0.05 * STOPS_SHORT
    curve = by_key["angle-curve", "q3"]["parameters"]
    assert curve["cosine_2"]["value"] == pytest.approx(GEAR, abs=4 * curve["cosine_2"]["std"])
    slip = by_key["target-slip", None]["parameters"]
    for axis, size in zip("xyz", SLIP, strict=True):
        assert slip[f"slip_{axis}"]["value"] == pytest.approx(size, abs=4 * slip[f"slip_{axis}"]["std"])
    assert [row.rpartition(":")[2] for row in slip["rows"]] == [str(SLIPS_AT + 1)]  # counted from 1


def test_what_the_causes_close_adds_up_and_leaves_no_remainder() -> None:
    report = found("approach", "gear", "slip")[0].to_dict()
    closes = [cause["closes"] for cause in report["causes"]]
    assert closes == sorted(closes, reverse=True)
    assert report["causes"][0]["effect"] == "target-slip"
    assert sum(closes) == pytest.approx(1.0, abs=0.01)  # of postures beside the slip too: all place it
    assert report["remainder"]["share"] < 0.01
    after = [cause["rms_after_mm"] for cause in report["causes"]]
    assert after == sorted(after, reverse=True)
    assert sum(one["probability"] for one in report["which"]) == pytest.approx(1.0)


def test_joints_that_all_stop_a_little_short_are_one_cause() -> None:
    diagnosis, _ = found("friction")
    assert (diagnosis.verdict.effect, diagnosis.verdict.component) == ("approach-direction", None)
    sizes = {one.name: one for one in diagnosis.verdict.estimates}
    for at, half in enumerate(LITTLE, start=1):
        one = sizes[f"half_lost_motion_q{at}"]
        assert abs(one.value - half) < 4.0 * one.std
        assert one.std < 1e-5 or at == 6  # about whose axis the tool stands


def test_of_three_joints_that_stop_short_each_is_named() -> None:
    causes = found("three")[0].to_dict()["causes"]
    assert {(one["effect"], one["component"]) for one in causes} == {("approach-direction", q) for q in THREE}
    for one in causes:
        half = one["parameters"]["half_lost_motion"]
        assert abs(half["value"] - THREE[one["component"]]) < 4.0 * half["std"]


@pytest.mark.parametrize(("before", "after"), [((), ()), (("slip",), ("slipped",))])
def test_what_is_promised_is_true_whatever_slipped(before: tuple[str, ...], after: tuple[str, ...]) -> None:
    diagnosis, robot = found("approach", "gear", *before)
    rng = np.random.default_rng(7)
    fresh = read(robot, rng.uniform(-2.5, 2.5, (40, 6)), ("approach", "gear", *after), rng)
    result = verify(extended(diagnosis), fresh, refit_frame=True)
    assert result.promised == pytest.approx(result.true, abs=0.05)
    assert result.after < 2.0 * result.noise


def test_a_target_that_slipped_stands_where_it_came_to_rest() -> None:
    diagnosis, robot = found("approach", "gear", "slip")
    rng = np.random.default_rng(8)
    fresh = read(robot, rng.uniform(-2.5, 2.5, (40, 6)), ("approach", "gear"), rng)
    later = verify(extended(diagnosis), fresh, refit_frame=True)
    assert later.after > 0.3 * np.linalg.norm(SLIP)  # glued on anew, it stands at its old place


def test_a_slip_is_along_the_axes_in_which_the_robot_file_places_the_point() -> None:
    """The TCP's own axes are others: a flange frame that is turned against the link, as in most URDFs."""
    robot, rows = table(("slip",))
    turned = robot.model_copy(
        update={
            "frames": (*robot.frames, Frame(name="tool0", parent="f6", alpha=1.2, theta=-0.7)),
            "nodes": (*robot.nodes, Node(name="tool0", frame="tool0")),
            "rigids": (*robot.rigids, Rigid(name="flange", nodes=(robot.tcp, "tool0"))),
            "tcp": "tool0",
        }
    )
    diagnosis = diagnose(turned, rows)
    assert diagnosis.verdict.key == f"target-slip:{robot.tcp}"
    for one, true in zip(diagnosis.verdict.estimates, SLIP, strict=True):
        assert abs(one.value - true) < 4.0 * one.std
    rng = np.random.default_rng(9)
    fresh = read(robot, rng.uniform(-2.5, 2.5, (40, 6)), ("slipped",), rng)
    assert verify(extended(diagnosis), fresh, refit_frame=True).after < 2.0 * np.sqrt(3) * NOISE


def test_of_a_cause_that_is_withheld_most_stays_and_the_remainder_says_what_it_follows() -> None:
    robot, rows = table(("approach",))
    report = diagnose(robot, rows, without=["approach-direction"]).to_dict()
    assert all(cause["effect"] != "approach-direction" for cause in report["causes"])
    assert sum(cause["closes"] for cause in report["causes"]) < 0.6  # curves of q2 take a part
    assert report["remainder"]["share"] > 0.4
    assert "direction of approach of q2" in [one["what"] for one in report["remainder"]["follows"]]


def test_a_drive_that_is_rigid_in_truth_keeps_a_place_for_its_play() -> None:
    """The file has drives soft: fits make them rigid, and one has play by the sign of its weight's moment."""
    drives = ("J2.torsional", "J3.torsional", "J4.torsional")
    robot = load_robot(UR10).with_parameters(dict.fromkeys(drives, 5e4))
    robot = robot.model_copy(update={"identify": drives})
    rng = np.random.default_rng(1)
    q = rng.uniform(-2.5, 2.5, (POSES, 6))
    kinematics = compile_kinematics(machine(load_robot(UR10)))

    def potential(turned: Array) -> Array:
        where = posture(kinematics, q + turned)
        at = [kinematics.node_index[mass.node] for mass in robot.masses]
        arm = np.array([mass.at for mass in robot.masses])
        frames = where.transforms[:, kinematics.node_frame[at], :3, :3]
        height = (where.node_positions[:, at] + (frames @ arm[..., None])[..., 0])[..., 2]
        return np.asarray(height @ [mass.mass for mass in robot.masses])

    step = 1e-5 * np.eye(6)[1]
    moment = potential(-step) - potential(step)
    turned = 6e-4 * np.sign(moment)[:, None] * np.eye(6)[1]
    rows = read(load_robot(UR10), q + turned, (), rng)
    found = diagnose(robot, replace(rows, q=q))
    assert (found.verdict.effect, found.verdict.component) == ("backlash", "q2")
    larger = extended(found)
    assert all(5e4 <= larger.parameter(name) < np.inf for name in drives)
    assert verify(larger, replace(rows, q=q), refit_frame=True).after < 5 * NOISE
    moved = replace(rows, position=rows.position + 1e-3 * rng.standard_normal(rows.position.shape))
    np.testing.assert_array_equal(found.predict_shift(rows), found.predict_shift(moved))  # nothing is fitted


def test_a_hall_that_warms_and_cools_is_named_beside_another_cause() -> None:
    diagnosis, _ = found("gear", "hall")
    decomposition = diagnosis.decomposition
    assert [cause.key for cause in decomposition.causes] == ["thermal-drift:null", "angle-curve:q3"]
    assert sum(cause.closes for cause in decomposition.causes) > 0.9


def test_the_first_posture_says_nothing_of_a_robot_that_stops_short() -> None:
    """From which side it came is unknown: here from above, and the model would say from none."""
    robot, rows = table(("approach",))
    rows.position[0] += 2.0 * STOPS_SHORT
    result = diagnose(robot, rows)
    assert result.verdict.key == "approach-direction:q2"
    assert result.verdict.probability > 0.9
    assert result.decomposition.first == (rows.place(0),)
    half = result.to_dict()["causes"][0]["parameters"]["half_lost_motion"]
    assert half["value"] == pytest.approx(STOPS_SHORT, abs=4 * half["std"])
    assert result.decomposition.scatter < 1.2  # nothing is left of what the first posture is off
    assert any("from which side the joints came" in note for note in result.notes)


def test_rows_before_a_joint_moved_say_nothing_of_how_far_it_stops_short() -> None:
    """It lies to one side in the first twenty, and nobody knows to which."""
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(2)
    q = rng.uniform(-2.5, 2.5, (60, 6))
    q[:20, 1] = 0.3
    ahead = np.concatenate([q[:1] + 0.5, q])  # it came from above
    rows = subset(read(robot, ahead, ("approach",), rng), np.arange(1, 61))
    result = diagnose(robot, rows)
    assert len(result.decomposition.first) == 20
    (cause,) = result.to_dict()["causes"]
    half = cause["parameters"]["half_lost_motion"]
    assert half["value"] == pytest.approx(STOPS_SHORT, abs=4 * half["std"])


def test_readings_that_few_would_do_without_stay() -> None:
    """Of fourteen postures the first was read ten times: without it less of the geometry could be open."""
    robot, rng = load_robot(UR10).model_copy(update={"identify": ()}), np.random.default_rng(3)
    q = np.repeat(rng.uniform(-2.5, 2.5, (14, 6)), [10, *[1] * 13], axis=0)
    result = diagnose(robot, read(robot, q, ("approach",), rng))
    assert result.decomposition.first == ()


def test_a_drift_with_time_that_is_not_named_is_of_its_campaign_alone() -> None:
    """Another day has another: a robot with it would be wrong by as much again. Warmth comes again."""
    diagnosis, _ = found("gear", "hall")
    named = diagnosis.decomposition
    drift, curve = named.causes
    undecided = replace(named, causes=(curve,), unclear=(drift,))
    assert {one.effect for one in applied(named).effects} == {"thermal-drift", "angle-curve"}
    (left,) = applied(undecided).effects
    assert left.effect == "angle-curve"
    assert left.closes == pytest.approx(curve.closes / (1.0 - drift.closes), abs=1e-3)
    assert of_the_campaign(undecided) == [drift]
    assert of_the_campaign(named) == []
    forms = tuple(replace(one, shape=replace(one.shape, name="temperature")) for one in drift.forms)
    warmth = replace(undecided, unclear=(replace(drift, forms=forms),))
    assert of_the_campaign(warmth) == []


# What a diagnosis makes of a decomposition: sizes that add up, and nothing named of another robot


def test_what_is_left_is_what_the_told_causes_do_not_close() -> None:
    decomposition = found("approach", "gear")[0].decomposition
    # as beside a law outside the library that was counted before them, and is not told
    behind = [replace(one, rms_after=0.1 * one.rms_after) for one in decomposition.causes]
    told = diagnosis_of(replace(decomposition, causes=tuple(behind))).decomposition
    explainable, closed = told.rms**2 - told.noise**2, 0.0
    for one in told.causes:
        closed += one.closes
        assert one.rms_after**2 == pytest.approx(told.rms**2 - closed * explainable, abs=1e-18)


def test_of_readings_of_another_robot_nothing_is_named() -> None:
    longer = {"f3.d": 0.15, "f4.d": -0.11, "f5.r": 0.12, "f4.alpha": 0.1}
    result = diagnose(*table(("gear",), made=corrected(load_robot(UR10), longer, np.zeros((1, 6)))))
    assert result.verdict.effect == "unknown"
    assert not result.to_dict()["causes"]
    (note,) = (one for one in result.notes if "no machine is built so far from its drawing" in one)
    assert "f3.d by 149 mm, f4.d by -110 mm" in note
    assert verdict(result).action.startswith("Check that robot file and table are of one robot")
    alike, _ = found("approach", "gear")
    assert not [one for one in alike.notes if "from its drawing" in one]


def test_the_order_of_rows_without_times_is_told_where_it_decides() -> None:
    def told(*effects: str) -> bool:
        return any("not every row has a time t" in note for note in found(*effects)[0].notes)

    assert told("approach", "gear")
    assert not told("gear")


def test_a_wrist_far_off_its_drawing_that_moves_the_tool_little_is_no_other_robot() -> None:
    wrist = corrected(load_robot(UR10), {"f5.alpha": 0.12}, np.zeros((1, 6)))  # 0.15 m from the tool
    result = diagnose(*table(("gear",), made=wrist))
    (turned,) = (one for one in result.recalibration.changes if one.parameter.name == "f5.alpha")
    assert turned.by == pytest.approx(0.12, abs=2e-3)
    assert not [one for one in result.notes if "from its drawing" in one]
    assert result.verdict.key == "angle-curve:q3"


def test_a_stated_noise_far_beyond_the_readings_is_no_agreement() -> None:
    robot, rows = table((), 40)
    result = diagnose(robot, replace(rows, sigma=1e3 * rows.sigma, sigma_position=1e-2))
    told = verdict(result)
    assert told.level == "doubtful"
    assert "times what the readings scatter" in told.headline
    assert told.action.startswith("State the noise of the instrument")


def test_a_noise_that_is_stated_of_all_three_axes_is_suspected(monkeypatch: pytest.MonkeyPatch) -> None:
    def suspected(result: Diagnosis) -> list[str]:
        return [note for note in result.notes if "times the stated noise" in note]

    robot, rows = table(("gear",))
    assert not suspected(found("approach", "gear", "slip")[0])
    result = diagnose(robot, replace(rows, sigma=np.sqrt(3) * rows.sigma))
    (note,) = suspected(result)
    assert float(note.split()[4]) == pytest.approx(1 / np.sqrt(3), rel=0.1)
    assert "per axis: is it that of all three axes (divide it by 1.7), or two sigma (by 2)?" in note
    several = result.decomposition
    assert several is not None
    for scatter, asks in ((0.72, []), (0.2, [False]), (0.69, [True])):
        told = suspected(diagnosis_of(replace(several, scatter=scatter)))
        assert ["divide it" in one for one in told] == asks
    monkeypatch.setattr(type(several.model), "determined", several.model.count - 8.0)
    assert not suspected(diagnosis_of(several))  # chance leaves so little of a few values


def test_a_cause_that_makes_held_out_postures_worse_stays_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = list[set[str]]()

    def once(folds: Folds, step: Step, seed: int) -> set[str]:
        calls.append(unsteady(folds, step, seed) if calls else {"angle-curve:q3"})
        return calls[-1]

    monkeypatch.setattr(module, "unsteady", once)
    robot, rows = table(("gear", "slip"))
    keys = {cause.key for cause in module.decompose(robot, rows).every}
    assert "target-slip:null" in keys
    assert "angle-curve:q3" not in keys
    assert len(calls) > 1
