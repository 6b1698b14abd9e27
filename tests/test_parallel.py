"""Tasks over processes: the same results, the same errors, and nobody left behind."""

import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.parallel import AHEAD, parallel_map
from tests.parallel_tasks import after_chain, chain, die, product, refuse_odd, where

MATRIX = np.random.default_rng(3).normal(size=(60, 60))


def test_processes_find_the_same_to_the_bit() -> None:
    alone = list(parallel_map(partial(product, MATRIX), range(20)))
    assert [number for number, _ in alone] == list(range(20))
    spread_out = dict(parallel_map(partial(product, MATRIX), range(20), processes=2))
    assert len(spread_out) == 20
    for number, result in alone:
        assert result.tobytes() == spread_out[number].tobytes()


@pytest.mark.parametrize("processes", [1, 2])
def test_of_endless_tasks_only_a_few_are_taken_ahead(processes: int) -> None:
    before, taken = set(multiprocessing.active_children()), []

    def endless() -> Iterator[int]:
        for number in itertools.count():
            taken.append(number)
            yield number

    results = list(itertools.islice(parallel_map(abs, endless(), processes=processes), 10))
    assert len(results) == 10
    assert len(taken) <= 10 + (AHEAD * processes if processes > 1 else 0)
    assert set(multiprocessing.active_children()) <= before


@pytest.mark.parametrize("processes", [1, 2])
def test_what_follows_from_a_result_is_done_under_the_same_number(processes: int) -> None:
    found = list(parallel_map(chain, range(3), processes=processes, then=after_chain))
    expected = [(n, n + step) for n in range(3) for step in (100, 200, 300)]
    assert sorted(found) == expected
    if processes == 1:
        assert found == expected  # before the next task


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_is_that_of_the_task(processes: int) -> None:
    before = set(multiprocessing.active_children())
    with pytest.raises(BeamstiffError, match=r"^row 3: found an odd number, expected an even one$"):
        list(parallel_map(refuse_odd, [2, 3, 4], processes=processes))
    assert set(multiprocessing.active_children()) <= before


def test_no_tasks_are_no_results() -> None:
    assert list(parallel_map(abs, [])) == []
    assert list(parallel_map(abs, [], processes=2)) == []
    assert list(parallel_map(abs, [], scheduler="tcp://nobody:1")) == []


def test_a_process_that_is_killed_is_said_in_one_line() -> None:
    with pytest.raises(BeamstiffError, match="one of the processes was killed") as caught:
        list(parallel_map(die, range(4), processes=2))
    assert "\n" not in str(caught.value)


def test_processes_calculate_on_one_thread_and_ours_stays_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    for _, (process, threads) in parallel_map(where, range(3), processes=2):
        assert process != os.getpid()
        assert threads == "1"
        assert os.environ["OPENBLAS_NUM_THREADS"] == "3"
        assert "MKL_NUM_THREADS" not in os.environ


COPIED = """
import sys, threading
import numpy as np
from functools import partial
from beamstiff.parallel import parallel_map
from tests import parallel_tasks

if __name__ == "__main__":
    matrix = np.random.default_rng(3).normal(size=(200, 200))
    matrix @ matrix  # the threads of the linear algebra have begun
    parallel_tasks.origin = "the program"
    stop = threading.Event()
    if sys.argv[1] == "thread":
        threading.Thread(target=stop.wait).start()
    alone = [parallel_tasks.product(matrix, task).tobytes() for task in range(6)]
    found = dict(parallel_map(partial(parallel_tasks.product, matrix), range(6), processes=2))
    assert [found[task].tobytes() for task in range(6)] == alone
    print({result for _, result in parallel_map(parallel_tasks.told_origin, range(6), processes=2)})
    stop.set()
"""


@pytest.mark.parametrize(
    ("threads", "origin"),
    [("none", "{'the program'}" if sys.platform == "linux" else "{'the file'}"), ("thread", "{'the file'}")],
)
def test_processes_are_copies_only_where_no_thread_can_hold_a_lock(threads: str, origin: str) -> None:
    one = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    told = subprocess.run(
        [sys.executable, "-W", "error", "-c", COPIED, threads],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
        env=os.environ | one,
    )
    assert told.stdout.strip() == origin


def test_numbers_that_make_no_sense_are_refused() -> None:
    with pytest.raises(BeamstiffError, match="found 0 processes, expected 1 or more"):
        list(parallel_map(abs, [1], processes=0))
    with pytest.raises(BeamstiffError, match="expected one of them"):
        list(parallel_map(abs, [1], processes=2, scheduler="tcp://localhost:8786"))


SCRIPT = """
import signal
from beamstiff.parallel import parallel_map
from tests.parallel_tasks import rest

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may ignore it
    for number, process in parallel_map(rest, [0.0, 0.0] + [60.0] * 6, processes=2):
        print(process, flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("how", ["ctrl-c", "killed"])
def test_nobody_outlives_the_program(how: str) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", SCRIPT],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert program.stdout is not None
    children = {int(program.stdout.readline()) for _ in range(2)}
    time.sleep(0.3)
    if how == "ctrl-c":
        os.killpg(program.pid, signal.SIGINT)  # as a terminal does: to all of them
    else:
        program.kill()
    told = program.communicate(timeout=30)[1]
    if how == "ctrl-c":
        assert told.count("Traceback") == 1  # the program's own: no child tells its story
        assert told.rstrip().endswith("KeyboardInterrupt")
    end = time.monotonic() + 20
    while (left := [child for child in children if alive(child)]) and time.monotonic() < end:
        time.sleep(0.05)
    assert not left


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{process}/stat") as file:  # a zombie without a parent to bury it is dead
        return file.read().rsplit(")", 1)[1].split()[0] != "Z"
