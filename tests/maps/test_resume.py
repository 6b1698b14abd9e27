"""What a run that was cut off costs: the chunk in the air, and nothing else."""

import errno
import os
import signal
import subprocess
import sys
from collections import Counter
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from beamstiff import load_robot, map_workspace
from beamstiff.errors import BeamstiffError
from beamstiff.maps import job, parts, run
from beamstiff.maps.chunk import compute_chunk
from tests.maps.dying import always_dies, dies_once

OVER = {"q2": np.linspace(0.2, 1.2, 60), "q3": np.linspace(-2.0, -0.5, 40)}
HELD = {"q5": 0.8}
QUANTITIES = ("stiffness", "displacement")
WRENCH = (0.0, 0.0, -900.0, 0.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut maps into chunks of 300 poses."""
    monkeypatch.setattr(job, "MANY", 300)


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> Counter[int]:
    """Return how often each chunk is computed."""
    count: Counter[int] = Counter()

    def counted(one: job.Job, box: Any) -> Any:
        count[one.boxes.index(box)] += 1
        return compute_chunk(one, box)

    monkeypatch.setattr(run, "compute_chunk", counted)
    return count


def mapped(out: Path | None = None, **options: Any) -> xarray.Dataset:
    return map_workspace(
        load_robot("kr240-2"), OVER, held=HELD, quantities=QUANTITIES, wrench=WRENCH, out=out, **options
    )


@cache
def whole() -> xarray.Dataset:
    """Return the map as it is made at once."""
    return mapped()


def same(a: xarray.Dataset, b: xarray.Dataset) -> bool:
    return all(a[name].values.tobytes() == b[name].values.astype(a[name].dtype).tobytes() for name in a)


KILLED = """
import os, signal, sys
import numpy as np
from beamstiff.maps import job, run
from tests.maps import test_resume

job.MANY = 300
log, out = sys.argv[1:]
compute = run.compute_chunk

def counted(one, box):
    with open(log, "a") as file:
        print(one.boxes.index(box), file=file)
    if sum(1 for _ in open(log)) in (3, 6):
        os.kill(os.getpid(), signal.SIGKILL)
    return compute(one, box)

run.compute_chunk = counted
for _ in range(2):
    if not (child := os.fork()):
        test_resume.mapped(out)
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), os.path.exists(out))
"""


def test_a_kill_costs_the_chunk_in_the_air_alone(tmp_path: Path, computed: Counter[int]) -> None:
    log, out = tmp_path / "log", tmp_path / "map.nc"
    ended = subprocess.run(  # killed twice, each time in the third chunk that it computes
        [sys.executable, "-c", KILLED, str(log), str(out)],
        cwd=Path(__file__).resolve().parents[2],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    assert ended.stdout.split() == [f"{-signal.SIGKILL}", "False"] * 2, ended.stderr
    assert [int(line) for line in log.read_text().split()] == [0, 1, 2, 2, 3, 4]
    found = mapped(out)
    assert sorted(computed.elements()) == [4, 5, 6, 7, 8]
    assert not (tmp_path / "map.nc.parts").exists()
    assert [path.name for path in tmp_path.iterdir() if path != log] == ["map.nc"]
    assert same(found, whole())
    with xarray.open_dataset(out) as written:
        assert same(found, written)


def test_processes_change_no_bit_and_one_that_is_killed_costs_what_it_had(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(run, "compute_chunk", partial(dies_once, tmp_path, 26))
        assert same(mapped(tmp_path / "map.nc", processes=2), whole())
    assert (tmp_path / "died").exists()
    monkeypatch.setattr(run, "compute_chunk", always_dies)
    with pytest.raises(BeamstiffError, match="one of the processes was killed"):
        mapped(tmp_path / "map.nc", processes=2)


def test_the_workers_of_a_cluster_change_no_bit(tmp_path: Path, scheduler: str) -> None:
    assert same(mapped(tmp_path / "map.nc", scheduler=scheduler), whole())


def test_a_finished_map_leaves_nothing_but_itself_and_may_be_made_again(tmp_path: Path) -> None:
    first = mapped(tmp_path / "map.nc")
    before = (tmp_path / "map.nc").read_bytes()
    mapped(tmp_path / "map.nc")
    assert (tmp_path / "map.nc").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]
    assert first.sizes == {"q2": 60, "q3": 40, "motion": 6}


def stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int) -> Path:
    """Return the file of a map that Ctrl-C stopped."""

    def stop(one: job.Job, box: Any) -> Any:
        if box == one.boxes[after]:
            raise KeyboardInterrupt
        return compute_chunk(one, box)

    with monkeypatch.context() as patched:
        patched.setattr(run, "compute_chunk", stop)
        with pytest.raises(KeyboardInterrupt):
            mapped(tmp_path / "map.nc")
    assert len(list((tmp_path / "map.nc.parts").glob("*.chunk"))) == after
    return tmp_path / "map.nc"


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"held": {"q5": 0.9}}, "held"),
        ({"quantities": ["stiffness"]}, "quantities"),
        ({"wrench": [0, 0, -901, 0, 0, 0]}, "wrench"),
        ({"over": {**OVER, "q2": np.linspace(0.2, 1.3, 60)}}, "grid"),
        ({"gravity": True}, "gravity"),
        ({"robot": load_robot("kr240-2").with_parameters({"J1.torsional": 1e6})}, "robot"),
    ],
)
def test_chunks_of_another_map_are_refused_by_what_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any], named: str
) -> None:
    out = stopped(tmp_path, monkeypatch, 2)
    usual = {
        "robot": load_robot("kr240-2"),
        "over": OVER,
        "held": HELD,
        "quantities": QUANTITIES,
        "wrench": WRENCH,
    }
    with pytest.raises(BeamstiffError, match=rf"map.nc.parts: holds chunks of another map: {named} was"):
        map_workspace(**{**usual, **change}, out=out)


def test_a_full_disk_loses_no_finished_chunk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, computed: Counter[int]
) -> None:
    write = parts.write_whole

    def full(path: Path, content: Any) -> None:
        if path.name == "000003.chunk":
            raise BeamstiffError(f"{path}: cannot be written: {os.strerror(errno.ENOSPC).lower()}")
        write(path, content)

    with monkeypatch.context() as patched:
        patched.setattr(parts, "write_whole", full)
        with pytest.raises(BeamstiffError) as refused:
            mapped(tmp_path / "map.nc")
    assert "no space left on device; 800 of 2400 poses are kept" in str(refused.value)
    assert sorted(computed) == [0, 1, 2, 3]
    mapped(tmp_path / "map.nc")
    assert max(computed.values()) == 2
    assert [number for number, times in computed.items() if times == 2] == [3]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_disk_that_is_full_at_the_end_keeps_all_chunks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, computed: Counter[int]
) -> None:
    def full(self: xarray.Dataset, *_: Any, **__: Any) -> None:
        with open("/dev/full", "wb") as file:
            file.write(b"0")

    with monkeypatch.context() as patched:
        patched.setattr(xarray.Dataset, "to_netcdf", full)
        with pytest.raises(BeamstiffError, match="no space left on device; 2400 of 2400 poses are kept"):
            mapped(tmp_path / "map.nc")
    mapped(tmp_path / "map.nc")
    assert set(computed.values()) == {1}


def test_memory_is_foreseen_and_what_would_fit_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "free_bytes", lambda: 1e9)
    over = {name: np.linspace(0.2, 1.2, 300) for name in ("q1", "q2", "q3")}
    with pytest.raises(BeamstiffError) as refused:
        map_workspace(load_robot("kr240-2"), over, held=HELD, quantities=["compliance"])
    told = str(refused.value)
    assert told.startswith("a map of 27000000 poses needs 7.8 GB of memory, 0.9 GB are free: about ")
    fitting = int(told.split("about ")[1].split()[0])
    assert 2e6 < fitting < 4e6


def test_a_disk_too_small_is_foreseen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = run.shutil.disk_usage(tmp_path)
    monkeypatch.setattr(run.shutil, "disk_usage", lambda _: usage._replace(free=100_000))
    with pytest.raises(BeamstiffError, match=r"needs .* GB of disk .* would fit"):
        mapped(tmp_path / "map.nc")
    assert list(tmp_path.iterdir()) == []


def test_the_memory_foreseen_is_what_a_chunk_takes() -> None:
    """Peak of a chunk, by tracemalloc, is below what is set aside for one process, and not far below."""
    import tracemalloc

    for name, over, held in (
        ("kr240-2", {"q2": np.linspace(0.2, 1.2, 64), "q3": np.linspace(-2.0, -0.5, 64)}, HELD),
        ("ir663", {"q2": np.linspace(-0.5, 0.8, 64), "q8": np.linspace(0.4, 1.2, 64)}, {}),
    ):
        one = job.build_job(load_robot(name), over, held, quantities=["compliance", "kappa"], length=0.7)
        points = one.grid.points((slice(64), slice(64)))
        run.compute_poses(one, points)  # programs are written down once
        tracemalloc.start()
        run.compute_poses(one, points)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        set_aside = run.working_bytes(one)
        assert 0.2 * set_aside < peak < set_aside, name
