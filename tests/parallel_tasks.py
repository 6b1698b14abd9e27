"""Tasks that other processes can import."""

import os
import signal
import time
from pathlib import Path

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

origin = "the file"


def told_origin(_: int) -> str:
    """A global of this module: what the program wrote there only a copy of the program knows."""
    return origin


def product(matrix: Array, task: int) -> Array:
    """A result whose last bits would show who calculated it otherwise."""
    result: Array = np.linalg.solve(matrix, matrix[task] * np.exp(0.1 * task))
    return result


def refuse_odd(task: int) -> int:
    if task % 2:
        raise BeamstiffError(f"row {task}: found an odd number, expected an even one")
    return task


def where(_: int) -> tuple[int, str]:
    return os.getpid(), os.environ.get("OPENBLAS_NUM_THREADS", "")


def die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(folder: Path, task: int) -> int:
    """Take the worker down that is the first to do task 3."""
    if task == 3:
        try:
            (folder / "died").touch(exist_ok=False)
        except FileExistsError:
            return task * task
        os.kill(os.getpid(), signal.SIGKILL)
    with (folder / f"done-{task}").open("a") as file:
        file.write("x")
    time.sleep(0.02)
    return task * task


def rest(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


def chain(task: int) -> int:
    return task + 100


def after_chain(result: int) -> list[int]:
    return [result] if result < 300 else []
