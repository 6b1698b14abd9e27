"""Tables beside the causes of a diagnosis: errors step by step, courses of drifts, what would have shown."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from beamstiff.diagnosis.decomposition.causes import Cause
from beamstiff.diagnosis.drift_course import DRIFT, DriftCourse, drift_courses
from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.recalibration import Recalibration
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.smallest import Smallest
from beamstiff.errors import counted, listed
from beamstiff.report import diagnosis_words as words
from beamstiff.report.calibrated_text import as_described, reflectors_moved
from beamstiff.report.tables import Column, Table, below, number, scale_of, table
from beamstiff.report.verdict import rounded

TITLE = "Position error, RMS; each line adds to those above it"
INTERVAL = "90 % interval"
HIDDEN = 3  # places that are named
LISTED = 5  # look-alikes of one cause that a table lists
REVEALED = "Smallest effects that data like these would reveal"


@dataclass(frozen=True)
class Step:
    """A model, and the position error that it leaves."""

    model: str
    error: float  # m
    cause: Cause | None = None  # that was added


def steps(result: Diagnosis) -> list[Step]:
    """Return the models from the robot file to all causes, what each leaves, and the noise floor."""
    found, changed = result.decomposition, result.recalibration
    made = [Step("fitted model", result.rms)] if changed is None else _fitted(result, changed)
    if found is None:
        if result.verdict.shrink is not None:
            made.append(Step(f"with {words.causes(result)}", result.verdict.shrink.after))
        made.append(Step("least with effects of the library", result.ceiling))
    else:
        made += [Step(f"and {in_words([one.key])}", one.rms_after, one) for one in found.causes]
        if found.unclear:
            undecided = counted(len(found.unclear), "undecided cause")
            made.append(Step(f"and {undecided}", found.unclear[-1].rms_after))
        made += [
            Step(f"and {one.looks_like} (outside the library)", one.rms_after, one)
            for one in found.unmodelled
        ]
    return [*made, Step("noise floor", result.noise)]


def _fitted(result: Diagnosis, changed: Recalibration) -> list[Step]:
    """Return what the file leaves, and what its calibration leaves step by step."""
    before, placed = as_described(result)
    made, fitted = list[Step](), ", measuring frame fitted"
    if result.start_values and before != changed.before:
        made.append(Step(f"robot file, drives and links rigid{fitted}", before))
    else:
        if changed.rigid is not None and rounded(1e3 * changed.rigid) != rounded(1e3 * before):
            made, fitted = [Step(f"robot file, drives and links rigid{fitted}", changed.rigid)], ""
        guess = " (start values)" if result.start_values else ""
        stiffness = f", its stiffness{guess}" if made or guess else ""
        made.append(Step(f"robot file{stiffness}{fitted}", before))
    if reflectors_moved(result):
        made.append(Step("and places of the reflectors", placed))
    if changed.stiff is None or rounded(changed.stiff) == rounded(changed.after):
        return [*made, Step("and geometry", changed.after)]
    return [*made, Step("and geometry", changed.stiff), Step("and stiffness of the drives", changed.after)]


def steps_table(result: Diagnosis) -> Table:
    """Return the position error of each step, and what is known of the cause that it adds."""
    some = steps(result)
    told = ["closes", INTERVAL, "probability"] if any(step.cause for step in some) else []
    made = table(TITLE, "model", "error", *told)
    for step in some:
        cells = [step.model, f"{1e3 * step.error:.3f} mm"]
        if (cause := step.cause) is not None:
            alike = [in_words([one]) for one in cause.indistinguishable]
            if len(alike) > LISTED + 1:
                alike[LISTED:] = [f"one of {len(alike) - LISTED} more, in --json"]
            cells[0] = "\n    or ".join([step.model, *alike])
            cells += [words.percent(cause.closes), words.percents(cause.closes_interval)]
            cells.append(words.chance(cause.probability))
        made.add_row(*cells)
    return made


def smallest_table(result: Diagnosis) -> Table:
    """Return, an effect a row, how large it would have had to be where it shows best, and where worst.

    On a console an effect and its parameter stand in one cell, so that the table fits into 80 columns.
    """
    heads = [("effect", "page"), ("effect, its parameter", "console"), ("parameter", "page")]
    heads += [("size where it shows best", ""), ("where it shows worst", "")]
    made = table(REVEALED, *(Column(name, left=True, only=only) for name, only in heads))
    for effect, some in _by_effect(result).items():
        if seen := sorted((one for one in some if not one.hidden), key=lambda one: one.size):
            name, last = seen[0].parameter.name, _said(seen[-1]) if len(seen) > 1 else "-"
            made.add_row(effect, below(effect, name), name, _said(seen[0]), last)
    return made


def hidden_text(result: Diagnosis) -> str:
    """Return, in words, which effects of a realistic size these rows would not have shown, and where."""
    each = []
    for effect, some in _by_effect(result).items():
        names = [one.key.partition(":")[2] for one in some if one.hidden]
        if names:
            each.append(effect + (f" at {listed(names, HIDDEN)}" if len(names) < len(some) else ""))
    return f"These rows would show no realistic size of: {'; '.join(each)}." if each else ""


def _by_effect(result: Diagnosis) -> dict[str, list[Smallest]]:
    found: dict[str, list[Smallest]] = {}
    for one in result.smallest:
        found.setdefault(one.key.partition(":")[0], []).append(one)
    return found


def _said(one: Smallest) -> str:
    factor, unit = scale_of([one.size], one.parameter.unit)
    place = one.key.partition(":")[2]
    return f"{factor * one.size:.2g} {unit}" + ("" if place == "null" else f" at {place}")


def drift_tables(result: Diagnosis) -> Iterator[Table]:
    """Yield the course of each drift that was found: its mean over each part of the campaign."""
    rows = result.baseline.rows
    for course in drift_courses(result):
        made = table(f"{course_title(course)}, mm, base frame", "from", "to", "x", "y", "z")
        named = course.unit == "s" and len(rows.sources) > 1
        for ends, mean in zip(course.ends, course.means, strict=True):
            of = [f"{rows.sources[rows.run[at]]}: " if named else "" for at in ends]
            at = [f"{number(float(course.at[k]))} {course.unit}" for k in ends]
            made.add_row(
                of[0] + at[0], of[1] + at[1], *(f"{1e3 * value + 0.0:.3f}" for value in mean.tolist())
            )
        yield made


def course_title(course: DriftCourse) -> str:
    """Return, in words, what the course of a drift is of."""
    what = "positions, against the first" if course.absolute else "displacements"
    how = re.sub(r"(within|lagging by) ([\d.]+)", r"\1 \2 of the campaign", course.shape)
    return f"Course of {DRIFT} ({how}): what it adds to the {what}"
