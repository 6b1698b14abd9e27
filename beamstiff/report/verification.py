"""Verdict, table and sentences of a verification: a robot with its effects on fresh rows."""

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from rich.console import RenderableType

from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.verify import MODEL, Verification
from beamstiff.errors import listed
from beamstiff.report.diagnosis_words import percent
from beamstiff.report.tables import Table, table
from beamstiff.report.verdict import Level, Verdict, diagnose_command, level_of, rounded

LITTLE = 0.03  # of the squared error: by no more than that an effect does not make rows worse
HALF = 0.5  # of the promised share: a robot that closes less is not the one that was promised
REFITTED = (
    "The measuring frame was fitted to these rows, once without and once with the effects. So an error that "
    "shifts all rows alike does not show in these lines; the promised share includes it."
)
NOTHING_TO_COMPARE = (
    "There is no before and after: the robot file holds no effects and no model. --nominal compares another."
)
SQUARES = "Shares refer to squared errors: with 75 % closed, half of the gap is left."


def verification_told(
    found: Verification, robot: str, files: Sequence[str], refitted: bool = False
) -> Iterator[RenderableType]:
    """Yield what a terminal shows of a verification.

    `robot`, `files`: as in `verification_verdict`. `refitted`: whether the measuring frame was fitted.
    """
    yield from verification_verdict(found, robot, files).lines()
    yield from _errors_told(found, refitted)


def verification_summary(found: Verification) -> Iterator[RenderableType]:
    """Yield what a verification says of itself, whatever its files are called."""
    yield _judged(found, "ROBOT", ["ROWS"]).headline  # its action would need their names
    yield from _errors_told(found, refitted=False)


def _errors_told(found: Verification, refitted: bool) -> Iterator[RenderableType]:
    if found.other_frame is None:  # errors in another frame say nothing of the effects
        yield verification_table(found)
        yield from _sentences(found, refitted)


def fresh(found: Verification) -> bool:
    """Return whether any of the rows can test the robot file: it was not fitted to them all."""
    return found.fitted < found.rows


def _sentences(found: Verification, refitted: bool) -> Iterator[str]:
    if found.base is not None:
        place = ", ".join(f"{1e3 * one:.3f}" for one in found.base[:3])
        turn = ", ".join(f"{math.degrees(one):.4f}" for one in found.base[3:])
        yield (
            f"The robot's base stands at ({place}) mm in the measuring frame, turned by ({turn}) deg "
            "(rotation vector). Use this base for a workpiece that the same instrument measures; a base "
            "fitted with a rigid model differs."
        )
    if not found.causes:
        if found.nominal is None:
            yield NOTHING_TO_COMPARE
        return
    if found.promised is not None:
        closes = f"True: {percent(found.true)}." if fresh(found) else ""
        yield f"Promised: {percent(found.promised)} of the gap closes. {closes}".strip()
    if refitted and found.absolute:
        yield REFITTED
    yield SQUARES


def verification_table(found: Verification) -> Table:
    """Return the table of position errors: without effects, with each in turn, the noise."""
    modelled = any(name.startswith(MODEL) for name, _, _ in found.causes)
    first = "without model and effects" if modelled else "without effects" if found.causes else "robot file"
    lines = (
        []
        if found.nominal is None
        else [["nominal robot, reflectors as in its file", f"{1e3 * found.nominal:.3f} mm", ""]]
    )
    lines.append([first, f"{1e3 * found.before:.3f} mm", ""])
    lines += [
        [f"{'and' if at else 'with'} {in_words([name])}", f"{1e3 * after:.3f} mm", percent(closes)]
        for at, (name, after, closes) in enumerate(found.causes)
    ]
    if found.noise > 0.0:
        lines.append(["noise as stated", f"{1e3 * found.noise:.3f} mm", ""])
    return table(f"Position error on {found.rows} rows, RMS", "robot", "error", "closes", rows=lines)


def verification_verdict(found: Verification, robot: str, files: Sequence[str]) -> Verdict:
    """Return the verdict on a robot file (its path) by the rows of some tables (their paths)."""
    data = f"{', '.join(Path(path).name for path in files)}, {found.rows} rows"
    doubt = (
        ""
        if not found.fitted
        else (
            f"The robot file was fitted to {found.fitted} of these {found.rows} rows, which cannot test it. "
            "Take rows that it has not seen."
        )
    )
    return replace(_judged(found, robot, files), data=data, doubt=doubt)


def _judged(found: Verification, robot: str, files: Sequence[str]) -> Verdict:
    left = f"{rounded(1e3 * found.after)} mm"
    if found.other_frame is not None:
        head = (
            f"These rows are not in the robot's base frame: position error {left}, "
            f"{rounded(1e3 * found.other_frame)} mm with the measuring frame fitted (--refit-frame)"
        )
        return Verdict(head, "differs", action="Run it again with --refit-frame.")
    if found.moved_points and found.placed is not None:
        return _moved_verdict(found, robot, files, left, found.placed)
    worse = in_words(_worse(found))
    if _is_more(found, found.before, found.after):
        head = (
            f"The file's effects make these rows worse: position error {rounded(1e3 * found.before)} mm "
            f"without them, {left} with them"
        )
        action = f"Do not use this robot. What makes these rows worse: {worse}. {_again(found, files)}"
        return Verdict(head, "differs", action=action)
    times = found.after / found.noise if found.noise > 0.0 else None
    level: Level = "plain" if times is None else level_of(times)
    if level == "agrees" and not fresh(found):
        level = "plain"  # nothing is judged
    head = f"Position error {left} {'with' if found.causes else 'of'} the "
    head += "file's effects" if found.causes else "robot file as it is"
    head += "" if times is None else f", {times:.1f} times the noise"
    action = _action(found, robot, files, level)
    if worse:
        action = f"Remove from the robot file what makes these rows worse: {worse}. {action}"
    if found.promised is None or found.before <= found.noise or found.true >= HALF * found.promised:
        return Verdict(head, level, action=action)
    head += f": its effects close {percent(found.true)} of the gap, promised were {percent(found.promised)}"
    return Verdict(head, "differs", action=action)


def _moved_verdict(
    found: Verification, robot: str, files: Sequence[str], left: str, placed: float
) -> Verdict:
    """Return the verdict where the measured points do not sit where the robot file says."""
    names, many = listed([name for name, _ in found.moved_points], 3), len(found.moved_points) > 1
    do, they, were = ("do", "them", "Were they") if many else ("does", "it", "Was it")
    head = (
        f"{names} {do} not sit where the robot file says: position error {left}, "
        f"{rounded(1e3 * placed)} mm with {they} placed anew"
    )
    places = "; ".join(
        f"{name} by ({', '.join(f'{1e3 * one:+.2f}' for one in by)}) mm" for name, by in found.moved_points
    )
    command = ["beamstiff", "calibrate", robot, *files, "--parameters", "base,target", "--out"]
    action = (
        f"{were} mounted anew since the robot was fitted, or is there a slip? By how much, along the axes of "
        f"the link or frame: {places}. Fit the places alone ({shlex.join(command)} NEW), and verify NEW on "
        "other rows."
    )
    return Verdict(head, "differs", action=action)


def _worse(found: Verification) -> list[str]:
    """Return the causes that make the error larger than it is with those before them, and not by little."""
    errors = pairwise([found.before, *(after for _, after, _ in found.causes)])
    return [name for (name, _, _), each in zip(found.causes, errors, strict=True) if _is_more(found, *each)]


def _is_more(found: Verification, before: float, after: float) -> bool:
    """Return whether one error is larger than another, and not by little of what there is without effects."""
    return after**2 - before**2 > LITTLE * found.before**2


def _action(found: Verification, robot: str, files: Sequence[str], level: Level) -> str:
    if not fresh(found) and level not in ("doubtful", "differs"):
        return "Measure fresh postures and verify the robot file with these."
    if level not in ("doubtful", "differs"):
        action = "Use the robot within these postures and loads."
        if found.causes:
            action += " This confirms what is predicted, not the cause: its look-alikes may predict as well."
        return action
    if found.unexplained:
        return (
            f"The robot file says what this looks like, which no effect explains: {found.unexplained}. Mend "
            "that, and measure again."
        )
    if found.causes:
        lacks = f"model still lacks something, and these rows alone hardly tell what. {_again(found, files)}"
        if level == "differs":
            return f"The {lacks}"
        axis = rounded(1e3 * found.after / math.sqrt(3.0))
        return f"If the readings scatter by {axis} mm per axis, this is noise: state it. If not, the {lacks}"
    action = f"The model still lacks something: {diagnose_command([robot, *files])} looks for it."
    if found.absolute:
        action += " It also fits the reflectors' places, should only these be wrong."
    return action


def _again(found: Verification, files: Sequence[str]) -> str:
    """Return how to diagnose all rows at once: beside effects that are known few rows tell little more."""
    return (
        "Take the robot file as it was before its effects were added, and diagnose its rows and these "
        f"together: {diagnose_command(['FIRST_ROBOT', 'FIRST_ROWS', *files])}"
        f"{' (--stations if the tracker has moved since)' * found.absolute}. Keep other rows for the next "
        "check."
    )
