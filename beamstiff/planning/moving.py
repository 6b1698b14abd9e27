"""Plans that tell as much in less time: tests are exchanged for others that are sooner driven to.

A robot moves from posture to posture in the time that the slowest joint takes, ``max_j |dq_j| / v_j``; loads in
one posture cost none. From the best plan on, each test in turn gives way to that test with which the way is
soonest driven, as long as the criterion stays within a share of the best (exchanges as in `designs`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beamstiff.planning.designs import Criterion, criterion_of
from beamstiff.se3 import Array

SLACK = 0.02  # of the criterion, that a plan may lose for less driving
TRIED = 16  # tests nearest to the way, whose way is looked at
PASSES = 20


def nearest_next(poses: Array) -> list[int]:
    """Return a way through all poses: from the first always to the nearest, by the largest joint motion."""
    route, left = [0], set(range(1, len(poses)))
    while left:
        rest = sorted(left)
        away = np.abs(poses[rest] - poses[route[-1]]).max(axis=1, initial=0.0)
        route.append(rest[int(np.argmin(away))])
        left.remove(route[-1])
    return route


def moving_time(q: Array, speed: Array) -> float:
    """Return the time, s, that a robot moves through states (n, A), rad or m, at speeds (A,), rad/s or m/s."""
    poses = np.unique(q / speed, axis=0)
    way = poses[nearest_next(poses)]
    return float(np.abs(np.diff(way, axis=0)).max(axis=1, initial=0.0).sum())


def sooner_driven(
    information: Array, chosen: Sequence[int], q: Array, speed: Array, criterion: Criterion = "D"
) -> NDArray[np.int64]:
    """Return tests that tell nearly as much as those chosen, in less time for moving.

    Parameters
    ----------
    information : (N, m, m) array
        Of each candidate.
    chosen : sequence of int
    q : (N, A) array, rad or m
        Posture of each candidate.
    speed : (A,) array, rad/s or m/s
    criterion : "D", "A" or "E"
    """
    tests = list(map(int, chosen))
    floor = (1.0 - SLACK) * float(criterion_of(information[tests].sum(axis=0), criterion))
    time = moving_time(q[tests], speed)
    for _ in range(PASSES):
        before = time
        for place in range(len(tests)):
            rest = [*tests[:place], *tests[place + 1 :]]
            enough = criterion_of(information[rest].sum(axis=0) + information, criterion) >= floor
            enough[rest] = False
            free = np.flatnonzero(enough)
            away = np.abs((q[free][:, None] - q[rest]) / speed).max(axis=2).min(axis=1)
            for other in free[np.argsort(away, kind="stable")[:TRIED]].tolist():
                if (sooner := moving_time(q[[*rest, other]], speed)) < time - 1e-9:
                    tests[place], time = other, sooner
        if time > before - 1e-9:
            break
    return np.array(tests, dtype=np.int64)
