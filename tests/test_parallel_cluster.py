"""Tasks over dask's workers: two processes of a local cluster, one of them killed in the middle."""

import pickle
import socket
import time
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import parallel as module
from beamstiff.errors import BeamstiffError
from beamstiff.parallel import AHEAD, parallel_map
from tests.parallel_tasks import after_chain, chain, die, die_once, product, refuse_odd, rest

distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed (extra `cluster`)")
MATRIX = np.random.default_rng(3).normal(size=(60, 60))
WORKERS = 2


def test_workers_find_the_same_to_the_bit(scheduler: str) -> None:
    found = dict(parallel_map(partial(product, MATRIX), range(30), scheduler=scheduler))
    assert len(found) == 30
    for number, result in parallel_map(partial(product, MATRIX), range(30)):
        assert result.tobytes() == found[number].tobytes()
        assert found[number].flags.writeable


@pytest.mark.slow
def test_a_worker_killed_in_the_middle_costs_its_tasks_only(scheduler: str, tmp_path: Path) -> None:
    found = list(parallel_map(partial(die_once, tmp_path), range(60), scheduler=scheduler))
    assert (tmp_path / "died").exists()
    assert sorted(found) == [(task, task * task) for task in range(60)]
    again = sum(len(file.read_text()) - 1 for file in tmp_path.glob("done-*"))
    assert again <= AHEAD * WORKERS


def test_what_follows_from_a_result_is_done_under_the_same_number(scheduler: str) -> None:
    found = list(parallel_map(chain, range(3), scheduler=scheduler, then=after_chain))
    assert sorted(found) == [(n, n + step) for n in range(3) for step in (100, 200, 300)]


def test_an_error_is_that_of_the_task(scheduler: str) -> None:
    with pytest.raises(BeamstiffError, match=r"^row 3: found an odd number, expected an even one$"):
        list(parallel_map(refuse_odd, [2, 3, 4], scheduler=scheduler))


def test_a_task_that_no_worker_survives_is_given_up(scheduler: str) -> None:
    with pytest.raises(BeamstiffError, match="workers died of the same task; out of memory"):
        list(parallel_map(die, [1], scheduler=scheduler))


def test_whoever_breaks_off_leaves_no_tasks_behind(cluster: Any) -> None:
    results = parallel_map(rest, [0.0] + [0.2] * 40, scheduler=str(cluster.scheduler_address))
    assert len(list(islice(results, 1))) == 1
    results.close()
    end = time.monotonic() + 5
    while cluster.scheduler.tasks and time.monotonic() < end:
        time.sleep(0.05)
    assert not cluster.scheduler.tasks


def test_other_versions_are_refused(scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "__version__", "9.9")
    module._versions.cache_clear()
    try:
        with pytest.raises(
            BeamstiffError, match=r"worker tcp://\S+ has beamstiff .*, expected beamstiff 9.9"
        ):
            list(parallel_map(abs, [1], scheduler=scheduler))
    finally:
        monkeypatch.undo()
        module._versions.cache_clear()


def test_a_worker_that_comes_late_with_other_versions_is_refused(scheduler: str) -> None:
    wanted = {**module._versions(), "numpy": "1.0"}
    with distributed.Client(scheduler, set_as_default=False) as client:
        late = client.submit(module._do_there, pickle.dumps(abs), pickle.dumps(1), wanted)
        with pytest.raises(BeamstiffError, match=r"has numpy 2\S+, expected numpy 1.0 as here"):
            late.result()


def test_a_place_without_beamstiff_is_named(scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    question = pickle.dumps(module._Versions()).replace(b"beamstiff.parallel", b"beamstuff.parallel")
    assert b"beamstuff" in question
    monkeypatch.setattr(module.pickle, "dumps", lambda _: question)
    with pytest.raises(BeamstiffError, match="No module named 'beamstuff' there; install beamstiff"):
        list(parallel_map(abs, [1], scheduler=scheduler))


def test_a_scheduler_that_is_not_there_is_said_within_10_seconds() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    begun = time.monotonic()
    with pytest.raises(BeamstiffError, match=f"^--scheduler {address}: does not answer; start one: dask"):
        list(parallel_map(abs, [1], scheduler=address))
    assert time.monotonic() - begun < 10


def test_one_that_listens_and_says_nothing_is_given_up_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ANSWER", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.raises(BeamstiffError, match="does not answer"):
            list(parallel_map(abs, [1], scheduler=f"tcp://127.0.0.1:{silent.getsockname()[1]}"))


def test_a_scheduler_without_workers_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ANSWER", 0.5)
    with distributed.LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0", silence_logs=60) as empty:
        address = empty.scheduler_address
        with pytest.raises(BeamstiffError, match=f"has no workers; start some: dask worker {address}"):
            list(parallel_map(abs, [1], scheduler=address))


def test_a_scheduler_that_ends_in_the_middle_is_said() -> None:
    local = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, protocol="tcp", dashboard_address="127.0.0.1:0", silence_logs=60
    )
    with local:
        results = parallel_map(rest, [0.05] * 100, scheduler=local.scheduler_address)
        next(results)
        local.close()
        with pytest.raises(BeamstiffError, match="has stopped answering; what was written is kept"):
            list(results)


@pytest.mark.parametrize("address", ["localhost:8786", "http://localhost:8786", ""])
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(BeamstiffError, match="expected tcp://host:port or tls://host:port"):
        list(parallel_map(abs, [1], scheduler=address))
