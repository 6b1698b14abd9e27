"""What every test may use: the shared data, and hypothesis' profiles."""

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

REPOSITORY = Path(__file__).resolve().parents[1]
SHARED = REPOSITORY / os.environ.get("BEAMSTIFF_SHARED", "../shared")

gc.disable()  # while tests are collected, which makes hardly any garbage


def pytest_collection_finish() -> None:
    """Search for garbage again, but never in what collecting made: a few million objects that stay."""
    gc.freeze()
    gc.enable()


# No deadlines: they measure the machine. In continuous integration the same examples on every run, so that
# a red run is about the change; `pytest --hypothesis-profile=thorough` looks for new ones.
settings.register_profile("default", deadline=None, derandomize="CI" in os.environ, max_examples=15)
settings.register_profile("thorough", deadline=None, derandomize=False, max_examples=2000)
settings.load_profile("default")


@pytest.fixture(scope="session")
def shared_path() -> Callable[[str], Path]:
    """Return a function that finds a file of the shared data, or skips the test naming what is missing."""

    def find(relative: str) -> Path:
        path = SHARED / relative
        if not path.exists():
            pytest.skip(f"shared data missing: {relative} (set BEAMSTIFF_SHARED to the folder that holds it)")
        return path

    return find


@pytest.fixture(scope="session")
def cluster() -> Iterator[Any]:
    """Give a local cluster of dask: a scheduler and two workers, each a process."""
    distributed = pytest.importorskip("distributed", reason="dask.distributed is missing (extra `cluster`)")
    import dask

    # it idles while other tests run: watching itself, as it does by default, takes a tenth of a processor
    seldom = {
        "distributed.worker.profile.enabled": False,
        "distributed.worker.memory.monitor-interval": "1s",
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.system-monitor.interval": "10s",
    }
    with (
        dask.config.set(seldom),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=60
        ) as local,
    ):
        yield local


@pytest.fixture
def scheduler(cluster: Any) -> str:
    """Return the address of its scheduler."""
    return str(cluster.scheduler_address)
