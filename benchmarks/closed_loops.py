"""Are loops put together as they were meant, or refused or noted: ``python -m benchmarks.closed_loops``.

The guesses of drawn machines are the passive angles of a closed posture, each off by up to 45 degrees. Asked
is where the tool stands there and at ten more postures of the same assembly, from the closed forms of
`loop_machines`.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture_at
from beamstiff.robot.plausibility import robot_doubts
from benchmarks.loop_machines import KINDS, Machine

NEAR = 1e-6  # m: the same place


def asked(machine: Machine) -> str:
    """Return what happened: right, noted and right, error, noted and wrong, or wrong without a word."""
    try:
        kinematics = compile_kinematics(machine.robot)
        notes = [note for note in robot_doubts(machine.robot) if "assembl" in note]
        closure = close_loops(kinematics, machine.q)
    except BeamstiffError:
        return "error"
    found = pose_of(kinematics, posture_at(kinematics, closure.values), "tool")[:, :3, 3]
    right = bool((np.abs(found - machine.tool).max(axis=1) < NEAR).all())
    return f"{'noted, ' if notes else ''}{'right' if right else 'another'}"


ANSWERS = ("right", "noted, right", "error", "noted, another", "another")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--off", type=float, default=45.0, help="most that a guess is off, deg")
    options = parser.parse_args()
    print(f"{options.cases} of each kind, guesses off by up to {options.off:g} deg, seed {options.seed}")
    print(f"{'':18}" + "".join(f"{answer:>16}" for answer in ANSWERS))
    total: Counter[str] = Counter()
    for number, (name, draw) in enumerate(KINDS.items()):
        rng = np.random.default_rng([options.seed, number])
        counts: Counter[str] = Counter()
        while counts.total() < options.cases:
            machine = draw(rng, np.radians(options.off))
            if machine is not None:
                counts[asked(machine)] += 1
        total += counts
        print(f"{name:18}" + "".join(f"{counts[answer]:16d}" for answer in ANSWERS), flush=True)
    print(f"{'all':18}" + "".join(f"{total[answer]:16d}" for answer in ANSWERS))
    print(f"\nasked: none that is another without a word; reached: {total['another']} of {total.total()}")


if __name__ == "__main__":
    main()
