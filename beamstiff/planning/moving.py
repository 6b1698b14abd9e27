"""Plans that tell as much in less time: tests are exchanged for others that are sooner driven to.

A robot moves from posture to posture in the time that the slowest joint takes, ``max_j |dq_j| / v_j``; loads
in one posture cost none. From the best plan on, each test in turn is exchanged for that with which the way is
soonest driven, as long as the criterion stays within a share of the best (exchanges as in `designs`).
"""

import numpy as np

from beamstiff.planning.designs import Design, criterion_of, design_of
from beamstiff.se3 import Array

SLACK = 0.02  # of the criterion, that a plan may lose for less driving
TRIED = 16  # tests nearest to the way, whose way is looked at
PASSES = 20
ROUNDING = 1e-9  # s


def nearest_next(poses: Array, first: int = 0) -> list[int]:
    """Return a way through all poses: from one always to the nearest, by the largest joint motion."""
    route, left = [first], set(range(len(poses))) - {first}
    while left:
        rest = sorted(left)
        away = np.abs(poses[rest] - poses[route[-1]]).max(axis=1, initial=0.0)
        route.append(rest[int(np.argmin(away))])
        left.remove(route[-1])
    return route


def driven(q: Array, speed: Array) -> float:
    """Return the time, s, of moving through states (n, A), rad or m, in their order, at speeds (A,)."""
    return float(np.abs(np.diff(q / speed, axis=0)).max(axis=1, initial=0.0).sum())


def sooner_driven(design: Design, information: Array, q: Array, speed: Array) -> Design:
    """Return a design that tells nearly as much as another, in less time for moving.

    `information`: (N, m, m) array; of each candidate.
    `q`: (N, A) array, rad or m; posture of each candidate.
    `speed`: (A,) array, rad/s or m/s.
    """
    criterion, tests = design.criterion, design.chosen.tolist()
    scale = float(np.trace(information.mean(axis=0))) / len(design.names)
    scaled, floor = information / scale, (1.0 - SLACK) * design.value / scale
    time = _way(q[tests], speed)
    for _ in range(PASSES):
        before = time
        for place in range(len(tests)):
            rest = [*tests[:place], *tests[place + 1 :]]
            enough = criterion_of(scaled[rest].sum(axis=0) + scaled, criterion) >= floor
            enough[rest] = False
            free = np.flatnonzero(enough)
            away = np.abs((q[free][:, None] - q[rest]) / speed).max(axis=2).min(axis=1, initial=np.inf)
            for other in free[np.argsort(away, kind="stable")[:TRIED]].tolist():
                if (sooner := _way(q[[*rest, other]], speed)) < time - ROUNDING:
                    tests[place], time = other, sooner
        if time > before - ROUNDING:
            break
    return design_of(tests, information, design.names, criterion, design.bound)


def _way(q: Array, speed: Array) -> float:
    """Return the time of moving through states, each posture next to the nearest one."""
    poses = np.unique(q / speed, axis=0)
    return driven(poses[nearest_next(poses)], np.ones(len(speed)))
