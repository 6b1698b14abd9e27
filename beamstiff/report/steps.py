"""How far a robot is off, one step after another: as its file says, fitted, and with each cause."""

from dataclasses import dataclass

from beamstiff.diagnosis.decomposition.causes import Cause
from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.recalibration import Recalibration
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.report import diagnosis_words as words
from beamstiff.report.tables import Table, counted, table
from beamstiff.report.verdict import rounded

TITLE = "Position error, RMS; each line adds to those above it"
INTERVAL = "90 % interval"


@dataclass(frozen=True)
class Step:
    """A model, and the position error that it leaves.

    `error`: m.
    `cause`: that was added.
    """

    model: str
    error: float
    cause: Cause | None = None


def steps(result: Diagnosis) -> list[Step]:
    """Return the models from the robot file to all causes, what each leaves, and the noise floor."""
    found, changed = result.decomposition, result.recalibration
    made = [Step("fitted model", result.rms)] if changed is None else _fitted(changed)
    if found is None:
        if result.verdict.shrink is not None:
            made.append(Step(f"with {words.causes(result)}", result.verdict.shrink.after))
        made.append(Step("any elastic model", result.ceiling))
    else:
        made += [Step(f"and {in_words([one.key])}", one.rms_after, one) for one in found.causes]
        if found.unclear:
            undecided = counted(len(found.unclear), "undecided cause")
            made.append(Step(f"and {undecided}", found.unclear[-1].rms_after))
        made += [
            Step(f"and {one.forms[0].component} (outside the library)", one.rms_after, one)
            for one in found.unmodelled
        ]
    return [*made, Step("noise floor", result.noise)]


def _fitted(changed: Recalibration) -> list[Step]:
    """Return what the file leaves, and what its calibration leaves step by step."""
    made = [Step("robot file, measuring frame fitted", changed.before)]
    if rounded(changed.placed) != rounded(changed.before):
        made.append(Step("and places of the reflectors", changed.placed))
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
            cells[0] = "\n    or ".join([step.model, *(in_words([one]) for one in cause.indistinguishable)])
            cells += [words.percent(cause.closes), words.percents(cause.closes_interval)]
            cells.append(words.chance(cause.probability))
        made.add_row(*cells)
    return made
