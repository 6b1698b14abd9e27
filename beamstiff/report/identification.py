"""Tables and sentences of an identification: stiffness with its uncertainty, and what the residual means."""

import re
from collections.abc import Iterator, Mapping, Sequence
from math import inf, sqrt

import numpy as np
from rich.console import RenderableType

from beamstiff.errors import counted, listed
from beamstiff.functions.checks import effects_text
from beamstiff.identification.pareto import Front
from beamstiff.identification.result import Combination, Identification, Parameter
from beamstiff.measure.table import Measurements
from beamstiff.report.tables import Column, Table, number, table, times_off, worth
from beamstiff.report.verdict import (
    BEYOND_NOISE,
    Level,
    Verdict,
    data_of,
    diagnose_command,
    level_of,
    rigid_drives,
    rigid_text,
    undetermined_text,
)
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import stiffness_text

BELOW_NOISE = 0.5  # a residual this much below the noise is no chance any more, from a dozen rows on
ENOUGH_ROWS = 12
CHANCE = 3.0  # standard deviations of a residual of noise alone
# times off the robot file's value: data sheets and fits of sound robots differ by a factor of 2 to 4
FAR_OFF = 10.0
MOST_SHOWN = 4  # stiffness values that a table of compromises has room for
_PLAIN: Level = "plain"
ACTS = {
    "series": "act in series",
    "parallel": "act in parallel",
    "sum": "are identifiable only as sums",
    "mixed": "are identifiable only in combination, not as a simple sum",
    "ill-determined": "are hardly distinguishable with these data",
}


def identification_told(
    found: Identification, folds: int = 5, files: Sequence[str] = ()
) -> Iterator[RenderableType]:
    """Yield what a terminal shows of an identification; `files`: see `identification_verdict`."""
    if found.rows is not None:
        yield from identification_verdict(found, found.rows, files).lines()
    title = f"{found.robot.name}: identified stiffness"
    yield from (identification_table(found, title=title), "", *combinations_text(found))
    if found.rows is not None:
        yield identification_text(found, found.rows, folds)
    yield method_text(found)
    if found.robot.effects:
        yield f"The fit includes the robot's effects unchanged: {effects_text(found.robot.effects)}."
    if found.front is not None:
        yield from ("", front_table(found.front))


def identification_table(
    found: Identification, robot: Robot | None = None, title: str = "Identified stiffness"
) -> Table:
    """Return a table: value before (in `robot`), identified value with its std, or a lower bound."""
    before = robot or found.start
    named = {joint.name: joint.variable for joint in found.robot.joints if joint.variable}
    drives = [named.get(item.name.rpartition(".")[0], "") for item in found.parameters]
    whose = [Column("axis", left=True)] if any(drives) else []
    old, drawn = ["start"] * (before is not None), ["bootstrap 95 %"] * (found.bootstrap is not None)
    page = (Column("std/value", only="console"), Column("95 %", only="page"), Column("unit", left=True))
    why = Column("why no value", left=True, only="page")
    result = table(title, "parameter", *whose, *old, "identified", "std", *page, *drawn, why)
    far = _far_off(found, before)
    for item, drive in zip(found.parameters, drives, strict=True):
        start = [] if before is None else [_start(before, item.name)]
        more = [] if found.bootstrap is None else [_interval(found.bootstrap.intervals.get(item.name))]
        name = f"{item.name} (!)" if item.name in far else item.name
        own = [name, drive] if whose else [name]
        result.add_row(*own, *start, *_cells(item), item.unit, *more, item.reason)
    return result


def far_off(values: Mapping[str, tuple[float, float | None]], robot: Robot) -> dict[str, float]:
    """Return by how many times fitted values are stiffer than the robot file says, those far from it.

    `values`: of the file, and as fitted. Start values of the file are guesses: they contradict nothing.
    """
    ratios = {
        name: value / given
        for name, (given, value) in values.items()
        if value and 0.0 < given < inf and name not in robot.unmeasured
    }
    return {name: ratio for name, ratio in ratios.items() if not 1 / FAR_OFF < ratio < FAR_OFF}


def far_off_text(far: Mapping[str, float]) -> str:
    """Return, in words, which fitted values are far from the robot file, and what may be wrong; or none."""
    each = (f"{name} ({times_off(ratio)})" for name, ratio in far.items())
    said = (
        f"(!) Far from the robot file: {listed(each)}. If that value was no guess, check it, and whether "
        "another part is compliant: the fit takes it for the drive's own."
    )
    return said if far else ""


def _far_off(found: Identification, start: Robot | None) -> dict[str, float]:
    if start is None:
        return {}
    return far_off({item.name: (start.parameter(item.name), item.value) for item in found.parameters}, start)


def _start(robot: Robot, name: str) -> str:
    start = stiffness_text(robot.parameter(name))
    return start if isinstance(start, str) else number(start)


def _cells(item: Parameter) -> tuple[str, str, str, str]:
    low, high = item.interval or (item.lower_bound or 0.0, inf)
    between = _interval((low or 0.0, high))
    if item.value is None or item.std is None:
        return f"> {number(item.lower_bound)}" if item.lower_bound else "?", "-", "-", between
    return *worth(item.value, item.std), f"{100 * item.std / item.value:.1f} %", between


def _interval(ends: tuple[float, float] | None) -> str:
    if ends is None:
        return "-"
    return f"{number(ends[0])} to {'rigid' if ends[1] == inf else number(ends[1])}"


def combinations_text(found: Identification) -> Iterator[str | Table]:
    """Yield what is known of springs identifiable only in combination: a table, and a sentence a group.

    Nothing where every spring is known by itself.
    """
    groups = (*found.degenerate, *found.ill_determined)
    if any(item.value is not None for item in groups):
        yield from (combinations_table(found), "")
    told = set[tuple[str, ...]]()
    for item in groups:
        if item.parameters not in told:
            told.add(item.parameters)
            yield _group_text(item)
    for parameter in found.parameters:
        if parameter.separate:
            yield f"{parameter.reason}; {parameter.separate}."


def front_table(front: Front) -> Table:
    """Return a table of the compromises between position and rotation."""
    some = front.parameters[:MOST_SHOWN]
    result = table("Position against rotation", "weight of rotation", "position, mm", "rotation, deg", *some)
    for one in front.to_dict():
        errors = f"{one['rms_mm']:.4g}", f"{one['rms_deg']:.4g}"
        values = (number(one["stiffness"][name]) for name in some)
        result.add_row(f"{one['rotation_weight']:.3f}", *errors, *values)
    return result


def combinations_table(found: Identification) -> Table:
    """Return a table of the sums that are known though their terms are not."""
    how, between = Column("how", left=True, only="page"), Column("95 %", only="page")
    unit, one = Column("unit", left=True), Column("as one spring")
    result = table("Identifiable only in combination", "sum", how, "value", "std", between, unit, one)
    for item in (*found.degenerate, *found.ill_determined):
        if item.value is not None:
            cells = (number(item.value), "-") if item.std is None else worth(item.value, item.std)
            more = (_interval(item.interval), item.unit, _as_one(item))
            result.add_row(item.relation, item.kind, *cells, *more)
    return result


def _as_one(item: Combination) -> str:
    """Return the stiffness of springs in series as one, with what bounds it."""
    if item.kind != "series" or item.value is None or item.std is None:
        return "-"
    low, high = item.interval or (max(item.value - 1.96 * item.std, 0.0), item.value + 1.96 * item.std)
    if low <= 0.0:
        return f"> {number(1 / high)}" if high > 0 else "?"
    return number(1 / item.value)


def _group_text(item: Combination) -> str:
    names = f"{', '.join(item.parameters[:-1])} and {item.parameters[-1]}"
    text = f"{names} {ACTS[item.kind]}"
    if item.kind in ("series", "parallel"):
        text += ": lump them into one (--reduce)"
    return f"{text}. {item.separate[0].upper()}{item.separate[1:]}." if item.separate else f"{text}."


def identification_text(found: Identification, measured: Measurements, folds: int = 5) -> str:
    """Return sentences: what is not bounded, the residual, how it compares with the stated noise.

    `folds`: of the held-out gap that was asked for; 0 for none.
    """
    grouped = {name for item in found.degenerate for name in item.parameters}
    unbounded = [
        item.name
        for item in found.parameters
        if item.value is None and item.lower_bound and not item.silent and item.name not in grouped
    ]
    over = "the one fitted row" if len(measured) == 1 else f"the {len(measured)} fitted rows"
    gap = f"Position residual: {1e3 * found.rms:.3f} mm RMS on {over}"
    if not measured.measured_mask[:, :3].any():
        gap, held_out = f"No position was measured in {over}, only rotations", "."
    elif found.rms_held_out is None:
        few = folds > 1 and not found.interrupted
        held_out = "; too few poses to hold some out." if few else "."
    else:
        held_out = f", {1e3 * found.rms_held_out:.3f} mm on held-out poses."
    if int(measured.measured_mask.sum()) <= len(found.parameters):
        judged = "As many parameters as readings: any model would fit, so the residual says nothing."
    else:
        judged = _against_noise(sqrt(found.chi_square), measured)
    lines = ["Stopped by hand: the best values so far."] if found.interrupted else []
    if far := far_off_text(_far_off(found, found.start)):
        lines.append(far)
    if unbounded:
        lines.append(
            f"No upper bound from these data for {listed(unbounded)}: rigid would fit nearly as well. "
            "> marks the lower bound (97.5 % confidence)."
        )
    return "\n".join([*lines, f"{gap}{held_out} {judged}"])


def identification_verdict(
    found: Identification, measured: Measurements, files: Sequence[str] = ()
) -> Verdict:
    """Return how many values were identified, how much noise the fit leaves, and what to do next.

    `files`: the robot's and the tables, as a command names them.
    """
    unknown = [item.name for item in found.parameters if item.value is None]
    count = len(found.parameters)
    said = f"{count - len(unknown)} of {counted(count, 'stiffness value')} identified"
    ratio, level = sqrt(found.chi_square), _PLAIN
    if np.isfinite(measured.sigma[measured.measured_mask]).any():
        level = level_of(ratio)
        said += f"; the fit leaves {ratio:.1f} times the noise"
    if level in ("doubtful", "differs"):
        action = f"The model is incomplete. {diagnose_command(files)} finds what it lacks."
    elif unknown:
        action = ""
    elif level == "agrees":
        action = "Write the robot (--out) and test it on fresh rows with beamstiff verify."
    else:
        action = "State sigma_position in the table's head, so that the fit can be judged."
    start = found.start or found.robot
    rigid = rigid_text(start, rigid_drives(start))
    action = " ".join(filter(None, (action, rigid, undetermined_text(unknown))))
    return Verdict(said, level, data_of(measured), action)


def method_text(found: Identification) -> str:
    """Return a sentence: which method, how many evaluations, why it stopped."""
    # scipy names the tolerance
    met = r"(Both )?`\w+`( and `\w+`)? termination conditions? (is|are) satisfied"
    why = re.sub(met, "converged", found.message).replace(".;", ";").rstrip(".")
    return f"{found.method}, {counted(found.evaluations, 'evaluation')}: {why}."


def _against_noise(ratio: float, measured: Measurements) -> str:
    sigma = measured.sigma_position
    if sigma is not None:
        noise = f"the stated noise ({1e3 * sigma:.3g} mm per axis)"
    elif np.isfinite(measured.sigma[measured.measured_mask]).any():
        noise = "the stated noise"  # of rows, files or rotations
    else:
        return "The table states no sigma_position: the uncertainty is estimated from the residual."
    if ratio > BEYOND_NOISE:
        return (
            f"The residual is {ratio:.1f} times {noise}: the model is incomplete. The standard deviations "
            "are scaled by this factor; they do not cover the bias of an incomplete model."
        )
    if ratio < BELOW_NOISE and len(measured) >= ENOUGH_ROWS:
        return (
            f"The residual is {ratio:.2g} times {noise}: the rows scatter far less than stated, and the "
            "bounds and standard deviations are too wide by as much."
        )
    if ratio > 1.0 + CHANCE / np.sqrt(2.0 * measured.measured_mask.sum()):
        return (
            f"The residual is {ratio:.2f} times {noise}, a little more than chance: beamstiff diagnose says "
            "whether something is systematic in it."
        )
    return f"The residual is {ratio:.2f} times {noise}: noise explains it."
