"""Five effects at once on a KR240-2 whose geometry is off as well: from the nominal file to a corrected one.

Machines of the crowded exam (`beamstiff exam --crowded`): forms of all authors, absolute positions of 40 to
60 poses, reflectors guessed, drives off. The nominal robot is diagnosed, what was found is written into a
robot file, and the file predicts 40 fresh poses, which the machine reads without noise; the measuring frame
is fitted again.

floor: what a least-squares fit of the same rows leaves on the fresh poses that knows the form of every
effect and lacks only the sizes, together with geometry, drives, frame and reflectors; the noise of a reading
is added to both.

Run `python -m benchmarks.five_effects [CASES [AUTHOR ...]]`: forms of these authors alone; the first has
written the diagnosis, so that its library holds most of them as they are.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console

import beamstiff
from beamstiff.diagnosis.apply import extended
from beamstiff.exam.blind import unmeasured
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.crowded.cases import (
    CrowdedCase,
    CrowdedExam,
    draw_crowded_case,
    open_basis,
)
from beamstiff.exam.forms import came_to_rest
from beamstiff.exam.sizes import true_rows
from beamstiff.measure.registration import fit_rigid_motion
from beamstiff.report.tables import table

SEED = 20261126
NOTHING = np.zeros(6)


@dataclass(frozen=True)
class Outcome:
    """Errors on fresh poses, RMS in mm, the noise of a reading included."""

    case: int
    effects: str
    nominal: float
    calibrated: float
    found: float
    floor: float
    noise: float
    named: int


def stacked(first: SimulatedCampaign, second: SimulatedCampaign) -> SimulatedCampaign:
    """Return the rows of two campaigns as one."""
    fields = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name, value in vars(first).items()
        if isinstance(value, np.ndarray) and len(value) == len(first)
    }
    return replace(first, **fields)


def known_forms(case: CrowdedCase, read: Array) -> Array:
    """Return fresh positions (M, 3) as predicted by the fit that knows every form and lacks its size."""

    def seen(truths: tuple[Truth, ...]) -> Array:
        resting = [came_to_rest(one, case.campaign) if one.effect == "target-slip" else one for one in truths]
        pairs = ((case.campaign, truths), (case.fresh, resting))
        return np.concatenate(
            [
                true_rows(case.machine, (*case.geometry, *some), rows)[:, :3].reshape(-1)
                for rows, some in pairs
            ]
        )

    whole, nothing = seen(case.truths), seen(())
    others = [tuple(one for one in case.truths if one is not truth) for truth in case.truths]
    parts = np.stack([whole - seen(some) for some in others], axis=1)
    basis = open_basis(case.robot, case.machine, stacked(case.campaign, case.fresh))
    columns = np.concatenate([basis, parts], axis=1)
    count = read.size
    fitted, *_ = np.linalg.lstsq(columns[:count], read.reshape(-1) - nothing[:count], rcond=None)
    predicted: Array = (nothing + columns @ fitted)[count:].reshape(-1, 3)
    return predicted


def outcome(case: CrowdedCase) -> Outcome:
    """Return what the diagnosis of a case leaves on its fresh poses."""
    rows = case.measured(np.random.default_rng([SEED, case.label.case, 4]))
    truth = case.fresh_positions()
    noise = float(np.sqrt(3.0)) * case.campaign.sigma_position

    def off(predicted: Array) -> float:
        left = fit_rigid_motion(predicted, truth).residuals
        return 1e3 * float(np.hypot(np.sqrt((left**2).sum(axis=1).mean()), noise))

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "found.yaml"
        found = beamstiff.diagnose(case.robot, rows)
        beamstiff.save_robot(extended(found), file)
        fresh = unmeasured(case.robot, case.fresh)
        calibrated = beamstiff.calibrate(case.robot, rows).robot
        robots = (case.robot, calibrated, beamstiff.load_robot(file))
        errors = [off(beamstiff.predict(robot, fresh).pose[:, :3]) for robot in robots]
    base = replace(case, frame=NOTHING).measured(np.random.default_rng([SEED, case.label.case, 4]))
    return Outcome(
        case.label.case,
        ", ".join(f"{cause.key} {cause.closes:.2f}" for cause in case.label.causes),
        *errors,
        floor=off(known_forms(case, base.position)),
        noise=1e3 * noise,
        named=len(found.to_dict()["causes"]),
    )


def cases(count: int, authors: tuple[int, ...]) -> Iterator[CrowdedCase]:
    """Yield machines with five effects that all show."""
    exam = CrowdedExam(SEED, {"crowded": 1}, {"kr240-2": 1.0}, absolute=1.0, count=(5, 5), authors=authors)
    for number in range(count):
        yield draw_crowded_case(exam, number)


def main(count: int = 20, *authors: int) -> None:
    """Print every machine, and the medians."""
    outcomes = []
    told = table(
        "errors on fresh poses, mm RMS",
        *("case", "nominal", "calibrated", "diagnosed", "floor", "noise", "over floor", "named"),
    )
    for one in map(outcome, cases(count, authors)):
        outcomes.append(one)
        figures = (one.nominal, one.calibrated, one.found, one.floor, one.noise)
        told.add_row(
            str(one.case),
            *(f"{value:.3f}" for value in figures),
            f"{one.found / one.floor:.2f}",
            f"{one.named} of 5",
        )
        print(f"{one.case}: {one.effects}", file=sys.stderr)
    Console().print(told)
    over = np.array([one.found / one.floor for one in outcomes])
    print(f"over the floor: median {np.median(over):.2f}, within 1.3 in {(over <= 1.3).sum()} of {over.size}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
