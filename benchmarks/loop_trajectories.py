"""Do loops flip along trajectories near dead centres: ``python -m benchmarks.loop_trajectories``.

The machines of `loop_machines`, each driven along 500 postures of one continuous way that comes near dead
centres and turns back before them: how near is drawn, from 1e-3 to 0.05 as the sine of the angle at which
links meet (of a platform: the determinant of its legs' lines, beside that at the beginning). The truth is a
closed form all along: circles that cut on one side, the legs' lengths of a platform's poses. The guesses are
the passive variables of the first posture.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture_at
from benchmarks.closed_loops import NEAR
from benchmarks.loop_machines import KINDS, Array, Machine, Toggle

POSES = 500
NEAREST, FARTHEST = 1e-3, 0.05  # to a dead centre
AWAY = 0.3  # from it, the first posture
FINE = 4001  # postures looked at for where it closes
DIP, BETWEEN = 0.2, 401  # where it comes so near, as many more on either side


def near_dead_centres(rng: np.random.Generator, toggle: Toggle) -> Array | None:
    """Return a way from a first posture to a dead centre, to the one on the other side, and back again.

    None where the first posture is too near to one, or there is none to come to.
    """
    first = rng.uniform(-np.pi, np.pi)
    nearest = np.exp(rng.uniform(np.log(NEAREST), np.log(FARTHEST)))
    ends = []
    for side in (1.0, -1.0):
        ways = first + side * np.linspace(0.0, np.pi, FINE)
        near = toggle(ways)
        if near[0] < AWAY:
            return None
        below = {int(at): ways[at] for at in np.flatnonzero(near < nearest)[:1]}
        # a dead centre may lie between two postures that are looked at: the way must not leap over it
        inner = near[1:-1]
        lows = (inner <= near[:-2]) & (inner <= near[2:]) & (inner < DIP)
        for at in np.flatnonzero(lows) + 1:
            between = np.linspace(ways[at - 1], ways[at + 1], BETWEEN)
            dips = np.flatnonzero(toggle(between) < nearest)
            if dips.size:
                below.setdefault(int(at), between[dips[0]])
        if not below:
            ends.append(0.5 * np.pi * side)
            continue
        past = min(below)
        good, bad = ways[past - 1], below[past]
        for _ in range(50):
            middle = 0.5 * (good + bad)
            good, bad = (middle, bad) if toggle(np.array([middle]))[0] >= nearest else (good, middle)
        ends.append(good - first)
    if max(map(abs, ends)) == 0.5 * np.pi and ends[0] == -ends[1]:
        return None  # it turns round and round
    turns = [0, POSES // 4, 3 * POSES // 4, POSES - 1]
    return np.asarray(first + np.interp(range(POSES), turns, [0.0, ends[0], ends[1], 0.0]))


def driven(machine: Machine) -> tuple[str, float]:
    """Return what happened along the way, and how far the tool was off at most where loops closed, m."""
    try:
        kinematics = compile_kinematics(machine.robot)
    except BeamstiffError:
        return "refused", 0.0
    closure = close_loops(kinematics, machine.q, strict=False)
    found = pose_of(kinematics, posture_at(kinematics, closure.values), "tool")[:, :3, 3]
    off = np.abs(found - machine.tool).max(axis=1)[closure.closed]
    if (off > NEAR).any():
        return "flipped", float(off.max())
    return ("right" if closure.closed.all() else "error"), float(off.max(initial=0.0))


ANSWERS = ("right", "refused", "error", "flipped")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trajectories", type=int, default=40, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"{options.trajectories} trajectories of {POSES} poses of each kind, seed {options.seed}")
    print(f"{'':18}" + "".join(f"{answer:>10}" for answer in ANSWERS) + f"{'off, m':>12}")
    total: Counter[str] = Counter()
    for number, (name, draw) in enumerate(KINDS.items()):
        rng, farthest = np.random.default_rng([options.seed, number, POSES]), 0.0
        counts: Counter[str] = Counter()
        while counts.total() < options.trajectories:
            machine = draw(rng, 0.0, near_dead_centres)
            if machine is not None:
                answer, off = driven(machine)
                counts[answer] += 1
                farthest = max(farthest, off) if answer != "flipped" else farthest
        total += counts
        print(
            f"{name:18}" + "".join(f"{counts[one]:10d}" for one in ANSWERS) + f"{farthest:12.1e}", flush=True
        )
    print(f"{'all':18}" + "".join(f"{total[answer]:10d}" for answer in ANSWERS))
    print(f"\nasked: no flip; reached: {total['flipped']} of {total.total()}")


if __name__ == "__main__":
    main()
