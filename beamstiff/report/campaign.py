"""Table and sentences of a test plan: the standard errors to expect, and what more tests would bring."""

from collections.abc import Iterator

import numpy as np
from rich.console import RenderableType

from beamstiff.errors import counted, listed
from beamstiff.functions.plan import MeasurementPlan
from beamstiff.planning.campaign import Plan
from beamstiff.planning.candidates import Noise
from beamstiff.planning.designs import AtRandom
from beamstiff.report.tables import Column, Table, number, table
from beamstiff.report.verdict import Verdict
from beamstiff.robot.stiffness_parameters import parameter_unit

CRITERIA = {
    "D": "volume of the confidence ellipsoid",
    "A": "mean variance",
    "E": "error of the least known combination of parameters",
}
WANTED = (0.05, 0.02, 0.01)  # worst relative standard errors for which the number of tests is told
MOST_TESTS = 100_000  # nobody makes more
HARDLY = 0.5  # a relative standard error above this bounds a stiffness hardly at all


def campaign_told(plan: MeasurementPlan) -> Iterator[RenderableType]:
    """Yield what a terminal shows of a plan."""
    yield from campaign_verdict(plan).lines()
    yield campaign_table(plan)
    yield campaign_text(plan)


def campaign_table(plan: MeasurementPlan) -> Table:
    """Return a table: every parameter with its present value and the standard error to expect."""
    campaign, robot = plan.campaign, plan.robot
    columns = ("parameter", "present value", "expected std", "std/value", Column("unit", left=True))
    result = table(f"{robot.name}: expected from {counted(len(campaign.tests), 'test')}", *columns)
    for name, error in campaign.design.standard_errors.items():
        value, unit = robot.parameter(name), parameter_unit(robot, name)
        result.add_row(name, number(value), number(error * value), percent(error), unit)
    return result


def campaign_verdict(plan: MeasurementPlan) -> Verdict:
    """Return what a plan begins with: how well its tests will determine the stiffness."""
    campaign, errors = plan.campaign, plan.campaign.design.standard_errors
    well = [name for name, error in errors.items() if error <= HARDLY]
    asked = len(errors) + len(plan.left_out)
    worst = max((errors[name] for name in well), default=float("nan"))
    certain = f", the least certain to {percent(worst)}" if well else ""
    headline = (
        f"{counted(len(campaign.tests), 'test')} at {counted(len(np.unique(campaign.tests.pose)), 'pose')} "
        f"determine {len(well)} of {counted(asked, 'stiffness value')}{certain}."
    )
    return Verdict(headline, "agrees" if len(well) == asked else "doubtful")


def campaign_text(plan: MeasurementPlan) -> str:
    """Return sentences: how good the choice is, against random ones, how many are enough, what is missing."""
    campaign, enough, left_out, unit = plan.campaign, plan.enough, plan.left_out, plan.unit
    design, count = campaign.design, len(campaign.design.chosen)
    lines = []
    if left_out:
        why = "; ".join(f"{name} {reason}" for name, reason in left_out.items())
        lines.append(f"Cannot be identified: {why}. Add other loads, moments or measured rotations.")
    if hardly := [name for name, error in design.standard_errors.items() if error > HARDLY]:
        lines.append(
            f"Poorly determined (expected std above {percent(HARDLY)} of the value): {listed(hardly)}. "
            "Load more, measure better or make more tests."
        )
    chosen = counted(count, unit)
    share = np.floor(1000 * design.efficiency) / 10
    lines.append(
        f"Chosen from {counted(plan.candidates, unit)}, measured with a noise of "
        f"{_noise(campaign.noise)}. Criterion {design.criterion}: {number(design.value)}, larger with a "
        f"smaller {CRITERIA[design.criterion]}. No other {chosen} would be more than {100.0 - share:.3g} % "
        "better."
    )
    lines.append(_against(campaign, plan.at_random, chosen))
    if plan.moving is not None:
        lines.append(
            f"Moving between these poses takes {plan.moving[1]:.3g} s, between those of the most telling "
            f"tests {plan.moving[0]:.3g} s."
        )
    fewer = " (or fewer)" if enough.knee == enough.counts[0] else ""
    needed = {error: float(f"{enough.tests_for(error):.2g}") for error in WANTED}
    sizes = ", ".join(
        f"{f'about {size:.0f}' if size < MOST_TESTS else f'over {MOST_TESTS}'} for {percent(error)}"
        for error, size in needed.items()
    )
    lines.append(
        f"Beyond {counted(enough.knee, unit)}{fewer}, more only average the noise. For each value to have at "
        f"most a given std, {unit}s needed: {sizes}."
    )
    return "\n".join(lines)


def percent(share: float) -> str:
    """Return a share as people read it, two digits.

    >>> percent(0.0234), percent(5.87), percent(1e5)
    ('2.3 %', '587 %', '> 1000 %')
    """
    if share > 10:
        return "> 1000 %"
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:.0f} %"


def _noise(noise: Noise) -> str:
    position = f"{1e3 * noise.position:.3g} mm"
    return position if noise.rotation is None else f"{position} and {1e3 * noise.rotation:.3g} mrad"


def _against(campaign: Plan, drawn: AtRandom, chosen: str) -> str:
    median, head = float(np.median(drawn.worst)), f"Of {drawn.worst.size} random choices of {chosen}"
    if not np.isfinite(median):
        return f"{head}, most do not determine all parameters."
    gain = campaign.design.value / float(np.median(drawn.values))
    return f"{head} the median has a worst std of {percent(median)} and a criterion {gain:.2g} times lower."
