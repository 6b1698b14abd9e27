"""Programs of all formats: nothing but the numbers of targets changes, and they say where to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.compensation.formats import apt, fanuc, krl, path_csv, rapid, urscript
from beamstiff.measure.orientation import KUKA

from .programs import FEWER, apt_files, krl_programs, path_tables, rapid_modules, tp_programs, ur_scripts

FORMATS = {
    "krl": (krl.read, "a.src", krl_programs()),
    "rapid": (rapid.read, "a.mod", rapid_modules()),
    "urscript": (urscript.read, "a.script", ur_scripts()),
    "fanuc": (fanuc.read, "a.ls", tp_programs()),
    "apt": (apt.read, "a.apt", apt_files()),
    "csv": (path_csv.read, "a.csv", path_tables()),
}
every_format = pytest.mark.parametrize("kind", FORMATS)
seeds = st.integers(0, 2**32 - 1)


@every_format
@FEWER
@given(data=st.data())
def test_an_unmodified_program_is_the_same_byte_for_byte(kind: str, data: st.DataObject) -> None:
    read, name, programs = FORMATS[kind]
    pieces, count = data.draw(programs)
    program = read(pieces.text, name)
    assert len(program.path) == count
    assert program.with_poses(program.path.poses) == pieces.text.encode("latin-1")


@every_format
@FEWER
@given(data=st.data(), seed=seeds)
def test_only_numbers_of_targets_change_and_they_say_where_to(
    kind: str, data: st.DataObject, seed: int
) -> None:
    read, name, programs = FORMATS[kind]
    pieces, count = data.draw(programs)
    program, random = read(pieces.text, name), np.random.default_rng(seed)
    poses = program.path.poses.copy()
    poses[:, :3, 3] += random.uniform(-2e-3, 2e-3, (count, 3))
    poses[:, :3, :3] = KUKA.rotations(random.uniform(-2e-3, 2e-3, (count, 3))) @ poses[:, :3, :3]
    content = program.with_poses(poses)
    assert pieces.pattern().fullmatch(content)
    again = read(content.decode("latin-1"), name).path
    np.testing.assert_allclose(again.poses[:, :3, 3], poses[:, :3, 3], rtol=0, atol=0.51e-6)
    if kind == "apt":  # an axis alone, where one is written
        np.testing.assert_allclose(
            again.poses[again.turns, :3, 2], poses[again.turns, :3, 2], rtol=0, atol=1e-6
        )
    else:  # 0.0001 deg, of three angles
        atol = 1e-6 if kind in ("rapid", "urscript") else 3e-6
        np.testing.assert_allclose(again.poses[:, :3, :3], poses[:, :3, :3], rtol=0, atol=atol)


@every_format
@FEWER
@given(data=st.data())
def test_targets_that_are_not_chosen_stay(kind: str, data: st.DataObject) -> None:
    read, name, programs = FORMATS[kind]
    pieces, count = data.draw(programs)
    program = read(pieces.text, name)
    which = np.array(data.draw(st.lists(st.booleans(), min_size=count, max_size=count)))
    poses = program.path.poses.copy()
    poses[:, :3, 3] += 1e-3
    again = read(program.with_poses(poses, which).decode("latin-1"), name).path.poses
    np.testing.assert_allclose(again[which], poses[which], atol=1e-6)
    np.testing.assert_array_equal(again[~which], program.path.poses[~which])
