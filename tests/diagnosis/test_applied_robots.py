"""Whatever effect a diagnosis writes at whatever robot, every function takes the file."""

from dataclasses import replace
from pathlib import Path

import pytest

from beamstiff import load_robot, robot_names
from benchmarks.applied_effects import APPLIED, ARMS, COMMANDS, RANDOM, Case, case_of, source_of, taken

GROUPS = [("kr240-2", APPLIED[at::3]) for at in range(3)]
GROUPS += [(f"{RANDOM}{at}", (APPLIED[at],)) for at in (3, 8, 13)]
ALL = [(name, effect) for name in robot_names() for effect in APPLIED]
ALL += [(f"{RANDOM}{at}", APPLIED[at % len(APPLIED)]) for at in range(ARMS)]


def check(tmp_path: Path, *cases: Case) -> None:
    """Ask everything that takes robots to take one with the effects of all cases."""
    effects = tuple(effect for case in cases for effect in case.robot.effects)
    absolute = any(case.absolute for case in cases)
    case = replace(cases[0], robot=cases[0].robot.model_copy(update={"effects": effects}), absolute=absolute)
    text, file = case.text, tmp_path / "applied.yaml"
    file.write_text(text, encoding="utf-8")
    kept = [line for line in source_of(case.name).splitlines() if "#" in line]
    assert kept
    assert all(line in text for line in kept)  # comments, and the units beside them
    assert all(text.count(f"effect: {one.effect}") == 1 for one in cases)
    robot = load_robot(file)
    assert robot.effects == effects
    expected = {*COMMANDS} - ({"compensate", "map"} if not robot.actuated else set())
    assert {*taken(case, file)} | {"identify"} == expected  # which absolute rows have none of


@pytest.mark.slow
@pytest.mark.parametrize(("name", "effects"), GROUPS)
def test_what_is_written_is_taken_by_all_readers(tmp_path: Path, name: str, effects: tuple[str, ...]) -> None:
    """Several effects at once, in one file each kind of rows."""
    found = [case for effect in effects if (case := case_of(name, effect)) is not None]
    for absolute in {case.absolute for case in found}:
        check(tmp_path, *(case for case in found if case.absolute == absolute))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "effect"), ALL)
def test_nothing_is_left_to_find_beside_what_is_written(tmp_path: Path, name: str, effect: str) -> None:
    case = case_of(name, effect)
    if case is None:
        pytest.skip("the library has no such place in this robot")
    check(tmp_path, case)
    assert case.second() == "none"
