"""Programs with a few characters changed are read or refused in one line, never anything else."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff.compensation.formats import Program, apt, krl, path_csv, rapid
from beamstiff.errors import BeamstiffError

SAMPLES: dict[str, tuple[Callable[[str, str], Program], str]] = {
    "krl": (
        krl.read,
        "$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\nLIN {X 1,Y 2.5,Z 3e2,A 1,B 90,C 3}\nPTP {X 1,Y 2,Z 3} ; x\n",
    ),
    "rapid": (
        rapid.read,
        "CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]; ! x\n",
    ),
    "apt": (apt.read, "UNITS/MM\nGOTO/1,2,$\n3,0,0,1 $$ x\nGOTO/4,5,6\n"),
    "csv": (path_csv.read, '# orientation: KUKA ABC\nname,x [mm],y,z,a [deg],b,c,fz\n"a,b",1,2,3,4,5,6,-7\n'),
}
CHARACTERS = '0123456789.,;+-eE{}[]()/$!"#XYZabc=: \t\n\r\xe9'


@pytest.mark.parametrize("name", SAMPLES)
@settings(max_examples=150)
@given(data=st.data())
def test_a_program_with_slips_is_read_or_refused(name: str, data: st.DataObject) -> None:
    read, text = SAMPLES[name]
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        cut = data.draw(st.integers(0, 2))
        text = text[:at] + data.draw(st.text(CHARACTERS, max_size=2)) + text[at + cut :]
    program, refusal = _read(read, text)
    if program is None:
        assert refusal.startswith("file")
        assert "\n" not in refusal
        return
    assert np.isfinite(program.path.poses).all()
    assert program.with_poses(program.path.poses) == text.encode("latin-1")
    moved = program.path.poses.copy()
    moved[:, :3, 3] += 1e-3
    again = program.read_again(program.with_poses(moved))
    np.testing.assert_allclose(again.path.poses[:, :3, 3], moved[:, :3, 3], atol=1e-6)


def _read(read: Callable[[str, str], Program], text: str) -> tuple[Program | None, str]:
    try:
        return read(text, "file"), ""
    except BeamstiffError as error:
        return None, str(error)
