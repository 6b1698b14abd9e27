"""FANUC TP programs: positions of group 1, their frames, and what is refused."""

import numpy as np
import pytest

from beamstiff.compensation.formats import fanuc
from beamstiff.errors import BeamstiffError

HEAD = "/PROG  A\n/MN\n   1:J P[1] 100% FINE Offset,PR[1]    ;\n/POS\n"
POINT = """P[1:"pick"]{
   GP1:
	UF : 0, UT : 2,		CONFIG : 'N U T, 0, 0, 0',
	X =   500.000  mm,	Y =     -.500  mm,	Z =   300.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =    90.000 deg
   GP2:
	UF : 0, UT : 2,
	J1=     6.378 deg
};
"""
JOINTS = """P[2]{
   GP1:
	UF : 0, UT : 2,
	J1=     0.000 deg,	J2=   -30.000 deg,	J3=     0.000 deg
};
"""


def test_positions_are_millimetres_and_turns_about_fixed_axes() -> None:
    program = fanuc.read(f"{HEAD}{POINT}{JOINTS}/END\n", "a.ls")
    assert program.path.names == ("P1",)
    pose = program.path.poses[0]
    np.testing.assert_allclose(pose[:3, 3], [0.5, -0.0005, 0.3])
    # W first, about x; then R about the fixed z
    np.testing.assert_allclose(pose[:3, :3], [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)
    assert program.notes == (
        "positions in joint values are left as they are: P2",
        "offsets and INC are left as they are, first in line 3",
    )


def test_frame_0_is_the_robots_own_and_others_are_unknown() -> None:
    [place] = fanuc.read(f"{HEAD}{POINT}/END\n", "a.ls").places
    assert place.base is not None
    assert place.tool is not None
    np.testing.assert_array_equal(place.base.pose, np.eye(4))
    assert (place.tool.name, place.tool.pose) == ("UT : 2", None)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("500.000  mm", "********  mm", r"a.ls:8: P1: X: found '\*+', expected a number"),
        ("500.000  mm", "500.000 deg", r"a.ls:8: P1: X: found deg, expected mm"),
        ("R =    90.000 deg", "", r"a.ls:6: P1: found no R, expected all of X, Y, Z, W, P, R"),
        ("GP1", "GP3", r"a.ls: found no target"),
    ],
)
def test_a_position_that_is_none_is_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        fanuc.read(f"{HEAD}{POINT.replace(old, new)}/END\n", "a.ls")
