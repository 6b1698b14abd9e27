"""What the calibration beside the causes of a diagnosis changed, in words."""

import numpy as np

from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.recalibration import Change, Recalibration
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import listed
from beamstiff.report.diagnosis_words import stiffness_in_words
from beamstiff.report.tables import scale_of, times_off, worth
from beamstiff.report.verdict import level_of, rounded
from beamstiff.robot.stiffness import parameter_unit

NAMED = 3  # changes that are told
ELSEWHERE = 0.01  # m between file and reflector from which a load at the file's place is another load


def calibrated_away(result: Diagnosis) -> str:
    """Return, in words, what calibration had to correct of the robot file; empty of one that agreed."""
    changed = result.recalibration
    if changed is None or level_of(changed.before / result.noise) == "agrees":
        return ""
    if level_of(changed.placed / result.noise) == "agrees":
        return f"The reflector's place in the robot file is off by {rounded(1e3 * changed.before)} mm"
    return f"Geometry in the robot file is off by {rounded(1e3 * changed.placed)} mm"


def recalibration_text(changed: Recalibration) -> list[str]:
    """Return, in words, what the geometry beside the causes changed, and what it is worth by itself."""
    placed = ""
    if rounded(changed.placed) != rounded(changed.before):
        placed = f", {rounded(1e3 * changed.placed)} mm with the places of the reflectors fitted"
    gap = (
        f"Geometry: with the robot file as it is, the gap is {rounded(1e3 * changed.before)} mm RMS "
        f"(measuring frame fitted){placed}, {rounded(1e3 * changed.after)} mm with the geometry calibrated "
        "(held-out data)."
    )
    if not changed.changes:
        return [gap]
    each = ", ".join(_change(one) for one in changed.changes[:NAMED])
    rest = len(changed.changes) - NAMED
    more = f" ({rest} more in --json and --apply)" if rest > 0 else ""
    return [gap, f"Largest changes, with standard deviations: {each}{more}."]


def _change(one: Change) -> str:
    factor, unit = scale_of([one.by], one.parameter.unit)
    value, std = worth(factor * one.by, factor * one.std)
    sign = "+" if one.by > 0.0 else ""
    zero = "zero of " if one.parameter.group == "offset" else ""
    spread = f" ± {std}" if one.std else ""
    return f"{zero}{one.parameter.name} {sign}{value}{spread} {unit}"


def moved_load(result: Diagnosis) -> str:
    """Return, in words, that calibration moved the loads with the reflector; empty where it did not."""
    rows, changed = result.baseline.rows, result.recalibration if result.baseline.absolute else None
    loaded = set(rows.load_point[np.abs(rows.wrench).max(axis=1) > 0.0].tolist())
    far: dict[str, float] = {}
    for one in () if changed is None else changed.changes:
        node = one.parameter.name.rpartition(".")[0]
        if one.parameter.group == "target" and node in loaded & set(rows.point.tolist()):
            far[node] = np.hypot(far.get(node, 0.0), one.by)
    node = max(far, key=lambda one: far[one], default="")
    if not node or far[node] < ELSEWHERE:
        return ""
    return (
        f"Check where the loads act. The calibration found the reflector {1e3 * far[node]:.0f} mm from its "
        f"place {node} in the robot file, and the loads are assumed to act where the reflector is. If they "
        f"act elsewhere, give the reflector its own link and name it in the column point (docs/tutorial.md)."
    )


def stiffness_text(result: Diagnosis) -> str:
    """Return, in words, which fitted stiffness is farthest from the file's, and which no load touches."""
    untouched = listed(result.untouched)
    unknown = f"Not touched by these loads, and kept as in the robot file: {untouched}." if untouched else ""
    return "\n".join(filter(None, [_largest_change(result), unknown]))


def _largest_change(result: Diagnosis) -> str:
    fitted = result.fitted_stiffness
    if result.decomposition is None and result.fits:  # of the fit with the causes, as --apply writes it
        found = extended(result)
        fitted = {name: (given, found.parameter(name)) for name, (given, _) in fitted.items()}
    finite = {
        name: (given, value)
        for name, (given, value) in fitted.items()
        if 0.0 < given < np.inf and name not in result.undetermined
    }
    if not finite:
        return ""
    name, (given, value) = max(finite.items(), key=lambda item: abs(np.log(item[1][1] / item[1][0])))
    robot = result.baseline.nominal
    unit, joint = parameter_unit(robot, name), name.rpartition(".")[0]
    variable = next((one.variable for one in robot.joints if one.name == joint and one.variable), joint)
    of = f"{name} (of {variable})" if variable != joint else name
    off = "" if 0.5 < value / given < 2.0 else f", {times_off(value / given)}"
    return (
        f"Fitted stiffness: the largest change is that of {of}, from {stiffness_in_words(given)} in the "
        f"robot file to {stiffness_in_words(value)} {unit}{off} (all values: --json and --apply)."
    )
