"""The benchmark of speed compares answers before times, and prints what it says."""

import os

import numpy as np
import pytest

from beamstiff import compile_structure, load_robot, posture
from beamstiff.expression_graph import compiled
from benchmarks import growth, large_frame, speed
from benchmarks.batched_compliance import closing_poses


def test_all_ways_agree_on_the_same_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "median", lambda work, *_: work() is None or 1e-3)
    head, *rows = list(speed.many_poses((1e10, 1e10), None, 256))
    assert len({len(row) for row in (head, *rows)}) == 1
    differences = [float(row[3]) for row in rows if row[1].startswith(("numpy", "numba,"))]
    assert len(differences) >= 4
    assert max(differences) <= speed.AGREED


def test_robots_of_the_benchmark_are_what_they_are_called() -> None:
    finite = growth.all_finite(load_robot("ir663"))
    assert compile_structure(finite).unknowns.count == 60
    welded = speed.welded(load_robot("ir663"))
    assert compile_structure(welded).unknowns.count == 30  # five free nodes of those that joints make one
    assert all(section.Iy == section.Iz for section in welded.sections.values())


def test_interpreted_runs_without_numba_and_puts_the_switch_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(compiled.SWITCH, raising=False)
    assert speed.interpreted(compiled.kernel)() is None
    monkeypatch.setenv(compiled.SWITCH, "1")
    assert speed.interpreted(compiled.kernel)() is None
    assert os.environ[compiled.SWITCH] == "1"


@pytest.mark.parametrize("solver", ["multifrontal", "condensation", "splu"])
def test_a_lattice_in_all_ways(solver: str) -> None:
    report = large_frame.run("slender", 900, solver)
    expected = large_frame.run("slender", 900, "multifrontal")
    found, known = np.array(report["compliance"]), np.array(expected["compliance"])
    assert np.abs(found - known).max() <= 1e-8 * np.abs(known).max()
    assert float(str(report["peak"])) > 1e7


def test_tables_are_written_as_markdown(capsys: pytest.CaptureFixture[str]) -> None:
    text = speed.written("Some", iter([("a", "b"), ("1", "2")]))
    assert text == "## Some\n\n| a | b |\n| --- | --- |\n| 1 | 2 |\n"
    assert "1 | 2" in capsys.readouterr().out
    before = f"# B\n\nintro\n\n{text}\n## Maps\n\n| c |\n| --- |\n"
    assert speed.others(before, [text]) == ["## Maps\n\n| c |\n| --- |\n"]


def test_work_for_peers_states_the_whole_structure() -> None:
    robot = load_robot("ir663")
    structure = compile_structure(robot)
    stated = speed._stated(structure, posture(structure.kinematics, closing_poses(robot, 3)))
    assert stated["points"].shape == (3, len(robot.nodes), 3)
    assert stated["stiffness"].shape == (len(robot.joints), 6)
    assert np.abs(np.linalg.norm(stated["axes"], axis=-1) - 1).max() <= 1e-12


def test_verdicts_hold_against_the_best_of_the_others_and_a_miss_is_called_one() -> None:
    ours = {"plain": 40.0, "peak": 7e9, "error": 1e-10}
    said = large_frame.verdicts("slender", 1e6, {"multifrontal": ours, "splu": {"plain": 50.0}})
    assert said["multifrontal"] == (
        "0.80 of splu; asked 1.5: reached; 7.0 GB, asked 6: MISSED; error 1e-10, asked 1e-09: reached"
    )
    said = large_frame.verdicts("cube", 3e5, {"condensation": {"plain": 9.0}, "multigrid": {"plain": 8.0}})
    assert said == {"condensation": "1.12 of multigrid; asked 1: MISSED"}
    assert large_frame.verdicts("cube", 1e5, {"condensation": {"plain": 9.0}}) == {}


def test_growth_is_measured_for_all_that_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "in_a_process", lambda _, size: (1e-6 * size, 1e8))
    report = {"dofs": 1000, "plain": 1.0, "peak": 1e8}
    monkeypatch.setattr(
        growth, "frame_in_a_process", lambda _, dofs, __: report | {"dofs": int(dofs), "plain": dofs}
    )
    head, *rows = list(growth.growth(large=True))
    assert len({len(row) for row in (head, *rows)}) == 1
    assert {row[4] for row in rows} == {"", "1.00"}
    assert [row[5] for row in rows if row[5]] == ["1 +- 0.05: reached"]
    assert growth.poses(300) > 0.0
    assert growth.ports(2, 300) > 0.0
