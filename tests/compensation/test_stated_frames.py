"""Frames and tools that programs set: followed where the program holds them, else refused with a line."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff.compensation.formats import read_program
from beamstiff.errors import BeamstiffError
from beamstiff.functions.compensate import compensate
from beamstiff.se3 import Array, transform

AT = np.diag([1.0, -1.0, -1.0])  # the tool looks down
TARGET = "{X 1500,Y 100,Z 900,A 0,B 0,C 180}"
BASE, TOOL = "{X 300,Y 0,Z 50,A 90,B 0,C 0}", "{X 0,Y 0,Z 200,A 0,B 0,C 0}"
BASE_POSE = transform(np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]]), np.array([[0.3, 0, 0.05]]))[0]
TOOL_POSE = transform(np.eye(3)[None], np.array([[0, 0, 0.2]]))[0]
RAPID_TARGET = "[[100,-1200,900],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


def corrected(folder: Path, name: str, text: str, **options: Array) -> Array:
    """Return commands in the base frame of the robot, tool tip."""
    path = folder / name
    path.write_text(text)
    return compensate("kr500", path, wrench=[0, 0, -900, 0, 0, 0], **options).correction.commands


KRL = [
    f"$BASE={BASE}\n$TOOL={TOOL}\nLIN {{0}}\n",
    f"MYBASE={BASE}\nTOOL_DATA[3]={TOOL}\n$BASE=MYBASE\n$TOOL=TOOL_DATA[3]\nLIN {{0}}\n",
    f"BASE_DATA[2]={BASE}\nTOOL_DATA[3]={TOOL}\nBAS(#BASE,2)\nBAS (#TOOL,3)\nLIN {{0}}\n",
    f"BASE_DATA[2]={BASE}\nTOOL_DATA[3]={TOOL}\nDECL E6POS XP1={{0}}\n"
    "DECL FDAT FP1={TOOL_NO 3,BASE_NO 2,IPO_FRAME #BASE}\n",
    f"DECL E6POS P1={{0}}\n$BASE={BASE}\n$TOOL={TOOL}\nLIN P1\n$BASE=$NULLFRAME\n",
]
INNER = "{X 100,Y -1200,Z 900,A 0,B 0,C 180}"


def test_krl_frames_of_the_file_are_followed(tmp_path: Path) -> None:
    here = corrected(tmp_path, "b.src", f"LIN {INNER}\n", base=BASE_POSE, tool=TOOL_POSE)
    assert np.abs(corrected(tmp_path, "c.src", f"LIN {TARGET}\n") - here).max() > 0.1
    for text in KRL:
        there = corrected(tmp_path, "a.src", text.replace("{0}", INNER))
        np.testing.assert_allclose(there, here, atol=1e-9, err_msg=text)


def test_rapid_work_objects_and_tools_of_the_file_are_followed(tmp_path: Path) -> None:
    text = (
        "PERS tooldata t:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,1],[1,0,0,0],0,0,0]];\n"
        'PERS wobjdata w:=[FALSE,TRUE,"",[[300,0,0],[0.70710678,0,0,0.70710678]],[[0,0,50],[1,0,0,0]]];\n'
        f"CONST robtarget p := {RAPID_TARGET};\nConfL\\Off;\nMoveL p,v100,z5,t\\WObj:=w;\n"
    )
    here = corrected(
        tmp_path, "b.mod", f"ConfL\\Off;MoveL {RAPID_TARGET},v1,z1,tool0;", base=BASE_POSE, tool=TOOL_POSE
    )
    np.testing.assert_allclose(corrected(tmp_path, "a.mod", text), here, atol=1e-7)


def test_bases_may_differ_by_target_and_numbers_stay_in_their_own(tmp_path: Path) -> None:
    text = f"$BASE={BASE}\nLIN {INNER}\n$BASE=$NULLFRAME\nLIN {TARGET}\n"
    (tmp_path / "a.src").write_text(text)
    result = compensate("kr500", tmp_path / "a.src", wrench=[0, 0, -900, 0, 0, 0])
    (tmp_path / "b.src").write_bytes(result.content)
    moved = read_program(tmp_path / "b.src").path.poses[:, :3, 3] - [[0.1, -1.2, 0.9], [1.5, 0.1, 0.9]]
    assert (np.abs(moved[:, 2]) > 1e-4).all()
    assert (np.abs(moved[:, :2]) < 1e-3).all()
    assert result.after.max() < 1e-6


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        (
            "a.src",
            f"$BASE=BASE_DATA[2]\nLIN {TARGET}\n",
            r"base: is needed: .*a.src:1 has \$BASE = BASE_DATA\[2\]",
        ),
        (
            "a.src",
            f"$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\nLIN {TARGET}\n",
            r"base: is needed: .*BASE_DATA\[2\].* \(x=0: the robot's own base frame\); and tool is needed: "
            r".*TOOL_DATA\[1\].* \(x=0: the TCP of the robot file itself\)",
        ),
        ("a.src", f"BAS(#TOOL,4)\nLIN {TARGET}\n", r"tool: is needed: .*a.src:1 has tool 4"),
        ("a.src", f"$TOOL.Z = 5\nLIN {TARGET}\n", r"tool: is needed: .*a.src:1 has \$TOOL.Z = 5"),
        ("a.mod", f"MoveL {RAPID_TARGET},v100,z5,gun\\WObj:=wobj0;", "tool: is needed: .*a.mod:1 has gun"),
        ("a.mod", f"PDispSet d;MoveL {RAPID_TARGET},v1,z1,tool0;", "base: is needed: .*a.mod:1 has PDispSet"),
        ("a.cls", "MSYS/1,0,0,1,0,0,0,1,0\nGOTO/1500,100,900\n", "base: is needed: .*a.cls:1 has MSYS/1"),
        ("a.script", "movel(pose_trans(table, p[1.5,0.1,0.9,0,3.14,0]))", "base: is needed: .* has table"),
        ("a.src", f"$TOOL={TOOL}\nLIN {TARGET}\n$TOOL=$NULLFRAME\nLIN {TARGET}\n", "tool: .*several frames"),
    ],
)
def test_a_frame_of_unknown_place_is_refused(tmp_path: Path, name: str, text: str, what: str) -> None:
    with pytest.raises(BeamstiffError, match=what):
        corrected(tmp_path, name, text)


def test_the_place_given_holds_in_place_of_the_programs(tmp_path: Path) -> None:
    (tmp_path / "a.src").write_text(f"$BASE=BASE_DATA[2]\nLIN {INNER}\n")
    result = compensate("kr500", tmp_path / "a.src", base=BASE_POSE, tool=TOOL_POSE)
    assert "base is the given one, not $BASE = BASE_DATA[2] of the program" in result.notes


@pytest.mark.parametrize(("tool", "told"), [("{X 0,Y 0,Z 0,A 0,B 0,C 0}", True), (TOOL, False)])
def test_a_tool_of_zero_may_be_the_flange_of_the_controller(tmp_path: Path, tool: str, told: bool) -> None:
    (tmp_path / "a.src").write_text(f"$BASE=$NULLFRAME\n$TOOL={tool}\nLIN {TARGET}\n")
    result = compensate("kr500", tmp_path / "a.src", wrench=[0, 0, -900, 0, 0, 0])
    assert told == any(note.startswith("the tool of the program is zero: ") for note in result.notes)


def test_joint_lists_choose_the_posture_and_are_corrected(tmp_path: Path) -> None:
    joints = np.radians([10.0, -60, 100, 20, -50, 30])
    text = ", ".join(f"{value:.7f}" for value in joints)
    (tmp_path / "a.script").write_text(f"movej([{text}], a=1)\n")
    result = compensate("kr500", tmp_path / "a.script", wrench=[0, 0, -900, 0, 0, 0])
    assert np.abs(result.correction.q[0] - joints).max() < 0.01
    assert np.linalg.norm(result.correction.before[0, :3]) > 1e-4
    assert np.linalg.norm(result.after[0, :3]) < 2e-6
    again = read_program(tmp_path / "a.script").read_again(result.content)
    assert again.path.joints is not None
    np.testing.assert_allclose(again.path.joints[0], result.correction.q[0], atol=1e-7)
