"""Fitted models as part of a robot's file: they predict the same once read back, and say how far they go."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, load_robot
from beamstiff.identification.models.fuzzy import fit_fuzzy
from beamstiff.identification.models.side_by_side import FITS, Options
from beamstiff.measure.table import make_measurements
from beamstiff.model.correction import extrapolation_notes, model_correction, model_std
from beamstiff.model.linear import predict_displacements
from beamstiff.model.model_file import fitted_model, with_model
from beamstiff.robot.fitted_model import KINDS
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.robot.yaml_edit import robot_yaml
from tests.identification.varying_machines import kr500, lever, loads, nothing, postures, table

COUNT = 60


@cache
def fitted(kind: str) -> tuple[Robot, object]:
    """Return the KR500 with a model of a kind in it, and the model."""
    rows = table(postures(COUNT), loads(COUNT), lever)
    model = FITS[kind](kr500(), rows, Options(cube=0.6)).model
    return with_model(getattr(model, "robot", kr500()), model, rows), model


def pushed(q: np.ndarray, wrench: np.ndarray):
    return make_measurements([one.name for one in kr500().actuated], q, tcp="n6b", wrench=wrench)


@pytest.mark.parametrize("kind", KINDS)
def test_a_model_that_was_written_predicts_what_it_did(kind: str) -> None:
    robot, model = fitted(kind)
    again = parse_robot(robot_to_yaml(robot))
    assert again.model == robot.model
    q, wrench = postures(10, seed=3), loads(10, seed=3)
    before, after = model.predict(q, wrench), fitted_model(again).predict(q, wrench)
    assert np.abs(after - before).max() < 1e-7 * np.abs(before).max()
    rows = pushed(q, wrench)
    total = predict_displacements(again, rows) + model_correction(again, rows)
    assert np.abs(total - before).max() < 1e-7 * np.abs(before).max()


def test_a_gaussian_process_keeps_its_standard_deviations() -> None:
    robot, model = fitted("gaussian process")
    q, wrench = postures(10, seed=3), loads(10, seed=3)
    std = model_std(parse_robot(robot_to_yaml(robot)), pushed(q, wrench))
    assert np.allclose(std, model.predict_with_std(q, wrench)[1], rtol=1e-5)
    assert model_std(fitted("grid")[0], pushed(q, wrench)) is None


def test_terms_that_rules_do_not_know_are_those_of_the_springs() -> None:
    q = postures(COUNT)
    along_z = np.zeros((COUNT, 6))
    along_z[:, 2] = -900.0
    rows = table(q, along_z, lever)
    robot = with_model(kr500(), fit_fuzzy(kr500(), rows).model, rows)
    across = np.zeros((COUNT, 6))
    across[:, 4] = 200.0
    known, unknown = (model_correction(robot, pushed(q, wrench)) for wrench in (along_z, across))
    assert np.abs(known).max() > 1e-5
    assert np.abs(unknown[:, [0, 1, 3, 4, 5]]).max() < 1e-3 * np.abs(known).max() + 1e-4


@pytest.mark.slow
def test_a_partition_a_term_knows_what_one_for_all_does() -> None:
    count = 25
    q = np.repeat(postures(count), 3, axis=0)
    wrench = np.tile(np.hstack([-900.0 * np.eye(3), np.zeros((3, 3))]), (count, 1))
    rows = table(q, wrench, nothing, noise=1e-9, sigma=None)
    model = fit_fuzzy(kr500(), rows, each_term=True).model
    assert len(model.systems) == len({one.premises for one in model.systems}) > 5
    assert (model.known == fit_fuzzy(kr500(), rows).model.known).all()
    robot = parse_robot(robot_to_yaml(with_model(kr500(), model, rows)))
    some = postures(5, seed=4), loads(5, seed=4)
    wrench = some[1] * [1, 1, 1, 0, 0, 0]
    before = model.extrapolating().predict(some[0], wrench)
    assert np.abs(fitted_model(robot).predict(some[0], wrench) - before).max() < 1e-7 * np.abs(before).max()
    mixed = table(postures(COUNT), loads(COUNT), nothing)
    with pytest.raises(BeamstiffError, match=r"several axes, expected one axis a row"):
        fit_fuzzy(kr500(), mixed, each_term=True)


def test_the_file_keeps_comments_and_takes_a_model_in_place_beside_or_away(tmp_path: Path) -> None:
    robot, _ = fitted("grid")
    source = tmp_path / "mine.yaml"
    source.write_text(robot_to_yaml(kr500()).replace("tcp: n6b", "tcp: n6b   # the flange"))
    written = robot_yaml(robot, source)
    assert "tcp: n6b   # the flange" in written
    assert parse_robot(written).model == robot.model
    keys, model = written.split("model:\n")
    beside = tmp_path / "beside"
    beside.mkdir()
    (beside / "grid.yaml").write_text("\n".join(line[2:] for line in model.splitlines()))
    named = beside / "robot.yaml"
    named.write_text(keys + "model: grid.yaml   # measured in May\n")
    assert load_robot(named).model == robot.model
    (tmp_path / "elsewhere.yaml").write_text(robot_yaml(load_robot(named), named))
    assert load_robot(tmp_path / "elsewhere.yaml").model == robot.model
    source.write_text(written)
    other = load_robot(source).model_copy(update={"model": fitted("gray box")[0].model})
    assert parse_robot(robot_yaml(other, source)).model == other.model
    without = robot_yaml(other.model_copy(update={"model": None}), source)
    assert "model:" not in without
    assert "# the flange" in without


def test_how_far_it_extrapolates_is_said() -> None:
    robot, _ = fitted("grid")
    q = postures(COUNT)
    assert extrapolation_notes(robot, q) == ()
    far = q[:3].copy()
    far[0, 1] += np.deg2rad(40.0)
    (said,) = extrapolation_notes(robot, far)
    assert "(grid) extrapolates at 1 of 3 rows" in said
    assert "mm beyond the fitted workspace" in said
    assert "q2" in said
    assert "deg beyond its fitted range" in said


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("version: 1", "version: 2", "model.version: found 2, expected 1"),
        ("kind: grid", "kind: girdle", "model.kind: found 'girdle', expected 'fuzzy'"),
        ("J1.torsional, J2.torsional", "J1.torsional", "expected 5: one a spring"),
        ("J1.torsional, J2", "J9.torsional, J2", "model.springs[0]: unknown stiffness parameter"),
        ("variable: q1", "variable: q9", "unknown actuated variable 'q9'"),
        ("counts: [1, 2, 1]", "counts: [1, 3, 1]", "expected 3: one a cube"),
    ],
)
def test_a_model_that_is_wrong_is_refused_by_its_key(before: str, after: str, message: str) -> None:
    text = robot_to_yaml(fitted("grid")[0])
    head, model = text.split("model:\n")
    assert before in model
    with pytest.raises(BeamstiffError) as refused:
        parse_robot(head + "model:\n" + model.replace(before, after, 1))
    assert message in str(refused.value)


def test_a_model_beside_that_is_not_there_is_refused_by_the_robots_line(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(robot_to_yaml(kr500()) + "model: nothing.yaml\n")
    with pytest.raises(BeamstiffError, match=r"robot.yaml:\d+: model: .*nothing.yaml"):
        load_robot(file)


def test_postures_beyond_those_that_a_robot_was_fitted_at_are_said() -> None:
    robot = load_robot("kr240-2").with_fitted_rows([], {"q2": (-2.0, -1.0), "q4": (-0.5, 0.5)})
    q = np.zeros((4, 6))
    q[:, 1] = [
        -1.5,
        -0.95,
        -1.5 + 2 * np.pi,
        -0.8,
    ]  # a tenth of the range is near; a turn farther on is the same
    assert extrapolation_notes(robot, q[:3]) == ()
    q[0, 3] = 1.0
    (said,) = extrapolation_notes(robot, q, "targets")
    assert said.startswith("2 of 4 targets are beyond the joint values")
    assert "(q4 by 28.6 deg, q2 by 11.5 deg)" in said
    wider = robot.with_fitted_rows([], {"q2": (-1.2, -0.8), "q4": (0.9, 1.0)})
    assert extrapolation_notes(wider, q) == ()
    assert parse_robot(robot_to_yaml(wider)).fitted_ranges == wider.fitted_ranges
