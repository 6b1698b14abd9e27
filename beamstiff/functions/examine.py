"""`examine`: the diagnosis on simulated campaigns, or labelled ones, whose effect is withheld from it."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from beamstiff.errors import BeamstiffError, OptionError, listed, suggest
from beamstiff.exam.blind import Control, Diagnose, Examiner, report_name
from beamstiff.exam.cases import PLAN_SHARES, SHARES, Exam, possible_effects
from beamstiff.exam.crowded.cases import CrowdedExam
from beamstiff.exam.crowded.score import crowded_dict
from beamstiff.exam.labelled import examine_folder, set_names
from beamstiff.exam.names import EFFECTS
from beamstiff.exam.record import KINDS, Kind
from beamstiff.exam.robots import with_closed_guesses
from beamstiff.exam.run import CROWDED, SINGLE, Procedure, check_results, run_cases
from beamstiff.exam.table import table_dict
from beamstiff.files import check_writable, remove_drafts
from beamstiff.functions.checks import left_out, names_of, whole
from beamstiff.functions.robots import as_robot
from beamstiff.measure.coerce import TableLike, as_tables
from beamstiff.outputs import check_replaceable
from beamstiff.robot.description import Robot
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.reader import RobotLike
from beamstiff.shown import Shown

Path_ = str | os.PathLike[str]


@dataclass(frozen=True, eq=False, repr=False)
class Examination(Shown):
    """What an exam found."""

    records: Sequence[Any]  # `Record` or `CrowdedRecord`
    settings: Mapping[str, Any]  # of what it was
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        told = crowded_dict if "crowded" in self.settings else table_dict
        return {"exam": dict(self.settings), **told(list(self.records))}


def examine(
    robot: RobotLike | None = None,
    plan: TableLike | None = None,
    *,
    cases: int = 100,
    classes: Sequence[str] | None = None,
    sets: Path_ | None = None,
    crowded: bool = False,
    compare: bool = True,
    reports: Path_ | None = None,
    out: Path_ | None = None,
    seed: int = 0,
    processes: int = 1,
    scheduler: str | None = None,
    progress: Callable[[Any], None] | None = None,
) -> Examination:
    """Examine the diagnosis on simulated campaigns whose effect is withheld from it.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot, optional
        Examine on this robot only; its `effects` are left out.
    plan : Measurements or path, optional
        Examine on these poses and loads only.
    cases : int
    classes : sequence of str, optional
        Only cases of these kinds ("null", "single", "pair", "outside", "removed") or single effects, in
        equal shares.
    sets : path, optional
        Examine on the campaigns of a folder with a ``labels.json`` instead of simulated ones.
    compare : bool
        Ask a plain regression too (best BIC), as a control.
    reports : path, optional
        Folder that keeps every diagnosis' report.
    out : path, optional
        Keeps every case's result as a line of JSON; a broken-off exam is taken up again there.
    seed : int
        Of all draws.
    processes : int
    scheduler : str, optional
        Of dask, ``tcp://host:port``.
    progress : callable, optional
        Called with every case.

    Raises
    ------
    BeamstiffError
        When the robot can have none of the effects, or no case could be simulated.
    """
    whole("cases", cases, 1)
    whole("seed", seed, 0)
    names = names_of("classes", classes)
    other = "found other options of what to examine"
    if crowded and (plan is not None or sets is not None or names):
        raise OptionError("crowded", f"{other}, expected a robot and the cases' number only")
    check_kept(out, reports, sets, cases)
    examiner = Examiner(_diagnose(), controls=_controls(crowded) if compare else {}, reports=_folder(reports))
    if sets is not None:
        if robot is not None or plan is not None or out is not None or names:
            raise OptionError("sets", f"{other}, expected the folder only")
        records = examine_folder(Path(sets), examiner, processes=processes, scheduler=scheduler)
        return Examination(records, {"sets": os.fspath(sets)})
    machine, notes = (None, []) if robot is None else _machine(as_robot(robot))
    asked: Any
    if crowded:
        asked = CrowdedExam(seed, robot=machine)
    else:
        asked, more = _asked(machine, plan, seed, names)
        notes += more
    procedure: Procedure[Any] = CROWDED if crowded else SINGLE
    kept, tell = None if out is None else Path(out), progress or (lambda _: None)
    where: dict[str, Any] = {"processes": processes, "scheduler": scheduler}
    records = run_cases(procedure, asked, cases, examiner, **where, results=kept, progress=tell)
    if not records:
        told = f"none of {cases} cases could be simulated, expected another robot or plan"
        raise BeamstiffError(f"exam: {told}")
    if len(records) < cases:
        notes.append(f"{cases - len(records)} of {cases} cases could not be simulated and count nowhere")
    return Examination(records, asked.settings(), tuple(notes))


def _machine(robot: Robot) -> tuple[Robot, list[str]]:
    """Return the robot that is examined, and what to know of it."""
    # the exam's own simulator does not know the effects of a robot
    notes = left_out(robot.effects, "the exam, neither of its machines nor of its models")
    machine = robot.model_copy(update={"effects": ()})
    return with_closed_guesses(machine), [*notes, *robot_doubts(machine)]


def _asked(
    machine: Robot | None, plan: TableLike | None, seed: int, classes: Sequence[str] | None
) -> tuple[Exam, list[str]]:
    """Return the exam of single effects that was asked for, and what to know of it."""
    if plan is not None and machine is None:
        raise OptionError("plan", "found a plan without a robot, expected: beamstiff exam ROBOT --plan CSV")
    notes: list[str] = []
    shares, effects = (SHARES if plan is None else PLAN_SHARES), EFFECTS
    if classes:
        shares, effects = shares_of(classes)
    if machine is not None:
        possible = possible_effects(machine, effects)
        missing = [effect for effect in effects if effect not in possible]
        if not possible:
            raise BeamstiffError(f"exam: robot {machine.name!r} can have none of {listed(effects)}")
        if missing:
            notes.append(f"robot {machine.name} cannot have {listed(missing, 20)}")
        effects = possible
        if "single" in shares and classes:
            shares = {**shares, "single": len(effects)}
    laid_out = None
    if plan is not None and machine is not None:
        (laid_out,) = as_tables(plan, machine, require_measured=False, what="plan")
        if laid_out.sigma_position is None:
            noise = 1e3 * Exam(seed).noise[0]
            notes.append(f"{laid_out.source} states no sigma_position; {noise:g} mm is assumed")
    return Exam(seed=seed, shares=shares, effects=effects, robot=machine, plan=laid_out), notes


def shares_of(classes: Sequence[str]) -> tuple[dict[Kind, int], tuple[str, ...]]:
    """Return shares by kind, and effects, of their names, one share each; ``single`` is all effects."""
    names, known = list(dict.fromkeys(classes)), (*KINDS, *EFFECTS)
    if unknown := [name for name in names if name not in known]:
        found = f"found {unknown[0]!r}{suggest(unknown[0], known)}"
        raise OptionError("classes", f"{found}, expected {listed(known, len(known))}")
    effects = EFFECTS if "single" in names else tuple(name for name in names if name in EFFECTS)
    shares: dict[Kind, int] = {kind: 1 for kind in KINDS if kind in names and kind != "single"}
    if effects:
        shares["single"] = len(effects)
    return shares, effects or EFFECTS


def reports_of(reports: Path_ | None, sets: Path_ | None, cases: int) -> list[str]:
    """Return the reports that an exam will write into a folder that is there already."""
    if reports is None or not Path(reports).is_dir():
        return []
    if sets is not None:
        files = [f"{name}.json" for name in set_names(Path(sets))]
    else:
        files = [report_name(case) for case in range(cases)]
    return [str(Path(reports, file)) for file in files]


def check_kept(out: Path_ | None, reports: Path_ | None, sets: Path_ | None, cases: int) -> None:
    """Refuse, before any work, to write results or reports over files that are not an exam's."""
    for path in reports_of(reports, sets, cases):
        check_replaceable(path)
    if out is not None:
        check_results(Path(out))
        check_writable(Path(out))


def _folder(reports: Path_ | None) -> Path | None:
    if reports is None:
        return None
    folder = Path(reports)
    try:
        folder.mkdir(exist_ok=True)
        remove_drafts(folder)
    except OSError as error:
        raise OptionError("reports", f"{folder} cannot be made: {error.strerror or error}") from None
    return folder


def _diagnose() -> Diagnose:
    """Return the diagnosis; loaded only here, because it takes its time."""
    diagnose: Diagnose = import_module("beamstiff.diagnosis.diagnose").diagnose
    return diagnose


def _controls(crowded: bool) -> dict[str, Control]:
    """Return the plain methods that the diagnosis is compared with."""
    if crowded:
        stepwise = import_module("beamstiff.diagnosis.control_stepwise").plain_stepwise
        return {"plain stepwise regression": stepwise}
    return {"plain regression, best BIC": import_module("beamstiff.diagnosis.control_regression").plain_bic}
