"""APT cutter location files: GOTO in its units, and that nothing but its numbers changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.compensation.formats import apt
from beamstiff.errors import BeamstiffError

from .programs import (
    BLANKS,
    ENDS,
    FEWER,
    REMARKS,
    Pieces,
    check_moved,
    check_unmodified,
    joined,
    number_texts,
)

AXES = (("0", "0", "1"), ("0.6", "0.0", "8.0E-01"), ("-.7071068", "0", ".7071068"), ("1.", "0", "0"))


@st.composite
def programs(draw: st.DrawFn) -> tuple[Pieces, int]:
    """Return an APT file and its number of targets."""
    end, count = draw(ENDS), draw(st.integers(1, 4))
    lines = [["PARTNO " + draw(REMARKS).replace("$", "")], ["MULTAX/ON"], ["FROM/0,0,100"]]
    for _ in range(count):
        line = [draw(st.sampled_from(["GOTO/", "goto / ", "  GOTO/\t", "12 GOTO /"]))]
        for at in range(3):
            line[-1] += draw(BLANKS)
            line += [draw(number_texts(900.0)), draw(BLANKS) + ("," if at < 2 else "")]
        if draw(st.booleans()):
            line[-1] += "," + draw(st.sampled_from(["", "$" + end + "   "]))
            for at, text in enumerate(draw(st.sampled_from(AXES))):
                line += [text, draw(BLANKS) + ("," if at < 2 else "")]
        line[-1] += draw(st.sampled_from(["", " $$ 1,2,3 ", "$$"]))
        lines.append(line)
        lines.append(
            [draw(st.sampled_from(["", "FEDRAT/20,MMPM", "PPRINT GOTO/1,2", "$$ GOTO/1,2,3", "RAPID"]))]
        )
    return joined([*lines, ["FINI"]], end), count


@FEWER
@given(programs())
def test_an_unmodified_file_is_the_same_byte_for_byte(made: tuple[Pieces, int]) -> None:
    pieces, count = made
    check_unmodified(apt.read(pieces.text, "a.apt"), pieces, count)


@FEWER
@given(programs(), st.integers(0, 2**32 - 1))
def test_only_numbers_of_targets_change_and_they_say_where_to(made: tuple[Pieces, int], seed: int) -> None:
    pieces, _ = made
    poses, again = check_moved(apt.read(pieces.text, "a.apt"), pieces, seed)
    turned = again.turns
    np.testing.assert_allclose(again.poses[turned, :3, 2], poses[turned, :3, 2], rtol=0, atol=1e-6)


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
    assert program.frames == ("line 1 sets MSYS", "line 3 sets TRANS")


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
