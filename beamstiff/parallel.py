"""Many independent tasks: one after another, over processes, or over the machines of a dask scheduler.

Results are the same to the bit wherever a task runs, as long as it runs the same versions on the same type of
processor, with one thread in the linear algebra (processes and dask's own workers see to that).

The pool is that of `concurrent.futures`, and not joblib's: loky starts every process anew (2.7 s until the
package is loaded, 0.14 s where copies are made), and has no tasks that follow from results (`then`).
"""

import logging
import multiprocessing
import os
import pickle
import platform
import queue
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from functools import lru_cache
from importlib import import_module, metadata
from itertools import islice
from time import monotonic
from typing import Any, TypeVar

from threadpoolctl import threadpool_info, threadpool_limits

from beamstiff._version import __version__
from beamstiff.errors import BeamstiffError, listed

T = TypeVar("T")
R = TypeVar("R")
Take = Callable[[int], Iterator[tuple[int, T]]]
Results = Generator[tuple[int, R], None, None]

AHEAD = 4  # tasks given out for each process or worker's thread before the first of them is back
ANSWER = 4.0  # s, that a scheduler has to answer, and again to have a worker: less than 10 in all
LOOK = 2.0  # s between two looks at how many workers there are
ALONE = 60.0  # s without any worker before it is given up
# what may change the last bit of a result, or the meaning of what is sent
SAME = ("numpy", "scipy", "numba")
INSTALL = "install beamstiff and what it needs on every machine of the cluster"


def parallel_map(
    function: Callable[[T], R],
    tasks: Iterable[T],
    *,
    processes: int = 1,
    scheduler: str | None = None,
    then: Callable[[R], Iterable[T]] | None = None,
) -> Iterator[tuple[int, R]]:
    """Yield the number of a task and its result, as they are ready.

    Tasks are taken from `tasks` when there is somebody to do them, a few ahead. Whoever stops asking for
    results, Ctrl-C included, leaves no process behind.

    `function`: of one task. With several processes or a scheduler it is pickled, once for all tasks: a
    function of a module, or a `functools.partial` of one, which holds what all tasks share. `processes`:
    above 1, that many new ones; a script then needs ``if __name__ == "__main__":``. On Linux they are copies
    of this one, if it has no threads of its own. `scheduler`: of dask, ``tcp://host:port`` or
    ``tls://host:port``: its workers do the tasks. A worker that dies costs the tasks that it had; others do
    them again. `then`: tasks that a result brings with it. It is called here, before the result is yielded;
    they go before others and have the same number.

    >>> from math import sqrt
    >>> list(parallel_map(sqrt, [4.0, 9.0]))
    [(0, 2.0), (1, 3.0)]
    """
    _check_numbers(processes, scheduler)
    numbered = enumerate(tasks)
    follow = deque(islice(numbered, 1))
    if not follow:
        return  # nobody is asked for nothing

    def take(most: int) -> Iterator[tuple[int, T]]:
        for _ in range(most):
            one = follow.popleft() if follow else next(numbered, None)
            if one is None:
                return
            yield one

    if scheduler is not None:
        ready = _over_cluster(function, take, scheduler)
    elif processes > 1:
        ready = _over_processes(function, take, processes)
    else:
        ready = _here(function, take)
    with closing(ready):
        for number, result in ready:
            if then is not None:
                follow.extend((number, task) for task in then(result))
            yield number, result


def check_places(processes: int = 1, scheduler: str | None = None) -> None:
    """Refuse, before any work, places where tasks could not be done."""
    _check_numbers(processes, scheduler)
    if scheduler is not None:
        with _connected(_distributed(scheduler), scheduler):
            pass


def _check_numbers(processes: int, scheduler: str | None) -> None:
    if processes < 1:
        raise BeamstiffError(f"found {processes} processes, expected 1 or more")
    if scheduler is not None and processes > 1:
        raise BeamstiffError(
            f"found {processes} processes and the scheduler {scheduler}, expected one of them: a scheduler's "
            "workers are started beside it"
        )


def _here(function: Callable[[T], R], take: Take[T]) -> Results[R]:
    while (one := next(take(1), None)) is not None:
        yield one[0], function(one[1])


def _over_processes(function: Callable[[T], R], take: Take[T], processes: int) -> Results[R]:
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        processes,
        mp_context=multiprocessing.get_context("fork" if _may_be_copied() else "spawn"),
        initializer=_begin,
        initargs=(pickle.dumps(function),),
    )
    running: dict[Future[R], int] = {}
    try:
        while True:
            for number, task in take(AHEAD * processes - len(running)):
                with _starting(), warnings.catch_warnings():
                    warnings.simplefilter("ignore", DeprecationWarning)  # of copies: see `_may_be_copied`
                    running[pool.submit(_do, task)] = number
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future.result()
        pool.shutdown()
    except BaseException as error:  # Ctrl-C too: nobody waits for results that are not wanted any more
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        pool.shutdown(cancel_futures=True)
        if isinstance(error, BrokenProcessPool):
            raise BeamstiffError(
                "one of the processes was killed, or did not start; out of memory? What was written is kept: "
                "go on with fewer processes"
            ) from error
        raise


def _may_be_copied() -> bool:
    """Tell whether processes may begin as copies of this one, which saves each a second of loading.

    A copy has one thread, and what another has locked meanwhile stays locked in it. No other thread of
    Python's may run, therefore; those of OpenBLAS are ended before the copy is made, and begun anew.
    """
    if sys.platform != "linux" or threading.active_count() > 1:
        return False
    pools = threadpool_info()
    return all(pool["num_threads"] == 1 or pool.get("threading_layer") == "pthreads" for pool in pools)


_shared = b""  # in a process of a pool: its function, pickled


def _begin(function: bytes) -> None:
    """Keep the function of all tasks, and end with the parent, whatever ends it."""
    global _shared
    _shared = function
    threadpool_limits(limits=1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _do(task: Any) -> Any:
    return _opened(_shared)(task)


@lru_cache(maxsize=4)
def _opened(function: bytes) -> Callable[[Any], Any]:
    opened: Callable[[Any], Any] = pickle.loads(function)
    return opened


@contextmanager
def _starting() -> Iterator[None]:
    """Let a process that starts meanwhile calculate on one thread, and leave Ctrl-C to its parent."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    old = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    masks = hasattr(signal, "pthread_sigmask")
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masks else set()
    try:
        yield
    finally:
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in old.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _over_cluster(function: Callable[[T], R], take: Take[T], scheduler: str) -> Results[R]:
    distributed = _distributed(scheduler)
    with _connected(distributed, scheduler) as client:
        shared = _submit(client, _passed, pickle.dumps(function))
        mine, running, ready = _versions(), dict[Any, int](), queue.SimpleQueue[Any]()
        places, looked, alone = 1, -LOOK, monotonic()
        while True:
            if monotonic() - looked > LOOK:
                places, looked = sum(client.nthreads().values()), monotonic()
                alone = looked if places else alone
            for number, task in take(AHEAD * max(places, 1) - len(running)):
                future = _submit(client, _do_there, shared, pickle.dumps(task), mine)
                running[future] = number
                future.add_done_callback(ready.put)
            if not running:
                return
            try:
                done = [ready.get(timeout=LOOK)]
            except queue.Empty:
                if monotonic() - alone > ALONE:
                    raise BeamstiffError(
                        f"--scheduler {scheduler}: no workers for {ALONE:g} s; what was written is kept"
                    ) from None
                continue
            while not ready.empty():
                done.append(ready.get())
            for future, result in zip(done, client.gather(done), strict=True):
                yield running.pop(future), pickle.loads(result)


def _distributed(scheduler: str) -> Any:
    try:
        return import_module("distributed")
    except ImportError:
        raise BeamstiffError(
            f"--scheduler {scheduler}: dask.distributed is not installed: pip install 'beamstiff[cluster]'"
        ) from None


@contextmanager
def _connected(distributed: Any, scheduler: str) -> Iterator[Any]:
    """Give a client of a scheduler, and say in one line what goes wrong with it."""
    if not scheduler.startswith(("tcp://", "tls://")):
        raise BeamstiffError(f"--scheduler: found {scheduler!r}, expected tcp://host:port or tls://host:port")
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL + 1)  # they tell the same as our one line, in many
    with closing(_client(distributed, scheduler)) as client:
        try:
            client.wait_for_workers(1, timeout=ANSWER)
        except TimeoutError:
            raise BeamstiffError(
                f"--scheduler {scheduler}: has no workers; start some: dask worker {scheduler}"
            ) from None
        _check_versions(client, scheduler)
        try:
            yield client
        except distributed.KilledWorker as error:
            raise BeamstiffError(
                f"--scheduler {scheduler}: {error.allowed_failures + 1} workers died of the same task; out "
                "of memory? What was written is kept"
            ) from error
        except (distributed.CancelledError, CancelledError, OSError) as error:
            if isinstance(error, OSError) and client.status == "running":
                raise  # a task's own
            raise BeamstiffError(
                f"--scheduler {scheduler}: has stopped answering; what was written is kept"
            ) from error
    for log, level in zip(logs, levels, strict=True):
        log.setLevel(level)  # not when it broke off: what is left of the connection complains a while


def _client(distributed: Any, scheduler: str) -> Any:
    """Return a client of the scheduler, or give it up: dask waits for ever for one that listens only."""
    found: list[Any] = []

    def connect() -> None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found.append(distributed.Client(scheduler, timeout=ANSWER, set_as_default=False))
        except Exception as error:
            found.append(error)

    thread = threading.Thread(target=connect, daemon=True)
    thread.start()
    thread.join(ANSWER + 1.0)
    if not found or isinstance(found[0], Exception):
        why = f": {found[0]}" if found and not isinstance(found[0], OSError) else ""
        raise BeamstiffError(
            f"--scheduler {scheduler}: does not answer{why}; start one: dask scheduler"
        ) from None
    return found[0]


def _submit(client: Any, function: Callable[..., Any], *arguments: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of large functions: the scheduler keeps them, against losses
        return client.submit(function, *arguments, pure=False)


def _passed(function: bytes) -> bytes:
    return function


def _do_there(function: bytes, task: bytes, wanted: dict[str, str]) -> bytes:
    """Do a task, on a worker that may have come late."""
    _compare(str(import_module("distributed").get_worker().address), _versions(), wanted)
    return pickle.dumps(_opened(function)(pickle.loads(task)))


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    """Return what has to be the same where a task is done and where it comes from."""
    found = {"Python": ".".join(platform.python_version_tuple()[:2]), "processor": platform.machine()}
    for name in SAME:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "missing"
    return {"beamstiff": __version__, **found}


class _Versions:
    """Unpickled, the versions there: asked so, a place without beamstiff answers too."""

    def __reduce__(self) -> tuple[Callable[[], dict[str, str]], tuple[()]]:
        return _versions, ()


def _check_versions(client: Any, scheduler: str) -> None:
    question, wanted = pickle.dumps(_Versions()), _versions()
    try:
        client.run_on_scheduler(pickle.loads, question)  # it reads the names of functions
    except ImportError as error:
        raise BeamstiffError(f"--scheduler {scheduler}: {error} there; {INSTALL}") from None
    for worker, found in client.run(pickle.loads, question, on_error="return").items():
        if isinstance(found, ImportError):
            raise BeamstiffError(f"worker {worker}: {found} there; {INSTALL}")
        if isinstance(found, dict):  # if not, the tasks will tell
            _compare(worker, found, wanted)


def _compare(worker: str, found: dict[str, str], wanted: dict[str, str]) -> None:
    differ = [name for name in wanted if found[name] != wanted[name]]
    if differ:
        raise BeamstiffError(
            f"worker {worker} has {listed(f'{name} {found[name]}' for name in differ)}, expected "
            f"{listed(f'{name} {wanted[name]}' for name in differ)} as here: results would not be the same"
        )
