"""ABB RAPID: robtargets wherever they stand, and that nothing but their numbers changes."""

import numpy as np
import pytest

from beamstiff.compensation.formats import rapid
from beamstiff.errors import BeamstiffError

TARGET = "[[600,500,225.3],[1,0,0,0],[1,1,0,0],[11,12.3,9E9,9E9,9E9,9E9]]"  # of the manual


def test_the_manuals_example() -> None:
    program = rapid.read(f"CONST robtarget p15 := {TARGET};", "a.mod")
    assert program.path.names == ("p15",)
    np.testing.assert_allclose(program.path.poses[0, :3, 3], [0.6, 0.5, 0.2253], atol=1e-15)
    np.testing.assert_array_equal(program.path.poses[0, :3, :3], np.eye(3))


def test_arrays_and_both_targets_of_a_circle_are_found() -> None:
    text = f"VAR robtarget q{{2}}:=[{TARGET},\n{TARGET}];\nMoveC {TARGET},\n {TARGET}, v50, z1, t;"
    path = rapid.read(text, "a.mod").path
    assert path.names == ("q{1}", "q{2}", "MoveC", "MoveC")
    assert path.lines.tolist() == [1, 2, 3, 4]


def test_targets_assigned_or_passed_on_are_found() -> None:
    text = f"p1 := {TARGET};\nMyMove {TARGET}, v10;\nq{{2}} := {TARGET};\n"
    text += f"p1.trans.z := 5;\nMoveL {TARGET},v1,z1,t;"
    program = rapid.read(text, "a.mod")
    assert program.path.names == ("p1", "robtarget", "q", "MoveL")
    assert program.path.lines.tolist() == [1, 2, 3, 5]
    assert program.notes == ("components set one by one are left as they are: line 4",)


def test_external_axes_that_are_there_are_read() -> None:
    target = TARGET.replace("11,12.3", "0.0,9E+09")
    external = rapid.read(f"p1 := {TARGET};\np2 := {target};", "a.mod").path.external
    assert external["eax_a"].tolist() == [11.0, 0.0]
    assert external["eax_b"].tolist() == [12.3, 12.3]
    assert {*external} == {"eax_a", "eax_b"}


def test_what_is_no_robtarget_is_left_alone() -> None:
    text = "\n".join(
        [
            "PERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[5,[0,0,1],[1,0,0,0],0,0,0]];",
            'PERS wobjdata w:=[FALSE,TRUE,"",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
            "CONST jointtarget j:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
            "MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,t;",
            f"CONST robtarget p := {TARGET};",
            "MoveL Offs(p,0,0,10),v100,z5,t\\WObj:=w;",
            "MoveL p,v100,z5,t\\WObj:=w2;",
        ]
    )
    program = rapid.read(text, "a.mod")
    assert program.path.names == ("p",)
    assert any("Offs and RelTool" in note and "line 6" in note for note in program.notes)
    [place] = program.places
    assert place.base is not None
    assert place.base.name == "several for p (w and w2)"
    assert place.base.pose is None
    assert place.tool is not None
    np.testing.assert_allclose(place.tool.pose[:3, 3], [0, 0, 0.1])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("[[1,2],[1,0,0,0],[0,0,0,0],[0,0,0,0,0,0]]", "a.mod:2: p: found 2 numbers for the position x, y, z"),
        ("[[1,2,3],[1,0,0],[0,0,0,0],[0,0,0,0,0,0]]", "a.mod:2: p: found 3 numbers for the quaternion"),
        ("[[1,2,3],[1,0,0,0],[0,0,0,0]]", "a.mod:2: p: found 3 parts, expected a robtarget"),
        ("[[1,2,3],[1,0,0,1],[0,0,0,0],[0,0,0,0,0,0]]", "a.mod:2: p: found a quaternion of length 1.41421"),
        ("[[1,b,3],[1,0,0,0],[0,0,0,0],[0,0,0,0,0,0]]", "a.mod:2: p: found 'b', expected a number"),
        ("[[1,2 3],[1,0,0,0],[0,0,0,0],[0,0,0,0,0,0]]", "a.mod:2: p: found '3', expected ',' or '\\]'"),
        ("[[1,2,3],[1,0,0,0]", "a.mod:2: p: found ';', expected ',' or '\\]'"),
    ],
)
def test_a_broken_target_is_named(line: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        rapid.read(f"MODULE m\nCONST robtarget p:={line};\nENDMODULE", "a.mod")


def test_a_module_without_targets_is_refused() -> None:
    with pytest.raises(BeamstiffError, match="found no target, expected robtargets"):
        rapid.read("MODULE m\nENDMODULE", "a.mod")
