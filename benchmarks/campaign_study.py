"""Rows until the cause is right: ``python -m benchmarks.campaign_study [--campaigns N] [--results FILE]``.

Planar arms of two or three joints with rigid links, or arms of six (`--robots`), have a hidden effect, in
six of nine one of the library, in two one outside it, else none; the exam draws and simulates them with code
of its own. An effect is as large as leaves three to eight times the noise in random rows; passed over are
those that cannot. Displacements of the tool are read in batches: as `beamstiff.campaign` proposes them, until
it stops; from a fixed D-optimal plan; and at random postures, loaded along an axis as proposals may be. All
three begin with the plan's first batch. The same diagnosis is made in all, and counted are the rows, of
`LOOKS`, after which it first names the hidden effect at its place with a probability of 0.9, and with so much
among the causes of the library (what it leaves to an unknown one aside). Also: how often verdicts are right
by what they said, how often the loop says that it is decided where the cause is wrong, and how often a
proposal settled the matter as it promised.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff.diagnosis.next_measurement.candidates import STEPS
from beamstiff.diagnosis.next_measurement.outlook import NOTHING
from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.cases import Case, Exam, draw_case
from beamstiff.exam.designs import planned, reachable
from beamstiff.exam.forms import resized
from beamstiff.exam.names import normal
from beamstiff.exam.parameters import between
from beamstiff.exam.robots import MAIN_AXIS
from beamstiff.exam.simulate import simulate
from beamstiff.exam.sizes import linear_fit, size_for, whitened_gap
from beamstiff.functions.campaign import CampaignState, campaign
from beamstiff.functions.plan import plan
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot

LOOKS = (24, 48, 96)  # rows in all after each batch
SURE = 0.9
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 1.01)  # of stated probabilities
GAPS = (3.0, 8.0)  # over noise, evenly by ratio
SHARES = {"single": 6, "outside": 2, "null": 1}  # of every nine machines; the exam has 42, 19 and 30
LIMITS = ((-20, 120), (-150, -10))  # deg, of the first axis of a planar arm, and of the others
EFFECTS = (  # that displacements of the tool can show
    "link-bending", "bearing-tilt", "base-compliance", "tool-compliance", "actuator-lever", "backlash",
    "hardening", "hysteresis", "joint-coupling", "gravity-compensator", "load-error",
)  # fmt: skip
LOADS = ("x", "-x", "y", "-y", "z", "-z")  # that all ways may apply
WAYS = ("loop", "plan", "random")
HOUR = 3600.0  # s between two batches

Proposed = Callable[[int, CampaignState | None], Measurements | None]


@dataclass
class Trail:
    """What came of one way of choosing rows."""

    rows: int = 0  # until the verdict was right; 0: not within `LOOKS`
    among: int = 0  # the same of its share among the causes of the library
    read: int = 0
    stopped: str = ""  # why the loop stopped first, and at how many rows
    stopped_at: int = 0
    false_stop: bool = False
    promises: list[tuple[float, bool]] = field(default_factory=list)  # of settling, and whether it did
    # rows, likeliest, its probability, and that of a cause outside the library
    said: list[tuple[int, str, float, float]] = field(default_factory=list)


def planar_arm(rng: np.random.Generator, joints: int) -> Robot:
    """Return an arm with parallel axes and rigid links, upright, its lengths and drive stiffness drawn."""
    reach = rng.uniform(0.8, 2.5)
    ends = np.concatenate([[0.0], rng.uniform(0.6, 1.4, joints)])
    ends *= reach / ends.sum()
    names = range(1, joints + 1)
    frames: list[dict[str, Any]] = [{"name": "f1", "alpha": "90 deg", "theta": "q1"}]
    nodes: list[dict[str, Any]] = [{"name": "n0"}, {"name": "n1a", "at": [0, 0, 0]}]
    for k in names[1:]:
        frames.append({"name": f"f{k}", "parent": f"f{k - 1}", "d": ends[k - 1], "theta": f"q{k}"})
        nodes.append({"name": f"n{k}a", "frame": f"f{k - 1}", "at": [ends[k - 1], 0, 0]})
    nodes += [{"name": f"n{k}b", "frame": f"f{k}"} for k in names]
    nodes.append({"name": "tool", "frame": f"f{joints}", "at": [ends[joints], 0, 0]})
    stiffness = MAIN_AXIS * reach**3.3 / 4.0 ** np.arange(joints) * np.exp(rng.uniform(-0.5, 0.5, joints))
    made = {
        "name": f"planar-{joints}r",
        "variables": [
            {"name": f"q{k}", "type": "revolute", "limits": [f"{end} deg" for end in LIMITS[k > 1]]}
            for k in names
        ],
        "frames": frames,
        "nodes": nodes,
        "rigids": [
            {"name": f"link{k}", "nodes": [f"n{k}b" if k else "n0", f"n{k + 1}a" if k < joints else "tool"]}
            for k in range(joints + 1)
        ],
        "joints": [
            {
                "name": f"J{k}", "nodes": [f"n{k}a", f"n{k}b"], "frame": f"f{k}", "axis": "z",
                "variable": f"q{k}", "stiffness": {"torsional": float(stiffness[k - 1])},
            }
            for k in names
        ],
        "fixed": ["n0"],
        "tcp": "tool",
        "identify": [f"J{k}.torsional" for k in names],
    }  # fmt: skip
    return Robot.model_validate(made)


def drawn(options: argparse.Namespace, number: int) -> Case | None:
    """Return a machine whose effect shows, or that has none; None where it hardly can at any size."""
    rng = np.random.default_rng([options.seed, number, 6])
    joints = int(rng.choice(options.robots))
    arm = {"robot": planar_arm(rng, joints)} if joints < 6 else {"robots": ("random-arm",)}
    shares: Any = SHARES
    try:
        case = draw_case(Exam(options.seed, shares, EFFECTS, lean=0.0, **arm), number)
        if case.campaign.kind != "displacement":
            return None
        if not case.truths:
            return case
        states = as_read(case, random_rows(case, rng), rng)
        fit = linear_fit(case.robot, case.machine, states)
    except BeamstiffError:
        return None
    wanted, seed = between(rng.random(), *GAPS), int(rng.integers(2**31))

    def of_size(size: float) -> tuple[Truth, ...]:
        return (resized(case.truths[0], case.robot, size, seed),)

    def gap_of(size: float) -> float:
        try:
            return whitened_gap(states, fit.residual(of_size(size)))
        except BeamstiffError:  # so large that the machine buckles under it
            return float("inf")

    size, gap = size_for(gap_of, wanted)
    return replace(case, truths=of_size(size)) if GAPS[0] <= gap < 2 * GAPS[1] else None


def as_read(case: Case, rows: Measurements, rng: np.random.Generator, number: int = 0) -> SimulatedCampaign:
    """Return how the exam reads rows of a batch: with the case's noise, positions alone."""
    states = planned(rng, replace(rows, sigma_position=case.campaign.sigma_position), (0.0, 0.0))
    return replace(states, rotations=False, time=states.time - states.time.min() + HOUR * number)


def random_rows(case: Case, rng: np.random.Generator) -> Measurements:
    """Return rows at random postures, loaded as proposals are: along an axis, in part or in full."""
    count = LOOKS[-1]
    share = rng.choice(STEPS, count)[:, None] * force_of(case)
    return make_measurements(
        [variable.name for variable in case.robot.actuated], reachable(rng, case.robot, count),
        tcp=case.robot.tcp, wrench=share * np.eye(6)[rng.integers(3, size=count)],
        displacement=np.full((count, 6), np.nan), pose=np.arange(count), source="<random>",
    )  # fmt: skip


def force_of(case: Case) -> float:
    """Return the largest force of a case, N."""
    return float(np.linalg.norm(case.campaign.wrench[:, :3], axis=1).max())


def trail(case: Case, proposed: Proposed, seed: int, first: list[CampaignState], looks: bool) -> Trail:
    """Return what comes of a way of choosing rows; `looks`: whether it stops by itself."""
    rng = np.random.default_rng([seed, 7])
    batches: list[Measurements] = []
    found, state = Trail(), None
    truth = normal(case.truths[0].label) if case.label.kind == "single" else ""  # else no cause is right
    for number, upto in enumerate(LOOKS):
        rows = proposed(number, state)
        if rows is None:
            return found
        batches.append(simulate(case.machine, case.truths, as_read(case, rows, rng, number), rng))
        found.read += len(rows)
        promised = state.outlook.settles if state is not None and state.outlook is not None else None
        then = ([*LOOKS[1:], upto + LOOKS[0]])[number] - upto
        # of a way that proposes nothing, the least proposal is the quickest
        if number > 0 or not first:
            state = campaign(case.robot, batches, rows=then if looks else 1, directions=LOADS)
        else:
            state = first[0]
        first[:] = first or [state]
        ahead = state.outlook
        assert ahead is not None
        if promised is not None:
            settled = ahead.probability >= SURE and ahead.leading != "unknown"
            found.promises.append((round(promised, 4), settled))
        assert state.diagnosis is not None
        outside = sum(one.probability for one in state.diagnosis.candidates if one.effect == "unknown")
        found.said.append((found.read, ahead.leading, round(ahead.probability, 4), round(outside, 4)))
        right = normal(ahead.leading) == truth
        if right and ahead.probability >= SURE:
            found.rows = found.rows or found.read
        if right and ahead.probability >= SURE * (1.0 - outside):
            found.among = found.among or found.read
        if looks and state.stop:
            found.stopped, found.stopped_at = state.stop, found.read
            found.false_stop = state.stop == "decided" and not right
            return found
        if found.rows and not looks:
            return found
    return found


def strategies(case: Case, seed: int) -> dict[str, Proposed]:
    """Return the ways of choosing rows: from the state before to the rows of a batch."""
    table = plan(case.robot, tests=LOOKS[-1], force=force_of(case), directions=LOADS, seed=seed).to_csv()
    fixed = parse_measurements(table, case.robot, require_measured=False)
    at_random = random_rows(case, np.random.default_rng([seed, 8]))

    def of(rows: Measurements, number: int) -> Measurements:
        return subset(rows, np.arange(([0, *LOOKS])[number], LOOKS[number]))

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
    if case.label.kind != "single":  # false stops only
        ways = {"loop": ways["loop"]}
    trails = {name: trail(case, way, seed, first, name == "loop") for name, way in ways.items()}
    told = {name: vars(one) for name, one in trails.items()}
    truth = case.truths[0].label if case.truths else "none:null"
    return {
        "kind": case.label.kind,
        "robot": case.robot.name,
        "truth": truth,
        "seconds": time.process_time() - begin,
        **told,
    }


def report(every: list[dict[str, Any]]) -> None:
    """Print the figures of all campaigns."""
    joints = sorted({one["robot"] for one in every})
    for name in ["all robots", *joints]:
        some = [one for one in every if name in ("all robots", one["robot"])]
        lines = [one for one in some if "plan" in one]
        beside = Counter(one["kind"] for one in some)
        print(f"{name}: {len(lines)} campaigns with an effect of the library, {dict(beside)} in all")
        print(f"  named, with a probability of {SURE:g}: {_rows_until('rows', lines)}")
        print(f"  so likely among the causes of the library: {_rows_until('among', lines)}")
        for share, of in ((1.0, "a cause"), (0.0, "one among those of the library")):
            print(f"  verdicts that name {of}, right of all by what they said: {_reliability(some, share)}")
        stops = [one for one in some if one["loop"]["stopped"]]
        decided = [one for one in stops if one["loop"]["stopped"] == "decided"]
        false = sum(one["loop"]["false_stop"] for one in decided)
        print(
            f"  the loop stopped in {len(stops)} of {len(some)}: decided {len(decided)}, of these wrong "
            f"{false} (asked at most 3 %); nothing more to decide {len(stops) - len(decided)}"
        )
        promises = np.array([both for one in some for both in one["loop"]["promises"]], dtype=np.float64)
        if len(promises):
            p, did = promises.T
            high = p >= 0.5
            print(
                f"  proposals: promised to settle {p.mean():.2f} of {len(p)}, settled {did.mean():.2f}; "
                f"of {high.sum()} with a promise of 0.5 at least {did[high].mean() if high.any() else 0:.2f}"
            )
    for one in every:
        stop = f"{one['loop']['stopped']} {one['loop']['stopped_at']}"
        rows = [one[name]["rows"] for name in WAYS if name in one]
        print(f"  {one['robot']} {one['truth']}: {rows} {stop} {one['loop']['said'][-1][1:]}")


def _rows_until(what: str, lines: list[dict[str, Any]]) -> str:
    """Return rows until the right cause has a probability: how often it does, and the medians."""
    rows = {name: np.array([one[name][what] or np.inf for one in lines]) for name in WAYS}
    told = [f"{name} {np.isfinite(values).sum()} of {len(lines)}" for name, values in rows.items()]
    some = np.isfinite(np.array(list(rows.values()))).any(axis=0)
    if some.any():
        medians = ", ".join(f"{name} {float(np.median(values[some])):g}" for name, values in rows.items())
        told.append(f"median rows of the {some.sum()} that any way found: {medians}")
    for name in WAYS[1:]:
        fewer, more = (op(rows["loop"], rows[name]).sum() for op in (np.less, np.greater))
        told.append(f"the loop needs fewer than {name} in {fewer}, more in {more}")
    return "; ".join(told)


def _reliability(every: list[dict[str, Any]], whole: float) -> str:
    """Return how many verdicts that name a cause are right, by their probability.

    `whole`: 1 of the whole probability, 0 of its share among the causes of the library; machines with an
    effect of the library only count for the latter.
    """
    said, right = [], []
    for one in every:
        if one["kind"] != "single" and not whole:
            continue
        for name in (way for way in WAYS if way in one):
            for at, (_, leading, probability, outside) in enumerate(one[name]["said"]):
                if leading in NOTHING or (at == 0 and name != WAYS[0]):  # that all share
                    continue
                said.append(probability / (1.0 if whole else max(1.0 - outside, 1e-9)))
                right.append(one["kind"] == "single" and normal(leading) == normal(one["truth"]))
    p, ok = np.array(said), np.array(right, dtype=bool)
    bins = [(p >= low) & (p < high) for low, high in pairwise(BINS)]
    told = zip(pairwise(BINS), bins, strict=True)
    return ", ".join(
        f"{low:g} to {min(high, 1):g}: {ok[one].sum()} of {one.sum()}" for (low, high), one in told
    )


def main() -> None:
    """Run or take up the study, and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=300, help="0: print what there is")
    parser.add_argument("--seed", type=int, default=20261125)
    parser.add_argument("--robots", type=int, nargs="+", default=[2, 2, 3], help="joints: 2 to 4, or 6")
    parser.add_argument("--results", type=Path, help="JSON lines, taken up where they are there")
    options = parser.parse_args()
    lines: list[dict[str, Any]] = []
    if options.results is not None and options.results.exists():
        lines = [json.loads(line) for line in options.results.read_text(encoding="utf-8").splitlines()]
    number = lines[-1]["case"] + 1 if lines else 0
    while len(lines) < options.campaigns:
        case = drawn(options, number)
        if case is not None:
            try:
                lines.append({"case": number, **study(case, options.seed + number)})
            except BeamstiffError as error:
                print(f"case {number}: {error}")
            else:
                print(json.dumps(lines[-1]), flush=True)
                if options.results is not None:
                    with options.results.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(lines[-1]) + "\n")
        number += 1
    report(lines)


if __name__ == "__main__":
    main()
