"""The verdict that a result begins with: its colour by gap over noise, the data, one action."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from beamstiff import calibrate, identify, load_robot, read_measurements
from beamstiff.diagnosis.candidate import Candidate
from beamstiff.diagnosis.decomposition.open_model import open_stiffness
from beamstiff.diagnosis.decomposition.outlier_influence import Apart
from beamstiff.measure.table import make_measurements
from beamstiff.report.calibrated_text import moved_load
from beamstiff.report.diagnosis_text import _or_alike, summary, verdict
from beamstiff.report.diagnosis_words import hardly_checked
from beamstiff.report.geometry import calibration_verdict
from beamstiff.report.identification import identification_verdict
from beamstiff.report.verdict import Verdict, data_of, level_of, rigid_drives, rigid_text, rounded
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.diagnosis.planted import diagnosed

DATA = "examples/data/ir663_compliance_xx.csv"


@pytest.mark.parametrize(
    ("ratio", "level"), [(0.4, "agrees"), (1.5, "agrees"), (3.7, "doubtful"), (5.1, "differs")]
)
def test_the_colour_follows_gap_over_noise(ratio: float, level: str) -> None:
    assert level_of(ratio) == level


def test_a_terminal_shows_headline_data_and_action_in_their_order() -> None:
    lines = list(Verdict("Gap of 1 mm", "differs", "a.csv, 3 rows", "Measure.").lines())
    assert [line.plain for line in lines] == ["Gap of 1 mm", "Data: a.csv, 3 rows.", "Next: Measure.", ""]
    assert str(lines[0].style) == "bold red"
    assert Verdict("x", "doubtful").badge == "gap beyond noise"
    assert Verdict("x", "differs", explained=True).badge == "gap far beyond noise, explained to within it"


def test_a_fit_that_leaves_several_times_the_noise_is_amber_and_sends_to_the_diagnosis() -> None:
    robot = load_robot("ir663")
    rows = read_measurements(DATA, robot)
    found = identification_verdict(identify(robot, rows), rows)
    assert found.headline == "2 of 3 stiffness values identified; the fit leaves 3.7 times the noise"
    assert found.level == "doubtful"
    assert "beamstiff diagnose ROBOT DATA.csv finds what it lacks" in found.action
    assert "These rows do not determine J18.torsional: beamstiff plan" in found.action
    found = identification_verdict(identify(robot, rows), rows, ["ir663.yaml", DATA])
    assert f"beamstiff diagnose ir663.yaml {DATA} finds" in found.action
    assert found.data == "ir663_compliance_xx.csv, 12 rows at 12 postures"


def test_without_a_stated_noise_nothing_is_judged() -> None:
    robot = load_robot("ir663")
    rows = read_measurements(DATA, robot)
    bare = replace(rows, sigma=rows.sigma * float("nan"), sigma_position=None)
    found = identification_verdict(identify(robot, bare, ["J12.torsional"]), bare)
    assert found.level == "plain"
    assert "sigma_position" in found.action


def test_a_cause_is_named_with_the_gap_and_what_it_explains() -> None:
    result = diagnosed("backlash")
    found = verdict(result)
    assert result.verdict.shrink is not None
    share = f"{100 * result.verdict.shrink.shrink:.0f} %"
    gap = rounded(1e3 * result.rms)
    sure = f"Gap of {gap} mm, {share} explained by backlash at q3"
    doubted = f"Gap of {gap} mm, explained by backlash at q3; the share, {share}, is uncertain"
    assert found.headline == (doubted if hardly_checked(result) else sure)
    assert found.level in ("doubtful", "differs")
    assert found.explained == (result.verdict.shrink.after <= 1.5 * result.noise)
    assert data_of(result.baseline.rows) == found.data


def test_what_is_systematic_is_never_green_and_what_is_undecided_names_no_cause() -> None:
    result = diagnosed("backlash")
    near = replace(result, rms=1.01 * result.noise)
    assert verdict(near).level == "doubtful"
    unknown = Candidate("unknown", None, 0.9)
    found = verdict(replace(result, verdict=unknown, candidates=(unknown,), decomposition=None))
    assert found.headline.endswith("cause unknown")
    doubt = replace(result.verdict, probability=0.24)
    others = (doubt, Candidate("none", None, 0.46), Candidate("unknown", None, 0.3))
    found = verdict(replace(result, verdict=doubt, candidates=others, decomposition=None))
    assert found.headline.endswith("cause undecided")
    assert "backlash" not in found.headline


def test_nothing_beyond_noise_is_green() -> None:
    found = verdict(diagnosed(None))
    assert found.level == "agrees"
    assert found.headline.startswith("Model and machine agree: gap ")


def test_scatter_far_beyond_the_stated_noise_is_no_agreement() -> None:
    result = diagnosed(None)
    rough = replace(result, features=dict(result.features) | {"noise_position": 5.8, "scale": 1.0})
    found = verdict(rough)
    assert found.level == "doubtful"
    assert found.headline.startswith(
        "No effect shows, but the readings scatter 5.8 times the stated noise (gap "
    )


def test_a_calibration_says_error_before_and_after() -> None:
    robot = load_robot("kr240-2")
    names = [one.name for one in robot.actuated]
    rng = np.random.default_rng(0)
    low, high = np.array([one.limits or (-1, 1) for one in robot.actuated]).T
    q = low + (high - low) * (0.3 + 0.4 * rng.random((40, len(names))))
    kinematics = compile_kinematics(robot)
    place = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]
    place = place + 1e-5 * rng.standard_normal(place.shape)
    rows = make_measurements(names, q, tcp=robot.tcp, position=place, sigma_position=1e-5)
    found = calibration_verdict(calibrate(robot, rows, ["q2", "q3"], fixed=["base"]), rows)
    assert found.headline.startswith("Position error from ")
    assert "times the noise" in found.headline
    assert found.data.endswith("40 rows at 40 postures")


def test_undecided_effects_that_close_most_of_an_unknown_gap_are_named() -> None:
    result = diagnosed("backlash")
    unknown = Candidate("unknown", None, 0.9)
    alike = ("bearing-tilt:q1",)
    tilt = SimpleNamespace(key="bearing-tilt:q2", closes=0.77, indistinguishable=alike, forms=())
    model = open_stiffness(result.baseline)
    nothing = np.zeros(len(result.baseline.fitted))
    found: Any = SimpleNamespace(
        causes=(),
        verdict=None,
        unclear=(tilt,),
        every=(tilt,),
        law=None,
        unmodelled=(),
        model=model,
        change=nothing,
        scatter=1.0,
        apart=Apart(),
    )
    result = replace(result, verdict=unknown, candidates=(unknown,), decomposition=found)
    result.__dict__["recalibration"] = None  # such a decomposition has no calibration
    best = "bearing-tilt at q2 (or bearing-tilt at q1), which closes 77 %"
    assert verdict(result).headline.endswith(f"cause unknown: perhaps {best}")
    assert f"no cause is sure. Best so far: {best} of it" in summary(result)
    tilt.closes = 0.4
    assert verdict(result).headline.endswith("cause unknown")
    found.law = SimpleNamespace(
        closes=0.5, looks_like="the base has play", lifted_side=None, nameless=True, probability=0.98
    )
    law = "50 % look as if the base has play"
    assert verdict(result).headline.endswith(f"cause outside the library: {law}")
    looks = "no effect of the library fits it. Most of it looks as if the base has play (probability 98 %)."
    assert looks in summary(result)


def test_a_load_that_moved_with_the_reflector_is_told() -> None:
    rows = SimpleNamespace(
        load_point=np.array(["flange"]), point=np.array(["flange"]), wrench=np.ones((1, 6))
    )
    changes = [
        SimpleNamespace(parameter=SimpleNamespace(name=f"flange.{axis}", group="target"), by=by)
        for axis, by in (("x", 0.08), ("y", 0.06))
    ]
    result: Any = SimpleNamespace(
        baseline=SimpleNamespace(rows=rows, absolute=True), recalibration=SimpleNamespace(changes=changes)
    )
    assert "found the reflector 100 mm from its place flange in the robot file" in moved_load(result)
    rows.point = np.array(["reflector"])
    assert moved_load(result) == ""


def test_rigid_drives_are_told_with_what_to_do() -> None:
    robot = load_robot("kr240-2")
    assert rigid_text(robot, rigid_drives(robot)) == ""
    bare = robot.with_parameters({"J2.torsional": np.inf})
    assert rigid_drives(bare) == ["J2"]
    assert rigid_drives(load_robot("ir663-screws")) == []  # its drives are struts


def test_the_start_value_of_a_rigid_drive_is_of_the_size_of_the_others() -> None:
    robot = load_robot("kr240-2")
    drives = [joint.name for joint in robot.joints if np.isfinite(joint.stiffness.torsional)]
    small = {f"{name}.torsional": 3e4 * 2.0**at for at, name in enumerate(drives)}
    bare = robot.with_parameters(small | {f"{drives[0]}.torsional": np.inf})
    rest = np.median(list(small.values())[1:])
    assert f"--joint-stiffness '{drives[0]}={rest:.0e} N*m/rad'".replace("e+0", "e") in rigid_text(
        bare, drives[:1]
    )
    rigid = robot.with_parameters(dict.fromkeys(small, np.inf))
    assert "--joint-stiffness '1e6 N*m/rad'" in rigid_text(rigid, rigid_drives(rigid))


def test_one_name_more_is_named_and_several_are_counted() -> None:
    names = [f"backlash:q{k}" for k in range(1, 7)]
    assert _or_alike("x", names[:4]).endswith("backlash at q3, backlash at q4)")
    assert _or_alike("x", names).endswith("backlash at q3 and 3 more)")
    assert _or_alike("x", names, 1) == "x (or backlash at q1 and 5 more)"
