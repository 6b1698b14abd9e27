"""Tables and figures of a geometric calibration: sensitivity indices, the residual pose by pose."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import RenderableType

from beamstiff.calibration.parameters import SPARE
from beamstiff.calibration.recursion import Recursion
from beamstiff.calibration.result import Calibration, Found
from beamstiff.calibration.sensitivity import SensitivityIndices
from beamstiff.errors import counted, listed
from beamstiff.measure.table import Measurements
from beamstiff.report.figures import BLUE, GREEN, GREY, ORANGE, new_figure, plain
from beamstiff.report.tables import Column, Table, number, table
from beamstiff.report.verdict import Level, Verdict, data_of, diagnose_command, level_of, rounded
from beamstiff.se3 import Array

PER_SI = {"m": ("mm", 1e3), "rad": ("deg", 180 / np.pi)}  # as people read them
MOST_TERMS = 4
MOST_HELD = 8  # parameters that a terminal lists as held
HELD = "Indistinguishable from others: held at their nominal values"
SETUP = ("base", "target", "instrument")  # what was set up for the measurement: no errors of the robot
WITHIN = 1.96  # standard deviations: 95 %


def calibration_told(found: Calibration, files: Sequence[str] = ()) -> Iterator[RenderableType]:
    """Yield what a terminal shows of a calibration; `files`: see `calibration_verdict`."""
    if found.rows is not None:
        yield from calibration_verdict(found, found.rows, files).lines()
    yield errors_table(found)
    yield from (*calibration_text(found), "")
    yield parameters_table(found, f"{found.robot.name}: calibrated geometry")
    if (dependent := dependent_table(found)) is not None:
        dependent.most = MOST_HELD
        yield from ("", dependent)


def parameters_table(found: Calibration, title: str) -> Table:
    """Return a table of the parameters that were sought: what the robot said, what was found, how sure."""
    between, unit_head = Column("95 % of the change", only="page"), Column("unit", left=True)
    result = table(title, "parameter", "nominal", "found", "change", "std", between, unit_head)
    stated = {item.name.rpartition(".")[0] for item in found.parameters if item.nominal}
    for item in (item for item in found.parameters if item.identified):
        unit, factor = PER_SI.get(item.parameter.unit, (item.parameter.unit, 1.0))
        std, wide = item.std or 0.0, WITHIN * (item.std or 0.0)
        values = (item.nominal, item.value, item.change, std, item.change - wide, item.change + wide)
        shown = (factor * value for value in values)
        *cells, low, high = (f"{v + 0.0:.4f}" if unit in ("mm", "deg") else number(v) for v in shown)
        if item.parameter.group in ("base", "target") and item.name.rpartition(".")[0] not in stated:
            cells[0] = cells[2] = "-"  # the robot file has no place for it
        result.add_row(item.name, *cells, f"{low} to {high}", unit)
    return result


def errors_table(found: Calibration) -> Table:
    """Return a table of the errors left: nominal, calibrated, held out, and on other tables by name."""
    kinds = ["position mean, mm", "RMS", "largest"]
    if found.after.orientation_mean is not None:
        kinds += ["orientation mean, deg", "RMS", "largest"]
    result = table("Errors of the absolute readings, base and reflectors fitted", "robot", *kinds)
    rows = {"nominal": found.before, "calibrated": found.after}
    if found.held_out is not None:
        rows["calibrated, held-out poses"] = found.held_out
    rows |= {f"calibrated, {Path(name).name}": errors for name, errors in found.tests.items()}
    parts = (("position", 1e3), ("orientation", 180 / np.pi))[: len(kinds) // 3]
    for name, errors in rows.items():
        values = ((getattr(errors, f"{part}_{k}"), f) for part, f in parts for k in ("mean", "rms", "max"))
        result.add_row(name, *("-" if value is None else f"{f * value:.4f}" for value, f in values))
    return result


def dependent_table(found: Calibration) -> Table | None:
    """Return a table of the parameters indistinguishable from others, and what each looks like."""
    seen = found.identifiability
    if not seen.dependent:
        return None
    result = table(HELD, "parameter", "looks like", left=2)
    units = {item.name: item.parameter.unit for item in found.parameters}
    ranks = {item.name: item.parameter.rank for item in found.parameters}
    usual = [name for name in seen.dependent if ranks[name] != SPARE]
    for name in usual:
        result.add_row(name, combination_text(name, seen.dependent[name], units))
    if more := len(seen.dependent) - len(usual):
        result.title += f" ({more} more, b, gamma, theta, beta of frames, do what other parameters do)"
    return result


def combination_text(name: str, like: Mapping[str, float], units: Mapping[str, str]) -> str:
    """Return a linear combination, its coefficients in mm and deg: ``1 f3.r - 0.02 q2``."""
    own = PER_SI.get(units[name], ("", 1.0))[1]
    terms = {one: value * PER_SI.get(units[one], ("", 1.0))[1] / own for one, value in like.items()}
    ordered = sorted(terms.items(), key=lambda pair: -abs(like[pair[0]]))
    shown = ordered[:MOST_TERMS]
    text = " ".join(f"{'-' if value < 0 else '+'} {abs(value):.3g} {one}" for one, value in shown)
    more = f" and {len(ordered) - MOST_TERMS} more" if len(ordered) > MOST_TERMS else ""
    return (text.removeprefix("+ ") if text else "nothing: too small to see") + more


def calibration_verdict(found: Calibration, rows: Measurements, files: Sequence[str] = ()) -> Verdict:
    """Return the error before and after against the noise, and what to do next with the `files` given."""
    before, after = found.before.position_rms, (found.held_out or found.after).position_rms
    if before is None or after is None:
        said = f"{counted(len(found.identifiability.identified), 'parameter')} calibrated"
    else:
        where = " on held-out poses" if found.held_out is not None else ""
        said = f"Position error from {rounded(1e3 * before)} to {rounded(1e3 * after)} mm{where}"
    level: Level = level_of(found.noise) if found.claimed else "plain"
    if found.claimed:
        said += f", {found.noise:.1f} times the noise"
    if level in ("doubtful", "differs"):
        action = f"More than geometry is missing. {diagnose_command(files)} finds what."
    else:
        action = "Test the calibrated robot on fresh poses (--test, or beamstiff verify)."
    return Verdict(said, level, data_of(rows), action)


def calibration_text(found: Calibration) -> list[str]:
    """Return sentences: how many parameters, what the noise says, where the base stands."""
    seen, stated = found.identifiability, "stated noise" if found.claimed else "usual noise (none is stated)"
    lines = [
        f"{len(seen.identified)} of {counted(len(seen.names), 'parameter')} estimated, "
        f"{len(seen.dependent)} indistinguishable from others, {len(seen.silent)} without influence on "
        f"the readings; condition number {seen.condition:.3g}.",
        f"The residual is {found.noise:.2g} times the {stated}. {found.method}: {found.message}.",
    ]
    if any(item.parameter.group == "base" and item.identified for item in found.parameters):
        places = [", ".join(f"{1e3 * value:.3f}" for value in base[:3, 3]) for base in found.bases]
        shown = listed([f"({place})" for place in places], 4)
        lines.append(f"Robot base in the measuring frame: {shown} mm.")
    if found.compliances:
        lines.append(f"Stiffness: {', '.join(map(_stiffness, found.compliances))}.")
    return lines


def _stiffness(item: Found) -> str:
    unit, std = {"rad/(N*m)": "N*m/rad", "m/N": "N/m"}.get(item.parameter.unit, "Pa"), item.std or 0.0
    if item.value <= std * 2:
        return f"{item.name} over {number(1.0 / (max(item.value, 0.0) + 2 * std))} {unit}"
    return f"{item.name} {number(1.0 / item.value)} {unit} (std {100 * (std / item.value):.2g} %)"


def calibration_figure(found: Calibration, title: str) -> Figure:
    """Draw what share of the readings is off by less than so much, and every change with its 95 % interval.

    Places and turns that were set up for the measurement (base, target) are left out.
    """
    own = [item for item in found.parameters if item.identified and item.parameter.group not in SETUP]
    units = list(dict.fromkeys(item.parameter.unit for item in own))
    most = max((sum(item.parameter.unit == unit for item in own) for unit in units), default=0)
    figure = new_figure(5.0 + 3.4 * len(units), max(4.2, 1.2 + 0.26 * most))
    figure.suptitle(title)
    errors, *panels = figure.subplots(1, 1 + len(units), squeeze=False)[0]
    _errors(errors, found)
    figure.legend(loc="outside lower left", ncols=3, frameon=False)
    for axes, unit in zip(panels, units, strict=True):
        some = [item for item in own if item.parameter.unit == unit]
        shown, factor = PER_SI.get(unit, (unit, 1.0))
        change = factor * np.array([item.change for item in some])
        half = factor * WITHIN * np.array([item.std or 0.0 for item in some])
        place = np.arange(len(some))
        axes.axvline(0.0, color=GREY, linewidth=1)
        axes.errorbar(change, place, xerr=half, fmt="o", color=BLUE, capsize=3, markersize=4)
        axes.set_yticks(place, [item.name for item in some])
        axes.set(xlabel=f"change and its 95 % interval, {shown}", ylim=(len(some) - 0.4, -0.6))
        plain(axes)
    return figure


def _errors(axes: Axes, found: Calibration) -> None:
    moved, turned = (slice(0, 3), 1e3, "mm"), (slice(3, 6), 180 / np.pi, "deg")
    part, factor, unit = turned if found.after.position_rms is None else moved
    gaps = {"nominal": found.nominal_residual, "calibrated": found.residual}
    if found.held_out_residual is not None:
        gaps["held-out poses"] = found.held_out_residual
    looks = ((ORANGE, "-"), (BLUE, "-"), (GREEN, "--"))
    for (name, gap), (colour, style) in zip(gaps.items(), looks, strict=False):
        seen = gap[np.isfinite(gap[:, part]).any(axis=1), part]
        size = np.sort(factor * np.linalg.norm(np.nan_to_num(seen), axis=1))
        share = np.arange(1, size.size + 1) / size.size
        label = f"{name}: RMS {float(np.sqrt((size**2).mean())):.3g} {unit}"
        axes.step(size, share, where="post", color=colour, linestyle=style, label=label)
    axes.set(xlabel=f"error, {unit}", ylabel="share of the readings", xscale="log", ylim=(0, 1.02))
    plain(axes)


def sensitivity_figure(found: SensitivityIndices, title: str) -> Figure:
    """Draw the sensitivity indices, mean and maximum over the poses (seed 003, Figures C.21 to C.24)."""
    figure = new_figure(12.0, 8.0)
    figure.suptitle(title)
    panels = figure.subplots(2, 2)
    for column, (unit, what, error) in enumerate((("m", "lengths", "mm"), ("rad", "angles", "mrad"))):
        own = [at for at, name in enumerate(found.units) if name == unit]
        names = [found.names[at] for at in own]
        kinds = ((found.position, "position, mm"), (found.orientation, "orientation, mrad"))
        for axes, (indices, moved) in zip(panels[:, column], kinds, strict=True):
            axes.set(title=f"Errors of {what}", ylabel=f"{moved} per {error}")
            _bars(axes, names, indices[:, own])
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="upper right", ncols=2)
    return figure


def _bars(axes: Axes, names: list[str], values: Array) -> None:
    place = np.arange(len(names))
    if not names or not values.max() > 0:
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center")
    if names:
        axes.bar(place, values.max(axis=0), 0.8, color=ORANGE, alpha=0.6, hatch="//", label="largest")
        axes.bar(place, values.mean(axis=0), 0.5, color=BLUE, label="mean")
        axes.set_ylim(0, 1.1 * max(values.max(), 0.1))
    axes.set_xticks(place, names, rotation=90, fontsize="x-small")
    plain(axes)


def recursion_figure(ways: Mapping[str, Recursion], title: str) -> Figure:
    """Draw the residual after each pose of the recursion, by its name (seed 003, Figure 7)."""
    turned = any(np.isfinite(way.orientation).any() for way in ways.values())
    figure = new_figure(6.0 * (1 + turned), 4.2)
    figure.suptitle(title)
    panels = figure.subplots(1, 1 + turned, squeeze=False)[0]
    for (name, way), colour, style in zip(ways.items(), (BLUE, ORANGE), ("-", "--"), strict=False):
        steps = np.arange(len(way.position))
        panels[0].plot(steps, 1e3 * way.position, color=colour, linestyle=style, label=name)
        if turned:
            panels[1].plot(steps, np.degrees(way.orientation), color=colour, linestyle=style, label=name)
    for axes, what in zip(panels, ("position, mm", "orientation, deg"), strict=False):
        axes.set(xlabel="poses used", ylabel=f"residual {what}, RMS over all poses", yscale="log")
        plain(axes)
    panels[0].legend()
    return figure
