"""Structures on which other programs crash, stop without a word or return a wrong number with status 0."""

from __future__ import annotations

import math
from collections.abc import Callable

from beamstiff import Robot, Section
from tests.fem.builders import FREE, RIGID, compliance, frame, some_rotation, turned

HINGE = (RIGID, RIGID, FREE, RIGID)
ALONG, ACROSS = (1, 0, 0), (0, 0, 1)


def hinged() -> Robot:
    """Return a beam on a free hinge."""
    return frame([(0, 0, 0), (0, 0, 0), (1, 0, 0)], beams=[(1, 2)], joints=[(0, 1, ACROSS, HINGE)])


def four_bar() -> Robot:
    """Return a closed loop of beams with four free hinges."""
    corners = [(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)]
    return frame(
        [corner for corner in corners for _ in (0, 1)],
        beams=[(1, 2), (3, 4), (5, 6)],
        joints=[(i, i + 1, ACROSS, HINGE) for i in (0, 2, 4, 6)],
        fixed=(0, 7),
        tcp=3,
    )


def section(**wrong: float) -> Robot:
    """Return a cantilever of a section with a wrong number."""
    right = {"A": 1e-3, "Iy": 1e-6, "Iz": 1e-6, "J": 1e-6}
    return frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)], section=Section(**(right | wrong)))


def in_series(first: float, second: float) -> float:
    """Return the compliance of two springs in a row."""
    joints = [(i, i + 1, ALONG, (k, RIGID, RIGID, RIGID)) for i, k in enumerate((first, second))]
    return float(compliance(frame([(0, 0, 0)] * 3, joints=joints))[0, 0])


def in_parallel(first: float, second: float) -> float:
    """Return the compliance of two springs side by side."""
    joints = [(0, 1, ALONG, (k, RIGID, RIGID, RIGID)) for k in (first, second)]
    return float(compliance(frame([(0, 0, 0)] * 2, joints=joints))[0, 0])


TURN = some_rotation(3)
# claim, what is asked of the program, what its one line has to hold
REFUSED: list[tuple[str, Callable[[], object], str]] = [
    ("mechanism: beam on a hinge", lambda: compliance(hinged()), "through j0.torsional"),
    ("the same, turned in space", lambda: compliance(turned(hinged(), TURN)), "through j0.torsional"),
    ("mechanism: four-bar with free hinges", lambda: compliance(four_bar()), "is a mechanism"),
    ("the same, turned in space", lambda: compliance(turned(four_bar(), TURN)), "is a mechanism"),
    ("zero-length beam", lambda: frame([(1, 2, 3), (1, 2, 3)], beams=[(0, 1)]), "zero length"),
    (
        "disconnected part",
        lambda: frame([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)], beams=[(0, 1), (2, 3)], tcp=1),
        "disconnected part: nodes n2, n3",
    ),
    ("section with NaN", lambda: section(A=math.nan), "A: found nan"),
    ("section with negative I", lambda: section(Iy=-1e-6), "Iy: found -1e-06"),
]
# claim, the program's answer, the exact one
ANSWERED: list[tuple[str, Callable[[], float], float]] = [
    ("springs 1e-10 and 1e15 in series", lambda: in_series(1e-10, 1e15), 1e10),
    ("springs 1e15 and 1e-10 in series", lambda: in_series(1e15, 1e-10), 1e10),
    ("springs 1e-10 and 1e15 in parallel", lambda: in_parallel(1e-10, 1e15), 1e-15),
]
