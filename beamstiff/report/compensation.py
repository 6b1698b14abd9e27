"""Tables and figure of a corrected path: predicted error before and after, targets not corrected."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import RenderableType

from beamstiff.compensation.follow import NO_POSTURE
from beamstiff.compensation.learn import Fitted, Learned
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import difference
from beamstiff.compensation.path_correction import DEFORMATION, EFFECTS, GEOMETRY
from beamstiff.compensation.rewrite import Compensated, size_of
from beamstiff.errors import counted
from beamstiff.functions.checks import effects_text
from beamstiff.report.figures import BLUE, GREEN, GREY, ORANGE, new_figure, plain
from beamstiff.report.tables import Column, Table, nice, number, table
from beamstiff.report.verdict import NOTHING, Verdict, rounded

UNCORRECTED = "Targets that cannot be corrected"
LEAST = 0.001  # mm, that no robot reaches
COMES_FROM = {
    GEOMETRY: "geometry of the real robot",
    DEFORMATION: "deformation under weight and load",
    EFFECTS: "effects in its file",
}
UNITS = {"m": (1e3, ", mm"), "rad": (180 / np.pi, ", deg")}
PARTS = ((slice(0, 3), 1e3), (slice(3, 6), 180 / np.pi))


def compensation_told(result: Compensated, refused: bool = False) -> Iterator[RenderableType]:
    """Yield what a terminal shows of a corrected path, or of one that is `refused`."""
    yield from compensation_verdict(result).lines()
    if result.correction.reasons:
        yield uncorrected_table(result)
    if result.learned is not None:
        yield learned_table(result.learned)
    if not refused:
        yield from (compensation_table(result), compensation_text(result))


def compensation_table(result: Compensated, some: Sequence[int] | None = None) -> Table:
    """Return a table: targets, all or some, the error of the tool before and after, how far commands moved.

    A page shows where the targets are, too, and into which direction commands move.
    """
    found, path = result.correction, result.correction.path
    moved = difference(found.commands, path.poses)
    places = [Column(f"{axis}, mm", only="page") for axis in "xyz"]
    shifts = [Column(f"moved {axis}, mm", only="page") for axis in "xyz"]
    # on a console in two lines each: these are narrow columns of numbers
    errors = ("before,\nmm", "before,\ndeg", "after,\nmm", "after,\ndeg")
    sizes = [
        factor * np.linalg.norm(gap[:, part], axis=1)
        for gap in (found.before, result.after)
        for part, factor in PARTS
    ]
    loads = (np.linalg.norm(part, axis=1) for part in (found.wrench[:, :3], found.wrench[:, 3:]))
    by = (factor * np.linalg.norm(moved[:, part], axis=1) for part, factor in PARTS)
    numbers = np.column_stack([1e3 * path.poses[:, :3, 3], *loads, *sizes, 1e3 * moved[:, :3], *by])
    return table(
        "Predicted error of the tool at the targets, if the real robot is as its file says",
        "target",
        "line",
        *places,
        "force,\nN",
        Column("moment, N m", only="page"),
        *errors,
        *shifts,
        Column("moved,\nmm", only="console"),
        "turned,\ndeg",
        Column("", left=True, only="page"),  # a console has the table of uncorrected targets
        rows=(
            [path.names[row], path.line(row), *map(_seen, numbers[row]), found.reasons.get(row, "")]
            for row in (range(len(path)) if some is None else some)
        ),
    )


def uncorrected_table(result: Compensated) -> Table:
    """Return a table of all targets that have no command of their own, and why."""
    path, made = result.correction.path, table(UNCORRECTED, "target", "line", "why", left=3)
    for row, reason in result.correction.reasons.items():
        made.add_row(path.names[row], path.line(row), reason)
    return made


def learned_table(learned: Learned) -> Table:
    """Return a table of the process parameters that measured runs taught."""
    made = table("Process, from the measured runs", "parameter", "value", "std", "before", "identifiable")
    for one in learned.parameters:
        made.add_row(*_shown(one), "yes" if one.identifiable else "no")
    return made


def learned_head(learned: Learned) -> str:
    """Return the head of a process file: comments on what the runs taught."""
    lines = ["# Process learned by beamstiff from measured runs; a factor counts from the process before.\n"]
    for one in learned.parameters:
        name, value, std, _ = _shown(one)
        open_one = "" if one.identifiable else ", not identified: near what was expected"
        lines.append(f"# {name}: {value} +- {std}{open_one}\n")
    return "".join(lines)


def _shown(one: Fitted) -> tuple[str, str, str, str]:
    """Return name with unit, value, standard deviation and that before the runs, as texts."""
    factor, unit = UNITS.get(one.unit, (1.0, ""))
    value, std, before = (number(factor * size) for size in (one.value, one.std, one.expected))
    return f"{one.name}{unit}", value, std, before


def compensation_verdict(result: Compensated) -> Verdict:
    """Return the headline: the predicted error along the path, and which robot stands for what."""
    found, machine, known = result.correction, result.machine, result.known
    targets = counted(len(known), "target")
    data = f"{Path(found.path.source).name}, {targets}; {robots_text(machine)}"
    if found.reasons:
        said = f"{len(found.reasons)} of {targets} cannot be corrected"
        return Verdict(said, data=data, action=uncorrected_action(result))
    before, after = size_of(found.before[known]), size_of(result.after[known])
    was, then = f"{told(before.rms_mm)} mm", f"after correction {told(after.rms_mm)} mm"
    left = expected_mm(result)
    if left is not None:
        then = (
            f"expected after correction {rounded(left)} mm, as the real robot's file left on held-out "
            "postures (noise of the instrument included)"
        )
        if drifts := [one for one in machine.set_aside if one.effect == "thermal-drift"]:
            then += f", beside {effects_text(drifts)}, which is not corrected"
    elif before.rms_mm > NOTHING:
        then += ", plus what the real robot's file leaves (beamstiff verify)"
    said = f"Predicted error along the path: {was}, {then}"
    doubt, action = "", "Run the corrected path and measure a few targets."
    if result.differs_mm is not None:
        differs = f"{told(result.differs_mm)} mm"
        said = (
            f"Predicted error along the path: {was} against a measured base, {differs} or more if the "
            f"robot itself touched off the workpiece; {then}"
        )
        action = (
            "If the robot itself touched off the workpiece (taught its base), give the three points with "
            f"--base-taught and run this again: commands then move by {differs} or more instead of {was}. "
            "If the workpiece was measured by other means, use this result, in the base that "
            f"beamstiff verify --refit-frame prints. {action}"
        )
    if looks_like := machine.real.unexplained:
        doubt = f"Doubtful: what the real robot's file leaves looks as if {looks_like}."
        action = "Mend that, measure and diagnose again, and correct the path with the new file."
    if result.extrapolated:
        doubt = f"Doubtful: {'; '.join(result.extrapolated)}."
        action = "Measure postures of this path and diagnose or calibrate with them before you use it."
    return Verdict(said, data=data, action=action, causes=parts_text(result), doubt=doubt)


def expected_mm(result: Compensated) -> float | None:
    """Return the error to expect at corrected targets, RMS, mm; None where the robot's file states none."""
    left = result.machine.real.fitted_error
    known = result.known
    if left is None or size_of(result.correction.before[known]).rms_mm <= NOTHING:
        return None
    return float(np.hypot(1e3 * left, size_of(result.after[known]).rms_mm))


def uncorrected_action(result: Compensated) -> str:
    """Return what to do about targets that cannot be corrected."""
    reasons = result.correction.reasons.values()
    misstated = sum(reason.startswith(NO_POSTURE) for reason in reasons)
    keep = "--unreachable keep leaves them as they are."
    if not misstated:
        return f"Move these targets; {keep}"
    others = ", and move the others" if misstated < len(reasons) else ""
    which = f"{misstated} of these targets" if others else "these targets"
    return (
        f"Correct the configuration of {which} in the program, or choose the posture with --q{others}; {keep}"
    )


def told(size: float) -> str:
    """Return a size in mm or deg with two digits; what no controller resolves is no number of its own."""
    return "0" if size <= NOTHING else rounded(size) if size >= LEAST else f"under {LEAST}"


def robots_text(machine: Machine) -> str:
    """Return, in words, which robot the controller believes in and which one is meant to be real."""
    if machine.actual is None:
        return f"{machine.controller.name} is both the controller's robot and the real one"
    real = machine.actual.name
    if real == machine.controller.name:  # one robot, in two files
        known = effects_text(machine.actual.effects)
        real = "that of --actual" + (f", with {known}" if known else "")
    return f"the controller assumes {machine.controller.name}. The real robot is {real}"


def compensation_text(result: Compensated) -> str:
    """Return sentences on the error of the path before and after."""
    known = result.known
    before, after = size_of(result.correction.before[known]), size_of(result.after[known])
    targets = counted(int(known.sum()), "target")
    was, then = (
        f"RMS {told(one.rms_mm)} mm, at most {told(one.max_mm)} mm and {told(one.max_deg)} deg"
        for one in (before, after)
    )
    if max(after.max_mm, after.max_deg) < LEAST:
        then = f"under {LEAST} mm and {LEAST} deg everywhere"
    text = f"Predicted error of the tool at {targets}: {was}. With the corrected commands: {then}"
    if before.rms_mm > NOTHING:
        less = 100 * (1 - after.rms_mm / before.rms_mm)
        text += f" ({less:.2f} % less, if the real robot is as assumed)"
    text += f". {frame_text(result)}"
    turned = result.correction.turned
    if not turned.all():
        what = "all targets" if not turned.any() else counted(int((~turned).sum()), "target")
        text += f". Only the position of {what} is corrected"
    return text + "."


def parts_text(result: Compensated) -> str:
    """Return, in words, what the error before comes from; empty where that is one thing, or not known."""
    sizes = {name: size.rms_mm for name, size in result.sizes_by_part.items() if size.rms_mm > NOTHING}
    if len(sizes) < 2:
        return ""
    each = ", ".join(f"{COMES_FROM[name]} {told(size)} mm" for name, size in sizes.items())
    cancel = "; geometry and effects were fitted together and may cancel in part"
    together = cancel if {GEOMETRY, EFFECTS} <= {*sizes} else ""
    return f"Before correction, RMS of each part: {each}. They add up as vectors{together}."


def frame_text(result: Compensated) -> str:
    """Return, in words, in which frame the corrected targets are, and where the real robot taught it."""
    base = result.machine.frames.base
    where = "base frame of the robot" if np.array_equal(base, np.eye(4)) else "frame of the path"
    text = f"The corrected positions are in the {where}, like the original ones"
    if (taught := result.correction.taught_base) is not None:
        far, turned = (factor * float(np.linalg.norm(taught.moved[part])) for part, factor in PARTS)
        text += (
            f". Errors count from the base as the real robot taught it, which is {told(far)} mm (at the "
            f"first point) and {told(turned)} deg from the controller's"
        )
    return text


def compensation_figure(result: Compensated, title: str = "") -> Figure:
    """Draw the path with its deviation, enlarged, and the size of the deviation along it."""
    figure = new_figure(11.0, 4.8)
    figure.suptitle(title or "Tool path before and after compensation")
    known = result.known
    left, right = figure.subplots(1, 2)
    _draw_path(left, result, known)
    _draw_size(right, result, known)
    return figure


def _draw_path(axes: Axes, result: Compensated, known: NDArray[np.bool_]) -> None:
    """Draw the path in the plane of its two longest directions along x, y, z."""
    targets, lines = 1e3 * result.correction.path.poses[:, :3, 3], {"markersize": 3, "linewidth": 1}
    before, after = 1e3 * result.correction.before[known, :3], 1e3 * result.after[known, :3]
    extent = np.ptp(targets, axis=0)
    size = np.abs(before).max(axis=0, initial=0.0)
    # the plane that shows path and deviation: the longest extent, then the largest deviation of the others
    first = int(np.argmax(extent))
    second = max((axis for axis in range(3) if axis != first), key=lambda axis: (size[axis], extent[axis]))
    shown = sorted((first, second))
    largest = float(np.linalg.norm(before, axis=1).max(initial=0.0))
    scale = nice(0.15 * float(extent.max()) / largest) if largest > 0 and extent.max() > 0 else 1.0
    axes.plot(*targets[:, shown].T, "-", color=GREY, linewidth=5, alpha=0.4, label="target")
    moved = 1e3 * result.correction.commands[known, :3, 3] - targets[known]
    for away, style, colour, label, look in (
        (before, "o-", ORANGE, "without compensation", lines),
        (after, "s--", BLUE, "compensated", lines),
        (moved, ":", GREEN, "commands", {"linewidth": 1.2}),
    ):
        at = targets[known] + scale * away
        axes.plot(*at[:, shown].T, style, color=colour, label=label, **look)
    if not known.all():
        axes.plot(*targets[~known][:, shown].T, "x", color="black", label="out of reach")
    axes.set_xlabel(f"{'xyz'[shown[0]]}, mm (base frame)")
    axes.set_ylabel(f"{'xyz'[shown[1]]}, mm; deviation {scale:g} times enlarged")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(frameon=False)
    plain(axes)


def _draw_size(axes: Axes, result: Compensated, known: NDArray[np.bool_]) -> None:
    along = 1e3 * result.correction.path.way[known]
    for errors, style, colour, label in (
        (result.correction.before, "o-", ORANGE, "without compensation"),
        (result.after, "s--", BLUE, "compensated, as written"),
    ):
        far = 1e3 * np.linalg.norm(errors[known, :3], axis=1)
        axes.plot(along, np.maximum(far, 1e-7), style, color=colour, markersize=3, linewidth=1, label=label)
    axes.axhline(1e-3, color=GREEN, linewidth=0.8, linestyle=":", label="0.001 mm")
    up = "distance of the tool from its target, mm"
    axes.set(yscale="log", xlabel="way along the path, mm", ylabel=up)
    axes.legend(frameon=False)
    plain(axes)


def _seen(size: float) -> str:
    """Return a length in mm, an angle in degrees or a load; what is unknown is empty."""
    return "" if np.isnan(size) else number(size) if abs(size) >= LEAST else told(abs(size))
