"""Real files: the practice campaigns and the published compliance surface of the IR-663."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from beamstiff.measure.plausibility import doubts
from beamstiff.measure.reader import parse_measurements, read_measurements
from beamstiff.measure.rows import history_order
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.robot.description import Robot


def practice_sets(shared_path: Callable[[str], Path]) -> dict[Path, dict[str, object]]:
    labels = shared_path("practice/labels.json")
    known = json.loads(labels.read_text(encoding="utf-8"))
    return {labels.with_name(f"{name}.csv"): label for name, label in known.items()}


def test_every_practice_set_reads_as_its_label_says(kr240: Robot, shared_path: Callable[[str], Path]) -> None:
    sets = practice_sets(shared_path)
    assert len(sets) >= 20
    for path, label in sets.items():
        table = read_measurements(path, kr240)
        lines = path.read_text(encoding="utf-8").splitlines()
        data = [line for line in lines if line and not line.startswith("#")][1:]
        assert len(table) == label["rows"] == len(data)
        assert table.variables == ("q1", "q2", "q3", "q4", "q5", "q6")
        assert table.kind == ("absolute" if label.get("kind") == "pose" else "displacement")
        assert table.sigma_position == pytest.approx(3e-5)
        assert table.sigma_rotation == (pytest.approx(5e-5) if label.get("rot") else None)
        expected = [True] * 3 + [bool(label.get("rot"))] * 3
        assert (table.measured_mask == expected).all()
        assert (table.point == "n6b").all()
        assert table.rows[-1] == len(lines)
        assert (history_order(table) == np.arange(len(table))).all()
        assert doubts(table, kr240) == ()


def test_numbers_of_a_practice_set_are_those_of_plain_numpy(
    kr240: Robot, shared_path: Callable[[str], Path]
) -> None:
    for path, label in practice_sets(shared_path).items():
        table = read_measurements(path, kr240)
        raw = np.genfromtxt(path, delimiter=",", skip_header=3 if label.get("rot") else 2)
        np.testing.assert_array_equal(table.q, raw[:, :6])
        np.testing.assert_array_equal(table.wrench, raw[:, 6:12])
        if table.kind == "displacement":
            np.testing.assert_allclose(table.displacement[:, :3], raw[:, 12:15] / 1e3, rtol=1e-15)
            np.testing.assert_array_equal(table.displacement[:, 3:], raw[:, 15:18])
        else:
            np.testing.assert_array_equal(table.position, raw[:, 12:15])
        np.testing.assert_array_equal(np.c_[table.pose, table.step, table.time], raw[:, -3:])


def test_practice_sets_survive_writing(kr240: Robot, shared_path: Callable[[str], Path]) -> None:
    for path in practice_sets(shared_path):
        table = read_measurements(path, kr240)
        back = parse_measurements(measurements_to_csv(table, kr240), kr240)
        np.testing.assert_array_equal(back.q, table.q)
        np.testing.assert_allclose(back.measured, table.measured, rtol=1e-15)
        assert back.sigma_position == table.sigma_position


def test_the_published_surface_of_the_ir663(shared_path: Callable[[str], Path]) -> None:
    robot = Robot(
        name="ir663-inputs",
        variables=[{"name": "q2", "type": "revolute"}, {"name": "q8", "type": "revolute"}],
        frames=[{"name": "f2", "theta": "q2"}, {"name": "f8", "parent": "f2", "theta": "q8"}],
        nodes=[{"name": "root"}, {"name": "tip", "frame": "f8"}],
        rigids=[{"name": "link", "nodes": ["root", "tip"]}],
        fixed=["root"],
        tcp="tip",
    )
    table = read_measurements(shared_path("data/ir663_compliance_xx.csv"), robot)
    assert len(table) == 12
    assert table.sigma_position == pytest.approx(35e-6)
    assert table.sigma_rotation is None
    assert table.metadata["source"].startswith("seed 003, Table 4")
    # Table 4: theta2 in four values by theta8 in three
    assert np.rad2deg(table.q[:, 0]).round(2).tolist() == np.repeat([-24.15, 1.37, 12.54, 36.83], 3).tolist()
    assert np.rad2deg(table.q[:, 1]).round(2).tolist() == np.tile([33.04, 48.63, 62.90], 4).tolist()
    assert table.wrench.tolist() == [[-900, 0, 0, 0, 0, 0]] * 12
    assert table.measured_mask.tolist() == [[True] + [False] * 5] * 12
    # -900 N, -0.953 mm: the compliance SEEDS.md quotes
    assert table.displacement[4, 0] / table.wrench[4, 0] * 900e3 == pytest.approx(0.953)
    assert len(np.unique(table.pose)) == 12
