"""Whatever effect a diagnosis writes at whatever robot, every function takes the file."""

from pathlib import Path

import pytest

from beamstiff import load_robot
from beamstiff.robot.library import robot_names
from benchmarks.applied_effects import APPLIED, ARMS, COMMANDS, RANDOM, Case, case_of, source_of, taken

QUICK = [("kr240-2", effect) for effect in APPLIED] + [(f"{RANDOM}{at}", APPLIED[at]) for at in (3, 8, 13)]
ALL = [(name, effect) for name in robot_names() for effect in APPLIED]
ALL += [(f"{RANDOM}{at}", APPLIED[at % len(APPLIED)]) for at in range(ARMS)]


def applied(name: str, effect: str) -> Case:
    found = case_of(name, effect)
    if found is None:
        pytest.skip("the library has no such place in this robot")
    return found


def check(tmp_path: Path, case: Case) -> None:
    text, file = case.text, tmp_path / "applied.yaml"
    file.write_text(text, encoding="utf-8")
    kept = [line for line in source_of(case.name).splitlines() if "#" in line]
    assert kept
    assert all(line in text for line in kept)  # comments, and the units beside them
    assert text.count(f"effect: {case.effect}") == 1
    robot = load_robot(file)
    assert robot.effects == case.robot.effects
    expected = {*COMMANDS} - ({"compensate", "map"} if not robot.actuated else set())
    assert {*taken(case, file)} | {"identify"} == expected  # which absolute rows have none of


@pytest.mark.parametrize(("name", "effect"), QUICK)
def test_what_is_written_is_taken_by_all_that_reads_robots(tmp_path: Path, name: str, effect: str) -> None:
    check(tmp_path, applied(name, effect))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "effect"), ALL)
def test_nothing_is_left_to_find_beside_what_is_written(tmp_path: Path, name: str, effect: str) -> None:
    case = applied(name, effect)
    check(tmp_path, case)
    assert case.second() == "none"
