"""APT cutter location files: GOTO in its units, and that nothing but its numbers changes."""

import numpy as np
import pytest

from beamstiff.compensation.formats import apt
from beamstiff.errors import BeamstiffError


@pytest.mark.parametrize(
    ("unit", "metres"), [("MM", 1e-3), ("INCHES", 0.0254), ("IN", 0.0254), ("CM", 0.01), ("FEET", 0.3048)]
)
def test_units(unit: str, metres: float) -> None:
    path = apt.read(f"GOTO/1,0,0\nUNITS/{unit}\nGOTO/1,0,0", "a.apt").path
    np.testing.assert_allclose(path.poses[:, 0, 3], [1e-3, metres], rtol=1e-15)


def test_without_an_axis_the_last_one_holds_and_is_not_written() -> None:
    program = apt.read("GOTO/1,2,3\nGOTO/1,2,3,1,0,0\nGOTO/4,5,6", "a.apt")
    np.testing.assert_allclose(program.path.poses[:, :3, 2], [[0, 0, -1], [-1, 0, 0], [-1, 0, 0]], atol=0)
    assert program.path.turns.tolist() == [False, True, False]


def test_a_text_that_ends_with_a_dollar_swallows_no_target() -> None:
    assert len(apt.read("PPRINT 5 $\nGOTO/1,2,3\n", "a.apt").path) == 1


def test_coordinates_that_are_set_are_told() -> None:
    program = apt.read("MSYS/100,0,0,1,0,0,0,1,0\nGOTO/1,2,3\nTRANS/0,0,5\nMSYS/0,0,0,1,0,0,0,1,0", "a.cls")
    [place] = program.places
    assert place.base is not None
    assert (place.base.name, place.base.line, place.base.pose) == ("MSYS/100,0,0,1,0,0,0,1,0", 1, None)


def test_other_motions_are_told() -> None:
    program = apt.read("FROM/0,0,0\nGODLTA/0,0,1\nGOTO/1,2,3\nCIRCLE/0,0,0,0,0,1,5", "a.apt")
    assert len(program.path) == 1
    assert [note.split(" is")[0] for note in program.notes] == ["FROM", "GODLTA", "CIRCLE"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("GOTO/1,2", "a.apt:2: GOTO 1: found 2 numbers, expected 3"),
        ("GOTO/1,2,3,4", "a.apt:2: GOTO 1: found 4 numbers, expected 3"),
        ("GOTO/1,P1,3", "a.apt:2: GOTO 1: found 'P1', expected a number"),
        ("GOTO/1,2,3,0,0,2", "a.apt:2: GOTO 1: found a tool axis of length 2"),
        ("UNITS/PARSEC", "a.apt:2: found UNITS/PARSEC, expected one of MM"),
        ("", "a.apt: found no target"),
    ],
)
def test_a_broken_line_is_named(line: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        apt.read(f"PARTNO X\n{line}\nFINI", "a.apt")
