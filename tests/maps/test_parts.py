"""The folder of chunks: whose it is, what in it counts, and what a kill leaves of it."""

import io
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import files
from beamstiff.errors import BeamstiffError
from tests.maps.test_resume import computed, mapped, same, small_chunks, stopped, whole  # noqa: F401 (fixtures)

REPOSITORY = Path(__file__).resolve().parents[2]
DRAFT = f".beamstiff-{12 * 'a'}-{32 * 'b'}"


@pytest.mark.parametrize("left", [(), (DRAFT,), (DRAFT, "lock"), ("lock",)])
def test_a_folder_that_a_kill_left_before_it_held_a_job_is_taken_up(
    tmp_path: Path, left: tuple[str, ...]
) -> None:
    parts = tmp_path / "map.nc.parts"
    parts.mkdir()
    for name in left:
        (parts / name).mkdir() if name == DRAFT else (parts / name).touch()
    assert same(mapped(tmp_path / "map.nc"), whole())
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe\xff", b"[" * 100_000, b"[]", b'"text"', b"null"])
def test_a_job_that_is_broken_is_named(tmp_path: Path, content: bytes) -> None:
    parts = tmp_path / "map.nc.parts"
    parts.mkdir()
    (parts / "job.json").write_bytes(content)
    with pytest.raises(BeamstiffError, match=r"map.nc.parts.*(is broken; remove|holds chunks of another)"):
        mapped(tmp_path / "map.nc")
    assert (parts / "job.json").read_bytes() == content


def changed(chunk: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Write other arrays under a chunk's old head."""
    head, _, body = chunk.read_bytes().partition(b"\n")
    with np.load(io.BytesIO(body)) as arrays:
        values = dict(arrays)
    change(values)
    out = io.BytesIO()
    np.savez(out, **values)
    chunk.write_bytes(head + b"\n" + out.getvalue())


def lacking(one: Path, _: Path) -> None:
    changed(one, lambda values: values.pop("stiffness"))


def shifted(one: Path, _: Path) -> None:
    changed(one, lambda values: values.update(reasons=(values["reasons"] + 1).astype(np.int8)))


def damaged(one: Path, other: Path) -> None:
    one.write_bytes(one.read_bytes()[:-200])
    flipped = bytearray(other.read_bytes())
    flipped[len(flipped) // 2] ^= 0xFF
    other.write_bytes(flipped)


def in_each_others_place(one: Path, other: Path) -> None:
    a, b = one.read_bytes(), other.read_bytes()
    one.write_bytes(b)
    other.write_bytes(a)


def of_another_job(one: Path, _: Path) -> None:
    words = one.read_bytes().split(b" ", 3)
    words[2] = 64 * b"0"
    one.write_bytes(b" ".join(words))


@pytest.mark.parametrize(
    ("change", "again"),
    [
        (lacking, [1]),
        (shifted, [1]),
        (damaged, [1, 2]),
        (in_each_others_place, [1, 2]),
        (of_another_job, [1]),
    ],
)
def test_chunks_that_are_not_as_they_were_written_are_computed_again(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    computed: Counter[int],  # noqa: F811 (a fixture)
    change: Callable[[Path, Path], None],
    again: list[int],
) -> None:
    out = stopped(tmp_path, monkeypatch, 4)
    change(*(tmp_path / "map.nc.parts" / f"00000{number}.chunk" for number in (1, 2)))
    found = mapped(out)
    assert sorted(computed) == [*again, 4, 5, 6, 7, 8]
    assert same(found, whole())


def test_files_of_others_in_the_folder_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = stopped(tmp_path, monkeypatch, 2)
    (tmp_path / "map.nc.parts" / "notes.txt").write_text("mine")
    mapped(out)
    assert [path.name for path in (tmp_path / "map.nc.parts").iterdir()] == ["notes.txt"]


HOLDS = """
import sys, time
from beamstiff.maps import job, run
from tests.maps import test_resume

job.MANY = 300
compute = run.compute_chunk

def slow(one, box):
    if one.boxes.index(box) == 2:
        print("holding", flush=True)
        sys.stdin.read()
    return compute(one, box)

run.compute_chunk = slow
test_resume.mapped(sys.argv[1])
"""


def test_a_second_map_to_the_same_file_is_refused_and_a_killed_one_holds_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "PATIENCE", 0.2)
    out = tmp_path / "map.nc"
    first = subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(out)],
        cwd=REPOSITORY,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert first.stdout.readline() == "holding\n"
    begun = time.monotonic()
    with pytest.raises(
        BeamstiffError, match=r"map.nc.parts: another process is making this map: wait until it ends"
    ):
        mapped(out)
    assert time.monotonic() - begun < 10
    assert len(list((tmp_path / "map.nc.parts").glob("*.chunk"))) == 2
    first.kill()
    first.communicate()
    assert same(mapped(out), whole())
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]


def test_the_job_is_told_in_plain_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped(tmp_path, monkeypatch, 1)
    told = json.loads((tmp_path / "map.nc.parts" / "job.json").read_text())
    assert (told["format"], told["held"]["q5"]) == ("beamstiff-map-parts/2", 0.8)
