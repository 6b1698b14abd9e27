"""Ask a finite element program of others for the answer to stated work (see `peers_run.py`)."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamstiff.se3 import Array


class Answer(NamedTuple):
    """What a peer found: compliances (P, 6, 6), and what it took, s and B."""

    compliance: Array
    seconds: float
    peak: float


def ask(peers: str, peer: str, work: dict[str, Array]) -> Answer:
    """Return the answer of a peer; `peers` is its Python.

    Raises
    ------
    subprocess.CalledProcessError
        When it gives none.
    """
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "work.npz"), Path(folder, "result.npz")
        np.savez(source, **work)
        script = Path(__file__).parent / "peers_run.py"
        subprocess.run([peers, script, peer, source, target], check=True, capture_output=True, env=os.environ)
        with np.load(target) as stored:
            return Answer(stored["compliance"], float(stored["seconds"]), float(stored["peak"]))


def off(found: Array, expected: Array) -> float:
    """Return the largest difference of a compliance by its largest entry."""
    size = np.abs(expected).max(axis=(-1, -2), keepdims=True)
    return float((np.abs(found - expected) / size).max())
