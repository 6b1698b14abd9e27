"""Verdicts with and without measured torques: ``python -m benchmarks.torque_study [--cases N] [--seed N]``.

A KR240-2 that weighs 0.8 t is read in 60 postures by a tracker. Its tool weighs 30 to 80 % more or less and
has its centre elsewhere, a spring balancer pulls at axis 2, the upper arm weighs 15 to 35 % more, or nothing
is wrong; its drives are off by up to a quarter, its encoders by 0.2 mrad. The torques have gains to 3 %,
offsets, friction of up to 5 % and noise of 1 % of what a joint holds, and any sign. Statics is that of the
tests: derivatives of potential energies. Counted are verdicts, and whether a named cause is the planted one.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.se3 import rotation_from_vector
from tests.diagnosis.machines import arm_at
from tests.diagnosis.weighed_arm import (
    CENTRE,
    ROBOT,
    TOOL,
    UPPER,
    VARIABLES,
    balancer,
    held,
    postures,
    weights,
)

STIFFNESS = np.array([3.8e6, 6.6e6, 3.9e6, 5.6e5, 6.6e5, 4.7e5])  # N m/rad, of the bundled robot
NOISE, POSTURES = 3e-5, 60  # m
PLANTED = {"payload": "payload-error", "balancer": "gravity-compensator", "link": None, "nothing": None}


def campaign(seed: int, kind: str) -> Measurements:
    """Return positions in a tracker's frame, and torques."""
    rng = np.random.default_rng([seed, list(PLANTED).index(kind)])
    energies = [weights()]
    if kind == "payload":
        share, moved = rng.choice([-1, 1]) * rng.uniform(0.3, 0.8), rng.uniform(-0.1, 0.1, 3)
        energies = [weights(tool=TOOL * (1 + share), centre=CENTRE + moved)]
    elif kind == "link":
        energies = [weights(upper=UPPER * rng.uniform(1.15, 1.35))]
    elif kind == "balancer":
        energies.append(balancer(rng.uniform(1e4, 4e4), rng.uniform(0.0, 0.2)))
    q = postures(rng, POSTURES)
    torque = np.sum([held(one, q) for one in energies], axis=0)
    wound = torque / (STIFFNESS * rng.uniform(0.8, 1.25, 6))
    tip = arm_at(q - wound + 2e-4 * rng.standard_normal(6)).tip
    position = tip @ rotation_from_vector(np.array([0.3, -0.2, 1.1])).T + [2.0, -1.0, 0.4]
    position = position + NOISE * rng.standard_normal(position.shape)
    size = np.sqrt(np.mean(held(weights(), q) ** 2, axis=0)) + 1.0
    way = np.sign(np.diff(q, axis=0, prepend=q[:1]))
    read = torque * (1 + 0.03 * rng.standard_normal(6)) + size * 0.03 * rng.standard_normal(6)
    read += size * (0.05 * way * rng.uniform(0, 1, 6) + 0.01 * rng.standard_normal(q.shape))
    return make_measurements(
        VARIABLES,
        q,
        tcp=ROBOT.tcp,
        position=position,
        sigma_position=NOISE,
        torque=read * rng.choice([-1.0, 1.0], 6),
        source="t.csv",
    )


def main() -> None:
    """Print how often the verdict is the planted cause."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=20261126)
    asked = parser.parse_args()
    counts: Counter[tuple[str, str, str]] = Counter()
    for case in range(asked.cases):
        kind = list(PLANTED)[case % len(PLANTED)]
        rows = campaign(asked.seed + case, kind)
        for table, one in (
            ("with", rows),
            ("without", replace(rows, torque=np.full_like(rows.torque, np.nan))),
        ):
            found = diagnose(ROBOT, one)
            named = found.decomposition.causes if found.decomposition is not None else ()
            counts[kind, table, found.verdict.effect] += 1
            counts[kind, table, "any"] += PLANTED[kind] in {cause.forms[0].effect for cause in named}
            counts[kind, table, "doubted"] += any(
                "are not those of the stated" in note for note in found.notes
            )
            counts[kind, table, "cases"] += 1
    for kind in PLANTED:
        for table in ("with", "without"):
            every = {name: n for (a, b, name), n in counts.items() if (a, b) == (kind, table) and n}
            print(f"| {kind} | {table} torques | {every} |")


if __name__ == "__main__":
    main()
