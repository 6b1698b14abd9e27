"""Rows until the cause is right: ``python -m benchmarks.campaign_study [--campaigns N]``.

Machines with one hidden effect are drawn by the exam, which simulates them with code of its own; those whose
effect leaves a gap below twice the noise in a rich campaign are passed over. Displacements are read in
batches of a dozen rows, as `beamstiff.campaign` proposes them; from a fixed D-optimal plan; and at random
postures under random loads. All three begin with the plan's first batch. After every batch the same diagnosis
is made: counted are the rows until it names the hidden effect at its place with a probability of 0.9. Also:
how often the loop says that it is decided where the cause is wrong, and how often a proposal settled the
matter as it promised.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.cases import Case, Exam, draw_case
from beamstiff.exam.designs import planned, reachable
from beamstiff.exam.names import normal
from beamstiff.exam.simulate import simulate
from beamstiff.exam.sizes import linear_fit, whitened_gap
from beamstiff.functions.campaign import CampaignState, campaign
from beamstiff.functions.plan import plan
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements

BATCH, MOST = 12, 72  # rows
SURE = 0.9
GAP = 2.0  # over noise
HOUR = 3600.0  # s between two batches

Proposed = Callable[[int, CampaignState | None], Measurements | None]


@dataclass
class Trail:
    """What came of one way of choosing rows."""

    rows: int = 0  # until the verdict was right; 0: not within `MOST`
    read: int = 0
    stopped: str = ""  # why the loop stopped first, and at how many rows
    stopped_at: int = 0
    false_stop: bool = False
    promises: list[tuple[float, bool]] = field(default_factory=list)  # of settling, and whether it did
    said: list[tuple[int, str, float]] = field(default_factory=list)  # rows, likeliest, its probability


def drawn(exam: Exam, number: int) -> Case | None:
    """Return a machine whose effect shows; None where it hardly does."""
    try:
        case = draw_case(exam, number)
        if case.campaign.kind != "displacement":
            return None
        fit = linear_fit(case.robot, case.machine, case.campaign)
        return case if whitened_gap(case.campaign, fit.residual(case.truths)) >= GAP else None
    except BeamstiffError:
        return None


def trail(case: Case, proposed: Proposed, seed: int, first: list[CampaignState], looks: bool) -> Trail:
    """Return what comes of a way of choosing rows; `looks`: whether it may stop by itself."""
    rng = np.random.default_rng([seed, 7])
    batches: list[Measurements] = []
    found, state = Trail(), None
    for number in range(100):
        rows = proposed(number, state)
        if rows is None or found.read >= MOST:
            return found
        states = replace(
            planned(rng, replace(rows, sigma_position=case.campaign.sigma_position), (0.0, 0.0)),
            rotations=False,
        )
        states = replace(states, time=states.time - states.time.min() + HOUR * number)
        batches.append(simulate(case.machine, case.truths, states, rng))
        found.read += len(rows)
        promised = state.outlook.settles if state is not None and state.outlook is not None else None
        state = first[0] if number == 0 and first else campaign(case.robot, batches, rows=BATCH)
        first[:] = first or [state]
        ahead = state.outlook
        assert ahead is not None
        if promised is not None:
            found.promises.append((promised, ahead.probability >= SURE))
        found.said.append((found.read, ahead.leading, round(ahead.probability, 4)))
        right = normal(ahead.leading) == normal(case.truths[0].label)
        if looks and state.stop and not found.stopped:
            found.stopped, found.stopped_at = state.stop, found.read
            found.false_stop = state.stop == "decided" and not right
        if right and ahead.probability >= SURE:
            found.rows = found.rows or found.read
            if found.stopped or not looks:
                return found
    return found


def strategies(case: Case, seed: int) -> dict[str, Proposed]:
    """Return the ways of choosing rows: from the state before to the rows of a batch."""
    force = float(np.linalg.norm(case.campaign.wrench[:, :3], axis=1).max())
    table = plan(case.robot, tests=MOST, force=force, seed=seed).to_csv()
    fixed = parse_measurements(table, case.robot, require_measured=False)
    rng = np.random.default_rng([seed, 8])
    q = reachable(rng, case.robot, MOST)
    towards = rng.normal(size=(MOST, 3))
    towards *= force * rng.uniform(0.3, 1.0, (MOST, 1)) / np.linalg.norm(towards, axis=1, keepdims=True)
    at_random = make_measurements(
        list(fixed.variables), q, tcp=case.robot.tcp, wrench=np.hstack([towards, 0 * towards]),
        displacement=np.full((MOST, 6), np.nan), pose=np.arange(MOST), source="<random>",
    )  # fmt: skip

    def of(rows: Measurements, number: int) -> Measurements | None:
        some = np.arange(BATCH * number, min(BATCH * (number + 1), len(rows)))
        return subset(rows, some) if len(some) else None

    def loop(_: int, state: CampaignState | None) -> Measurements | None:
        if state is None:
            return of(fixed, 0)
        if not state.proposal:
            return None
        return parse_measurements(state.proposal, case.robot, require_measured=False)

    return {
        "loop": loop,
        "plan": lambda number, _: of(fixed, number),
        "random": lambda number, _: of(fixed, 0) if number == 0 else of(at_random, number),
    }


def study(case: Case, seed: int) -> dict[str, Any]:
    """Return what came of all three on one machine."""
    ways = strategies(case, seed)
    begin = time.process_time()
    first: list[CampaignState] = []  # that all share
    trails = {name: trail(case, way, seed, first, name == "loop") for name, way in ways.items()}
    told = {name: vars(one) for name, one in trails.items()}
    return {"truth": case.truths[0].label, "seconds": time.process_time() - begin, **told}


def report(lines: list[dict[str, Any]]) -> None:
    """Print the figures of all campaigns."""
    count = len(lines)
    rows = {
        name: np.array([one[name]["rows"] if 0 < one[name]["rows"] <= MOST else np.inf for one in lines])
        for name in ("loop", "plan", "random")
    }
    for name, values in rows.items():
        print(
            f"{name}: right within {MOST} rows in {np.isfinite(values).sum()} of {count}, "
            f"median {np.median(values):g} rows"
        )
    some = np.isfinite(np.stack(list(rows.values()))).any(axis=0)
    capped = {
        name: np.where(np.isfinite(values), values, MOST + BATCH)[some] for name, values in rows.items()
    }
    if some.any():
        told = ", ".join(f"{name} {np.median(values):g}" for name, values in capped.items())
        print(
            f"of the {some.sum()} that any way found, more than {MOST} counted {MOST + BATCH}: median {told}"
        )
    stops = [one["loop"] for one in lines if one["loop"]["stopped"]]
    decided = [one for one in stops if one["stopped"] == "decided"]
    print(
        f"the loop stopped in {len(stops)} of {count}: decided {len(decided)}, of these wrong "
        f"{sum(one['false_stop'] for one in decided)}; nothing more to decide {len(stops) - len(decided)}, "
        f"of these right later {sum(one['rows'] > 0 for one in stops if one['stopped'] == 'undecidable')}"
    )
    promises = [(p, did) for one in lines for p, did in one["loop"]["promises"]]
    if promises:
        p, did = np.array(promises, dtype=np.float64).T
        print(f"proposals: promised to settle {p.mean():.2f} of {len(p)}, did settle {did.mean():.2f}")


def main() -> None:
    """Run or take up the study, and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=300)
    parser.add_argument("--seed", type=int, default=20261125)
    parser.add_argument("--robot", default="kr240-2", help="of the exam")
    parser.add_argument("--results", type=Path, help="JSON lines, taken up where they are there")
    options = parser.parse_args()
    exam = Exam(seed=options.seed, shares={"single": 1}, robots=(options.robot,), lean=0.0)
    lines: list[dict[str, Any]] = []
    if options.results is not None and options.results.exists():
        lines = [json.loads(line) for line in options.results.read_text(encoding="utf-8").splitlines()]
    number = lines[-1]["case"] + 1 if lines else 0
    while len(lines) < options.campaigns:
        case = drawn(exam, number)
        if case is not None:
            try:
                lines.append({"case": number, **study(case, options.seed + number)})
            except BeamstiffError as error:
                print(f"case {number} ({case.truths[0].label}): {error}")
            else:
                print(json.dumps(lines[-1]), flush=True)
                if options.results is not None:
                    with options.results.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(lines[-1]) + "\n")
        number += 1
    report(lines)


if __name__ == "__main__":
    main()
