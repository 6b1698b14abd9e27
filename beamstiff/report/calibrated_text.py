"""What the calibration beside the causes of a diagnosis changed, in words."""

from collections.abc import Sequence

import numpy as np

from beamstiff.calibration.parameters import AXES
from beamstiff.diagnosis.decomposition.causes import NOISE
from beamstiff.diagnosis.recalibration import Change, Recalibration, gap_of_rigid
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import listed
from beamstiff.report.diagnosis_words import stiffness_in_words
from beamstiff.report.identification import far_off
from beamstiff.report.tables import Table, table, worth
from beamstiff.report.verdict import level_of, rounded
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness_parameters import parameter_unit

NAMED = 3  # changes of each kind that are told
KINDS = {"rad": ("angle", "mrad"), "m": ("length", "mm")}
MOST_DRIVES = 12  # that a terminal lists
ABOUT = {"alpha": "turn about x", "beta": "turn about y", "theta": "turn about z", "gamma": "turn about z"}
ABOUT |= {"d": "shift along x", "r": "shift along z", "b": "shift along z"}
ELSEWHERE = 0.01  # m between file and reflector from which a load at the file's place is another load


def as_described(result: Diagnosis) -> tuple[float, float]:
    """Return the error of the robot file, m: the measuring frame fitted, and the reflectors placed too.

    Of the rigid robot where stiffness in the file is a guess: what that leaves says nothing.
    """
    changed = result.recalibration
    assert changed is not None
    if changed.rigid is not None and changed.rigid_placed is not None and described_rigid(result):
        return changed.rigid, changed.rigid_placed
    return changed.before, changed.placed


def described_rigid(result: Diagnosis) -> bool:
    """Return whether the error of the robot file is told of the rigid robot, where that is known."""
    changed = result.recalibration
    return bool(result.start_values) and changed is not None and changed.rigid_placed is not None


def as_read_elsewhere(result: Diagnosis, written: Robot) -> str:
    """Return, in words, how far off a written robot is for programs that read its geometry alone."""
    rows = result.baseline.rows
    if result.recalibration is None or result.recalibration.rigid is None:
        return ""
    off = rounded(1e3 * gap_of_rigid(written, rows))
    return f"; a program that knows neither deflection nor effects is {off} mm off with its geometry"


def reflectors_moved(result: Diagnosis) -> bool:
    """Return whether placing the reflectors anew, and nothing else, changes the error."""
    before, placed = as_described(result)
    return rounded(1e3 * placed) != rounded(1e3 * before)


def calibrated_away(result: Diagnosis) -> str:
    """Return, in words, what calibration had to correct of the robot file; empty of one that agreed."""
    changed = result.recalibration
    if changed is None or level_of(changed.before / result.noise) == "agrees":
        return ""
    if level_of(changed.placed / result.noise) == "agrees":
        far = max(_off_by_node(changed).values(), default=changed.before)
        return f"The reflector's place in the robot file is off by {rounded(1e3 * far)} mm"
    if result.start_values:  # how far these are off says nothing of the robot
        if changed.rigid_placed is None:
            return "The robot file has start values of stiffness"
        return f"The robot of the file, as rigid, is off by {rounded(1e3 * changed.rigid_placed)} mm"
    off = f"off by {rounded(1e3 * changed.placed)} mm"
    stiff = changed.after if changed.stiff is None else changed.stiff
    if level_of(stiff / result.noise) == level_of(changed.after / result.noise):
        return f"Geometry in the robot file is {off}"
    return (
        f"Geometry and drive stiffness in the robot file are {off} (by the drives alone "
        f"{rounded(1e3 * stiff)} mm)"
    )


def calibrated_worse(result: Diagnosis) -> str:
    """Return, in words, that held-out postures are predicted worse than by the robot file; mostly empty.

    Few new postures correct a robot that is calibrated already by what is chance in them.
    """
    changed, found = result.recalibration, result.decomposition
    if changed is None or found is None:
        return ""
    left = min([result.rms, *(one.rms_after for one in found.every)])
    if left <= changed.placed:
        return ""
    return (
        f"calibrated on these postures the robot leaves {rounded(1e3 * left)} mm on held-out ones, as it is "
        f"{rounded(1e3 * changed.placed)} mm: too few to correct it"
    )


def changes_text(result: Diagnosis, others: str = "in --json and --apply") -> str:
    """Return what changed most in the geometry beside the causes; empty where nothing did.

    The `others` stand elsewhere, what the readings do not determine by itself among them, and what is no
    larger than its standard deviation.
    """
    changed = result.recalibration
    if changed is None or not changed.changes:
        return ""
    known = [one for one in changed.changes if one.std]
    sure = _by_kind([one for one in known if abs(one.by) > one.std] or known or changed.changes)
    each = "; ".join(
        f"{kind}s: {', '.join(f'{_in_words(one)} {unit}' for one in some[:NAMED])}"
        for (kind, unit), some in sure.items()
    )
    each = each[:1].upper() + each[1:]
    rest = len(changed.changes) - sum(len(some[:NAMED]) for some in sure.values())
    more = f" ({rest} more {others})" if rest > 0 else ""
    moved = reflectors_off(changed)
    if moved:
        more += f". Reflectors stand elsewhere than in the robot file: {listed(moved, NAMED)}"
    alike = (
        f" {listed(changed.together)} moved alike, which mounts of their own hardly do: their link is off, "
        "and the tool on it. A reflector at the tool would correct its place."
        if changed.together
        else ""
    )
    doubt = f" (which {doubt})" if (doubt := uncounted(result)) else ""
    return f"Largest changes of the geometry, with standard deviations{doubt}. {each}{more}.{alike}"


def uncounted(result: Diagnosis) -> str:
    """Return, in words, what standard deviations leave out beside a gap that nothing explains."""
    explained = result.left <= NOISE * result.noise
    if result.verdict.effect != "unknown" or explained:
        return ""
    return "do not count what the unexplained gap may have moved"


def reflectors_off(changed: Recalibration) -> list[str]:
    """Return how far reflectors stand from their places in the robot file, in words, the farthest first."""
    off = sorted(_off_by_node(changed).items(), key=lambda one: -one[1])
    return [f"{node} by {rounded(1e3 * by)} mm" for node, by in off]


def _off_by_node(changed: Recalibration) -> dict[str, float]:
    """Return how far each reflector stands from its place in the robot file, m."""
    off: dict[str, float] = {}
    for one in changed.changes:
        node, _, axis = one.parameter.name.rpartition(".")
        if one.parameter.group == "target" and axis in AXES:
            off[node] = float(np.hypot(off.get(node, 0.0), one.by))
    return off


def changes_table(changed: Recalibration, title: str) -> Table:
    """Return all that the calibration changed: angles and lengths in a column each, the largest first."""
    kinds = _by_kind(changed.changes)
    made = table(title, "parameter", *(head for kind, unit in kinds for head in (f"{kind}, {unit}", "std")))
    for place, some in enumerate(kinds.values()):
        for one in some:
            made.add_row(_named(one), *[""] * (2 * place), *_size(one))
    made.most = NAMED
    return made


def _by_kind(changes: Sequence[Change]) -> dict[tuple[str, str], list[Change]]:
    """Return the changes by what they are and its unit, in the order of their sizes: a mrad is no mm."""
    kinds: dict[tuple[str, str], list[Change]] = {}
    for one in changes:
        kinds.setdefault(KINDS[one.parameter.unit], []).append(one)
    return kinds


def _in_words(one: Change) -> str:
    value, std = _size(one)
    return f"{_named(one)} {value}{f' ± {std}' if std else ''}"


def _named(one: Change) -> str:
    """Return what changed, for people."""
    zero = "zero of " if one.parameter.group == "offset" else ""
    about = ABOUT.get(one.parameter.name.rpartition(".")[2], "") if one.parameter.group == "frame" else ""
    return f"{zero}{one.parameter.name}{f' ({about})' if about else ''}"


def _size(one: Change) -> tuple[str, str]:
    """Return a change with its sign and its standard deviation, if it has one, in mrad or mm."""
    value, std = worth(1e3 * one.by, 1e3 * one.std)
    return f"{'+' * (one.by > 0.0)}{value}", std if one.std else ""


def moved_load(result: Diagnosis) -> str:
    """Return, in words, that calibration moved the loads with the reflector; empty where it did not."""
    rows, changed = result.baseline.rows, result.recalibration if result.baseline.absolute else None
    loaded = set(rows.load_point[np.abs(rows.wrench).max(axis=1) > 0.0].tolist())
    off = {} if changed is None else _off_by_node(changed)
    far = {node: by for node, by in off.items() if node in loaded & set(rows.point.tolist())}
    node = max(far, key=lambda one: far[one], default="")
    if not node or far[node] < ELSEWHERE:
        return ""
    return (
        f"Check where the loads act. The calibration found the reflector {1e3 * far[node]:.0f} mm from its "
        f"place {node} in the robot file, and the loads are assumed to act where the reflector is. If they "
        f"act elsewhere, give the reflector its own link and name it in the column point (docs/tutorial.md)."
    )


def far_stiffness(result: Diagnosis) -> dict[str, float]:
    """Return which determined stiffness is far from the robot file, and by how many times (`far_off`)."""
    vague = {*result.untouched, *result.undetermined}
    values = {name: ends for name, ends in result.fitted_stiffness.items() if name not in vague}
    return far_off(values, result.baseline.given or result.baseline.nominal)


def _over(result: Diagnosis, name: str, value: float, std: float) -> str:
    """Return, in words, how stiff a drive is at least by the rows; empty where any machine's is so stiff."""
    least = 1.0 / (1.0 / value + 2.0 * std)
    return f", over {least:.2g}" if least > result.softest.get(name, 0.0) else ""


def drives_table(result: Diagnosis, title: str) -> Table:
    """Return the fitted stiffness, what the rows determine first, the softest first."""
    made = table(title, "parameter", "robot file", "stiffness", "std", "unit")
    robot = result.baseline.nominal
    axes = {one.name: one.variable for one in robot.joints}
    rows, far = [], far_stiffness(result)
    for name, (given, value) in result.fitted_stiffness.items():
        joint = name.rpartition(".")[0]
        of = f" (of {axes[joint]})" if axes.get(joint) not in (None, joint) else ""
        std = result.compliance_std.get(name, np.inf)
        known, unit = name not in result.undetermined, parameter_unit(robot, name)
        if name in result.untouched:
            known, said = False, "kept: no load touches it"
        elif name in result.kept:
            known, said = False, f"kept: not determined{_over(result, name, value, std)}"
        elif known:
            said = f"{100.0 * std * value:.2g} %"
        else:
            said = f"not determined{_over(result, name, value, std)}"
        digits = worth(value, std * value**2)[0] if known else f"{value:.2g}"
        mark = " (!)" if name in far else ""
        cells = name + of + mark, stiffness_in_words(given), digits, said, unit
        rows.append(((not known, unit, value), cells))
    for _, cells in sorted(rows):
        made.add_row(*cells)
    made.most = MOST_DRIVES
    return made
