"""Print how often identified intervals hold the truth, and how well held-out loads are predicted.

Run as `python -m benchmarks.coverage_study [REPETITIONS [DRAWN]]`: 2,000 repetitions of each campaign by
default, intervals from the bootstrap for the first 200 of them (five minutes; without these, one).
Synthetic campaigns like those of the papers, KUKA KR240-2 (Dumas et al.) and IR-663 (Marie et al.). Every
repetition draws a machine whose stiffness differs from the published values by 25 %; it moves under the loads
and at the joint values that were really there, and the table holds those that were read. An interval that is
open above is a lower bound; it must hold the truth too.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from rich.console import Console
from rich.table import Table

from beamstiff import Robot, load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.bootstrap import Bootstrap, bootstrap
from beamstiff.identification.identify import ROUNDS, Estimates, estimate
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.refit import refit
from beamstiff.identification.sensitivity import as_they_were
from beamstiff.identification.statement import Statement, build_identification
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.se3 import Array

ZONES = np.radians([(0, 110, -245, -170), (0, 25, 0, 29), (100, 146, 0, 29)])  # KR240-2: theta2, theta3
ALL_RADIAL = ("J12.radial", "J18.radial", "J33.radial", "J99.radial", "J1010.radial")
DRAWS = 400  # of the poses, for a bootstrap interval
SPREAD = 0.25  # of the machines, around the published stiffness


@dataclass(frozen=True)
class Campaign:
    """What is measured, and with what errors.

    Attributes
    ----------
    title : str
    robot : Robot
    parameters : tuple of str
    rows : Measurements
        Without displacements; with the standard deviation of the readings.
    held_out : Measurements
        Loads that are predicted and not fitted.
    errors : InputErrors
        That there are.
    stated : InputErrors
        That the identification is told of.
    """

    title: str
    robot: Robot
    parameters: tuple[str, ...]
    rows: Measurements
    held_out: Measurements
    errors: InputErrors = field(default_factory=InputErrors)
    stated: InputErrors = field(default_factory=InputErrors)


@dataclass
class Tally:
    """How often an interval held the truth.

    Attributes
    ----------
    held, closed, count : int
        Intervals that held it, intervals with two ends, all.
    drawn_held, drawn : int
        Bootstrap intervals that held it, all of these.
    below : int
        Truths below the interval.
    spread : list of float
        Relative standard deviation told, where the interval is closed.
    """

    held: int = 0
    closed: int = 0
    count: int = 0
    below: int = 0
    drawn_held: int = 0
    drawn: int = 0
    spread: list[float] = field(default_factory=list)

    def note(self, truth: float, interval: tuple[float, float], spread: float | None, closed: bool) -> None:
        """Take note of an interval."""
        self.count += 1
        self.held += interval[0] <= truth <= interval[1]
        self.below += truth < interval[0]
        self.closed += closed
        if closed and spread is not None:
            self.spread.append(spread)

    @property
    def coverage(self) -> float:
        """Share of intervals that held the truth."""
        return self.held / max(self.count, 1)


@dataclass(frozen=True)
class Study:
    """What the repetitions of a campaign gave.

    Attributes
    ----------
    campaign : Campaign
    tallies : dict of str to Tally
        By parameter, and by relation of a combination.
    predicted : (R,) array
        Share of the held-out displacement that is predicted, of each repetition.
    chi_square : (R,) array
    """

    campaign: Campaign
    tallies: dict[str, Tally]
    predicted: Array
    chi_square: Array


def kr240(title: str, errors: InputErrors, stated: InputErrors, tests: int = 25) -> Campaign:
    """Return tests in the paper's zones, a mass on a chain at a lever arm; 13 fresh poses held out."""
    random = np.random.default_rng(240)
    robot = load_robot("kr240-2")
    count = tests + 13
    q = np.zeros((count, 6))
    q[:, 0] = random.uniform(-1.5, 1.5, count)
    box = ZONES[np.arange(count) % len(ZONES)]
    q[:, 1], q[:, 2] = random.uniform(box[:, 0], box[:, 1]), random.uniform(box[:, 2], box[:, 3])
    q[:, 3:] = np.pi / 4 + np.radians(random.uniform(-20, 20, (count, 3)))
    pulls = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0], [0, -1, 0], [0, 0, -1]], dtype=float)
    forces = pulls[np.arange(count) % len(pulls)] * random.uniform(1500, 2500, (count, 1))
    arms = random.uniform(-0.15, 0.15, (count, 3))
    rows = make_measurements(
        [variable.name for variable in robot.actuated],
        q,
        tcp=robot.tcp,
        wrench=np.concatenate([forces, np.cross(arms, forces)], axis=1),
        displacement=np.zeros((count, 6)),
        sigma_position=3e-5,
        sigma_rotation=5e-5,  # three points some 0.8 m apart
        source="KR240-2",
    )
    fitted, fresh = subset(rows, np.arange(tests)), subset(rows, np.arange(tests, count))
    return Campaign(title, robot, robot.identify, fitted, fresh, errors, stated)


def ir663(title: str, parameters: Sequence[str], errors: InputErrors | None = None) -> Campaign:
    """Return 63 poses times 900 N along x and z; 300, 600 and 1100 N held out; errors are told of."""
    errors = errors or InputErrors()
    robot = load_robot("ir663")
    first, second = np.meshgrid(np.linspace(-24.15, 36.83, 9), np.linspace(33.04, 62.90, 7))
    poses = np.radians(np.stack([first.ravel(), second.ravel()], axis=1))

    def rows(*sizes: float) -> Measurements:
        loads = [size * np.eye(6)[axis] for size in sizes for axis in (0, 2)]
        return make_measurements(
            [variable.name for variable in robot.actuated],
            np.repeat(poses, len(loads), axis=0),
            tcp=robot.tcp,
            wrench=np.tile(loads, (len(poses), 1)),
            displacement=np.zeros((len(poses) * len(loads), 3)),
            sigma_position=3.5e-5,
            source="IR-663",
        )

    held_out = rows(300.0, 600.0, 1100.0)
    return Campaign(title, robot, tuple(parameters), rows(900.0), held_out, errors, errors)


def campaigns() -> list[Campaign]:
    """Return the papers' campaigns, and one with errors so large that they have to be told of."""
    paper = InputErrors(load=0.1 * 9.81, angle=float(np.radians(0.01)))
    coarse = InputErrors(load=25.0, force=10.0, angle=float(np.radians(0.3)))
    seven = ("J12.torsional", "J18.torsional", *ALL_RADIAL)
    return [
        kr240("KR240-2: 25 tests, 0.03 mm, 0.1 kg, 0.01 deg", paper, paper),
        ir663(
            "IR-663: 63 poses x 2 directions x 900 N, 0.035 mm, reduced model", load_robot("ir663").identify
        ),
        ir663("IR-663, the same with all seven parameters", seven),
        kr240("KR240-2 with coarse inputs: 25 N and 10 N, 0.3 deg, told of", coarse, coarse),
        ir663("IR-663, reduced, with the same, told of", load_robot("ir663").identify, coarse),
        kr240("KR240-2 with coarse inputs, not told of", coarse, InputErrors()),
    ]


def run(campaign: Campaign, repetitions: int, seed: int = 0, drawn: int = 0) -> Study:
    """Return how often the intervals of a campaign hold the truth; the first `drawn` by bootstrap too."""
    random = np.random.default_rng(seed)
    statement = build_identification(
        campaign.robot, campaign.rows, campaign.parameters, errors=campaign.stated
    )
    published = statement.problem.model.start
    beyond = reduce_to_ports(campaign.robot, campaign.held_out, campaign.parameters)
    tallies: dict[str, Tally] = {}
    predicted, chi_square = [], []
    models = as_they_were(
        campaign.robot, campaign.rows, campaign.errors, campaign.parameters, repetitions, random.spawn(1)[0]
    )
    for number, model in enumerate(models if campaign.errors else [statement.problem.model] * repetitions):
        truth = published * np.exp(SPREAD * random.standard_normal(published.size))
        noise = statement.problem.sigma * random.standard_normal(statement.problem.sigma.shape)
        measured = np.where(statement.problem.used, model.predict(truth) + noise, 0.0)
        found, theta = _fit(statement.measuring(measured))
        told = estimate(found, theta)
        values = dict(zip(campaign.parameters, truth.tolist(), strict=True))
        _note(tallies, told, values, found)
        if number < drawn:
            _note_bootstrap(tallies, bootstrap(found, theta, DRAWS, seed=number), values, found)
        real, expected = beyond.predict(truth), beyond.predict(found.parameters.stiffness(theta))
        gap = np.linalg.norm((real - expected)[:, :3], axis=1).sum()
        predicted.append(1 - gap / np.linalg.norm(real[:, :3], axis=1).sum())
        chi_square.append(told.chi_square)
    return Study(campaign, tallies, np.array(predicted), np.array(chi_square))


def _fit(statement: Statement) -> tuple[Statement, Array]:
    """Identify as `identify` does."""
    theta = refit(statement.objective, statement.parameters.begin)
    for _ in range(ROUNDS if statement.response is not None else 0):
        statement = statement.weighed(statement.parameters.stiffness(theta))
        theta = refit(statement.objective, theta)
    return statement, theta


def _note(tallies: dict[str, Tally], told: Estimates, truth: dict[str, float], found: Statement) -> None:
    for item in told.parameters:
        interval = item.interval or (item.lower_bound or 0.0, np.inf)
        spread = item.std / item.value if item.value and item.std else None
        tallies.setdefault(item.name, Tally()).note(truth[item.name], interval, spread, item.identifiable)
    for sum_, item in zip(found.plan.sums, told.combinations, strict=True):
        if item.interval is None or item.value is None or item.std is None:
            raise BeamstiffError(f"{item.relation}: found no interval, expected one")
        closed = item.interval[0] > 0.0
        spread = item.std / item.value
        tallies.setdefault(item.relation, Tally()).note(sum_.value(truth), item.interval, spread, closed)


def _note_bootstrap(
    tallies: dict[str, Tally], drawn: Bootstrap, truth: dict[str, float], found: Statement
) -> None:
    values = truth | {sum_.text(): sum_.value(truth) for sum_ in found.plan.sums}
    for name, (low, high) in drawn.intervals.items():
        tallies[name].drawn += 1
        tallies[name].drawn_held += low <= values[name] <= high


def print_study(console: Console, study: Study) -> None:
    """Print the table of a campaign."""
    campaign, count = study.campaign, len(study.predicted)
    table = Table(
        "parameter or combination",
        "held, %",
        "truth below, %",
        "above, %",
        "two ends, %",
        "std, %",
        "bootstrap held, %",
        title=f"{campaign.title}; {count} repetitions",
        title_justify="left",
    )
    for name, tally in study.tallies.items():
        above = tally.count - tally.held - tally.below
        spread = f"{100 * np.median(tally.spread):.2g}" if tally.spread else "-"
        shares = [100 * number / tally.count for number in (tally.held, tally.below, above, tally.closed)]
        drawn = f"{100 * tally.drawn_held / tally.drawn:.1f}" if tally.drawn else "-"
        table.add_row(name, *(f"{share:.1f}" for share in shares), spread, drawn)
    console.print(table)
    ended = [tally for tally in study.tallies.values() if tally.closed == tally.count]
    bounds = [tally for tally in study.tallies.values() if tally.closed < tally.count]
    good = sum(abs(tally.coverage - 0.95) <= 0.02 for tally in ended)
    safe = sum(tally.coverage >= 0.95 for tally in bounds)
    console.print(
        f"Asked: 95 +- 2 %; {good} of {len(ended)} intervals are within it, {safe} of {len(bounds)} bounds "
        "hold in 95 % or more."
    )
    low, middle = np.percentile(study.predicted, [2.5, 50])
    console.print(
        f"Held-out loads: {100 * middle:.2f} % of the displacement predicted ({100 * low:.2f} % or more in "
        f"97.5 % of the repetitions; asked: 98 %); chi square {np.mean(study.chi_square):.3f}\n"
    )


def main(repetitions: int = 2000, drawn: int = 200) -> None:
    """Print everything."""
    console = Console(width=130)
    for number, campaign in enumerate(campaigns()):
        print_study(console, run(campaign, repetitions, number, drawn))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
