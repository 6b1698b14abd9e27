"""URScript: which poses and joint lists are targets, in which frame and of which tool."""

import numpy as np
import pytest

from beamstiff.compensation.formats import urscript
from beamstiff.errors import BeamstiffError

PROGRAM = """def cell():
  global plane = p[0.5,0,0,0,0,1.5707963]
  set_tcp(p[0,0,0.1,0,0,0])
  movej([0, -1.57, 1.57, d2r(-90), 1.57, 0], a=1.4, v=1.05)
  global P1 = p[.4, -.2, .3, 0, 3.14, 0]
  movel(P1, a=1.2, v=0.25)
  movel(pose_trans(plane, p[0.1, 0, 0, 0, 0, 0]))
  movel(pose_trans(get_actual_tcp_pose(), p[0, 0, 0.05, 0, 0, 0]))
  movel(pose_add(P1, p[0, 0, 0.05, 0, 0, 0]))
  set_tcp(p[0,0,0.2,0,0,0])
  movec(p[0.4,0.1,0.3,0,3.14,0], p[0.4,0.2,0.3,0,3.14,0], a=1, v=0.1) # p[1,1,1,0,0,0]
  movej(get_inverse_kin(p[0.4,0.3,0.3,0,3.14,0], qnear=[0,0,0,0,0,0]))
  q7 = [1,2,3,4,5,6]
  spare = p[9,9,9,0,0,0]
end
"""


def test_targets_are_what_motions_go_to() -> None:
    program = urscript.read(PROGRAM, "a.script")
    assert program.path.lines.tolist() == [4, 5, 7, 11, 11, 12]
    assert program.path.names == ("movej", "P1", "movel", "movec", "movec", "movej")
    np.testing.assert_allclose(program.path.poses[1, :3, 3], [0.4, -0.2, 0.3])
    assert program.path.joints is not None
    np.testing.assert_allclose(program.path.joints[0], [0, -1.57, 1.57, -np.pi / 2, 1.57, 0])
    assert np.isnan(program.path.joints[1:]).all()
    said = " | ".join(program.notes)
    assert "motions from where the robot is are left as they are, first in line 8" in said
    assert "poses that are computed are left as they are, first in line 9" in said
    assert "poses that no motion goes to are left as they are, first in line 14" in said


def test_frames_and_tools_are_those_that_hold_at_the_motion() -> None:
    places = urscript.read(PROGRAM, "a.script").places
    tools = [place.tool.pose[2, 3] for place in places]
    np.testing.assert_allclose(tools, [0.1, 0.1, 0.1, 0.2, 0.2, 0.2])
    assert [place.base is not None for place in places] == [False, False, True, False, False, False]
    base = places[2].base
    assert base is not None
    assert base.pose is not None
    np.testing.assert_allclose(base.pose @ [0.1, 0, 0, 1], [0.5, 0.1, 0, 1], atol=1e-7)


@pytest.mark.parametrize("frame", ["plane = p[0,0,0,0,0,0]\nplane = p[0,0,1,0,0,0]", "plane = get_it()"])
def test_a_frame_that_the_script_does_not_hold_is_unknown(frame: str) -> None:
    [place] = urscript.read(f"{frame}\nmovel(pose_trans(plane, p[0,0,0,0,0,0]))\n", "a.script").places
    assert place.base is not None
    assert (place.base.name, place.base.pose) == ("plane", None)


def test_joint_values_are_written_in_their_unit() -> None:
    program = urscript.read(PROGRAM, "a.script")
    joints = np.full((6, 6), np.nan)
    joints[0] = [0.1, -1.5, 1.5, -1.5, 1.5, 0.2]
    which = np.array([True, False, False, False, False, False])
    new = program.with_poses(program.path.poses, which, joints).decode().splitlines()
    old = PROGRAM.splitlines()
    assert [at for at, (a, b) in enumerate(zip(old, new, strict=True)) if a != b] == [3]
    assert "d2r(-85.9436693)" in new[3]


def test_a_script_without_targets_is_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"a.script: found no target, expected motions such as movel"):
        urscript.read("def f():\n  textmsg(1)\nend\n", "a.script")
