"""KUKA KRL: which literals are targets, and that nothing but their numbers changes."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff.compensation.formats import krl, read_program
from beamstiff.compensation.formats.krl_frames import Literals
from beamstiff.errors import BeamstiffError


def test_values_are_millimetres_and_degrees() -> None:
    pose = krl.read("LIN {X 1500,Y -20.25,Z 9.0E+02,A 90,B 0,C 0}", "a.src").path.poses[0]
    np.testing.assert_allclose(pose[:3, 3], [1.5, -0.02025, 0.9], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 0], [0, 1, 0], atol=1e-15)


def test_literals_in_motions_are_called_by_motion_and_line() -> None:
    text = f"XP1={LITERAL}\nLIN {LITERAL}\n\nlin {LITERAL} C_DIS\nPTP XP1\nCIRC {LITERAL},{LITERAL}\n"
    program = krl.read(text, "a.src")
    assert program.path.names == ("XP1", "LIN 2", "LIN 4", "CIRC 6", "CIRC 6")
    assert program.only(["LIN 4"]).path.lines.tolist() == [4]
    assert program.only(["lin *"]).path.lines.tolist() == [2, 4]
    with pytest.raises(BeamstiffError, match=r"found no target 'LIN 3' .*, it has XP1, LIN 2, LIN 4, CIRC 6"):
        program.only(["LIN 3"])


def test_what_is_no_target_is_left_alone() -> None:
    text = "\n".join(
        [
            "$BASE={FRAME: X 10,Y 0,Z 0,A 0,B 0,C 0}",
            "$TOOL = {X 0,Y 0,Z 100,A 0,B 0,C 0}",
            "BASE_DATA[1]={X 1,Y 2,Z 3,A 0,B 0,C 0}",
            "TOOL_DATA[16]={X 1,Y 2,Z 3,A 0,B 0,C 0}",
            "LOAD_DATA[1]={M 5,CM {X 0,Y 0,Z 1,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}",
            "DECL LDAT LP1={VEL 2.0,ACC 100,APO_DIST 100}",
            "LIN_REL {X 10,Y 0,Z 0}",
            "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}",
            "; LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}",
            "DECL E6POS XP7={X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 2}",
        ]
    )
    program = krl.read(text, "a.dat")
    assert program.path.names == ("XP7",)
    assert program.path.lines.tolist() == [10]
    said = " | ".join(program.notes)
    assert "frames, tools and loads are left as they are: lines 3, 4, 5" in said
    assert "relative motions are left as they are: line 7" in said
    assert "axis values are left as they are: line 8" in said


def test_what_is_combined_or_set_in_parts_is_told() -> None:
    text = "\n".join(
        [
            "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}",
            "LIN XP1:{X 0,Y 0,Z 10,A 0,B 0,C 0}",
            "XP2={X 0,Y 0,Z 10,A 0,B 0,C 0}:XP1",
            "XP1.X = XP1.X + 100",
            "SETBASE({X 1,Y 2,Z 3,A 0,B 0,C 0})",
        ]
    )
    program = krl.read(text, "a.src")
    assert program.path.lines.tolist() == [1]
    said = " | ".join(program.notes)
    assert "frames combined by ':' are left as they are: lines 2, 3" in said
    assert "components set one by one are left as they are: line 4" in said
    assert "neither moved to nor given a name are left as they are: line 5" in said


def test_a_position_alone_keeps_the_orientation_before_it() -> None:
    program = krl.read("LIN {X 1,Y 2,Z 3,A 30,B 0,C 0}\nLIN {X 2,Y 2,Z 3}\n", "a.src")
    assert program.path.turns.tolist() == [True, False]
    np.testing.assert_array_equal(program.path.poses[1, :3, :3], program.path.poses[0, :3, :3])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("XP1={X 1,Y 2,Z 3,A 0,B 0}", r"a.dat:2: XP1: found no C, expected all of X, Y, Z, A, B, C"),
        ("XP1={X 1,Y abc,Z 3,A 0,B 0,C 0}", r"a.dat:2: XP1: Y: found 'abc', expected a number"),
        ("XP1={X 1,5,Y 2,Z 3,A 0,B 0,C 0}", r"a.dat:2: XP1: found '5', .*decimals follow a point"),
        ("XP1={X 1,Y,Z 3,A 0,B 0,C 0}", r"a.dat:2: XP1: found 'Y', expected a component such as X 12.5"),
        ("XP1={X 1,X 2,Y 2,Z 3,A 0,B 0,C 0}", r"a.dat:2: XP1: X: found twice"),
        ("XP1={X 1,Y 2,Z 3,A 0,B 0,C 0", r"a.dat:2: found .* expected a closing '}'"),
        ("XP1=X 1,Y 2,Z 3,A 0,B 0,C 0}{", r"a.dat:2: found '}' without '{'"),
        ("XP1={X 1e9,Y 2,Z 3,A 0,B 0,C 0}", r"a.dat:2: XP1: found a position 1e\+06 m away"),
        ("XP1={X 1,Y 2,Z 3,A 1e300,B 0,C 0}", r"a.dat:2: XP1: found an angle of more than 100 turns"),
        ("XP1={X 1e999,Y 2,Z 3,A 0,B 0,C 0}", r"a.dat:2: XP1: found a number that is not finite"),
        ("LIN {X 1,Y 2}", r"a.dat:2: LIN: found no Z, A, B, C"),
        ("", r"a.dat: found no target"),
    ],
)
def test_a_broken_line_is_named(line: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        krl.read(f"DEF a()\n{line}\nEND", "a.dat")


LITERAL = "{X 1500,Y 0,Z 900,A 0,B 90,C 0}"


@pytest.mark.parametrize(
    ("frame", "rest"),
    [
        (f"MYBASE={LITERAL}", "$BASE=MYBASE"),
        (f"DECL FRAME MYTOOL={LITERAL}", "  $tool = mytool"),
        (f"TABLE={LITERAL}", "BASE_DATA[2] = TABLE"),
        (f"TABLE[1]={LITERAL}", "$BASE = ROOM:TABLE[1]"),
        (f"DECL GLOBAL FRAME ELSEWHERE={LITERAL}", "; the $BASE of another file"),
        (f"ELSEWHERE={LITERAL}", "DECL FRAME OTHER, ELSEWHERE"),
    ],
)
def test_a_variable_that_is_a_base_or_a_tool_is_no_target(frame: str, rest: str) -> None:
    program = krl.read(f"{frame}\n{rest}\nLIN {LITERAL}\n", "a.src")
    assert program.path.names == ("LIN 3",)
    assert "frames, tools and loads are left as they are: line 1" in program.notes


def test_a_frame_that_a_motion_goes_to_is_a_target() -> None:
    program = krl.read(f"DECL FRAME P1={LITERAL}\nLIN P1 C_DIS\n", "a.src")
    assert program.path.names == ("P1",)


def test_external_axes_are_read_and_stay_where_a_target_does_not_state_them() -> None:
    text = f"XP1={LITERAL[:-1]},S 2,T 35,E1 0.0,E2 -5E-1}}\nXP2={LITERAL}\nXP3={LITERAL[:-1]},E1 1500}}\n"
    external = krl.read(text, "a.dat").path.external
    assert {name: values.tolist() for name, values in external.items()} == {
        "E1": [0.0, 0.0, 1500.0],
        "E2": [-0.5, -0.5, -0.5],
    }


SRC = (
    "&ACCESS RVP\r\nDEF CELL ( )\r\n;FOLD PTP P2\r\nFDAT_ACT=FP2\r\nPTP XP2\r\n;ENDFOLD\r\n"
    "LIN {X 1500,Y -50,Z 900,A 0,B 110,C 0}\r\nLIN XP1 C_DIS\r\nPTP XHOME\r\nEND"
)
DAT = (
    "DEFDAT CELL\n;gr\xfc\xdfe\nDECL E6POS XP1={X 1500.0,Y   100,Z 900,A 0.0,B 110.0,C 0.0,S 2,T 35,E1 0.0}\n"
    "DECL FDAT FP1={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}\nDECL FDAT FP2={TOOL_NO 1,BASE_NO 3}\n"
    "DECL E6POS XP2={X 1500.0,Y -200.0,Z 900,A 0.0,B 110.0,C 0.0,S 2,T 35}\n"
    "DECL E6POS XP3={X 9.0,Y ********,Z 900,A 0.0,B 110.0,C 0.0}\nENDDAT\n"
)


def pair(folder: Path) -> Path:
    """Write a program whose points stand in its .dat; return the .src."""
    (folder / "cell.dat").write_bytes(DAT.encode("latin-1"))
    (folder / "cell.src").write_bytes(SRC.encode("latin-1"))
    return folder / "cell.src"


def test_points_of_the_dat_are_targets_in_the_order_of_the_motions(tmp_path: Path) -> None:
    program = read_program(pair(tmp_path))
    assert program.path.names == ("XP2", "LIN 7", "XP1")  # XP3 is moved to by nobody
    assert [Path(one).name for one in program.path.files] == ["cell.dat", "cell.src", "cell.dat"]
    assert program.path.lines.tolist() == [6, 7, 3]
    assert program.path.place(2).endswith("cell.dat:3: XP1")
    np.testing.assert_allclose(program.path.poses[:, 1, 3], [-0.2, -0.05, 0.1], atol=1e-15)
    postures = [None if place.posture is None else place.posture.text for place in program.places]
    assert postures == ["S 2, T 35", None, None]  # LIN does not look at S and T
    assert [place.base.name if place.base else None for place in program.places] == ["base 3"] * 2 + [
        "base 0"
    ]


def test_both_files_are_written_and_only_numbers_of_targets_change(tmp_path: Path) -> None:
    program = read_program(pair(tmp_path))
    same = program.files(program.with_poses(program.path.poses))
    assert same == (SRC.encode("latin-1"), DAT.encode("latin-1"))
    poses = program.path.poses.copy()
    poses[:, 1, 3] += 1e-3
    content = program.with_poses(poses)
    src, dat = program.files(content)
    assert src == SRC.replace("Y -50", "Y -49.000").encode("latin-1")
    moved = DAT.replace("Y   100", "Y 101.000").replace("Y -200.0", "Y -199.000")
    assert dat == moved.encode("latin-1")
    np.testing.assert_allclose(program.read_again(content).path.poses, poses, atol=1e-9)


def test_a_fault_in_the_dat_is_told_with_its_file(tmp_path: Path) -> None:
    source = pair(tmp_path)
    source.write_bytes(SRC.replace("XHOME", "XP3").encode("latin-1"))
    with pytest.raises(BeamstiffError, match=r"cell\.dat:7: XP3: Y: found '\*+', expected a number"):
        read_program(source)


def test_a_dat_whose_points_no_motion_goes_to_is_left_aside(tmp_path: Path) -> None:
    source = pair(tmp_path)
    text = SRC.replace("XP2", "XQ2").replace("XP1", "XQ1")
    source.write_bytes(text.encode("latin-1"))
    program = read_program(source)
    assert program.path.names == ("LIN 7",)
    assert program.files(program.with_poses(program.path.poses)) == (text.encode("latin-1"), None)


def test_a_frame_with_a_number_that_is_none_is_unknown() -> None:
    literals = Literals("FRAME F\nF={X 1.0,Y .,Z 3.0,A 0,B 0,C 0}\nG={X 1.0,Y .5,Z 3.0,A 0,B 0,C 0}")
    assert literals.pose("F") is None
    pose = literals.pose("G")
    assert pose is not None
    assert pose[:3, 3] == pytest.approx([1e-3, 5e-4, 3e-3])
