"""One case examined blind: sealed, diagnosed from rows alone, reported, and only then opened."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.cases import Case, Exam
from beamstiff.exam.names import is_named, normal
from beamstiff.exam.record import Answer, Record, answer_of, failed, sha256
from beamstiff.exam.simulate import simulate, table_of
from beamstiff.exam.sizes import linear_fit, true_rows, whitened_gap
from beamstiff.measure.table import Measurements
from beamstiff.outputs import write_output
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

A = TypeVar("A")  # what is read of a report
NO_GAP = 1e-6  # m; below this new rows have nothing to close


class Diagnosis(Protocol):
    """What a diagnosing function returns."""

    def to_dict(self) -> dict[str, Any]:
        """Return the report, as in the format ``beamstiff-diagnosis/1``."""

    def predict_shift(self, measurements: Measurements) -> tuple[Array, Array]:
        """Return what the fitted baseline, and it with the verdict's effects, say of new rows, (N, 6)."""


class Diagnose(Protocol):
    """A diagnosing function: it is given the model and the rows, and what its library has to do without."""

    def __call__(
        self, robot: Robot, measurements: Measurements, *, without: Sequence[str] = (), seed: int = 0
    ) -> Diagnosis:
        """Return the diagnosis."""


# a plain method: model, rows and what is withheld in, ``effect:component``, ``none`` or a report out; on
# crowded machines a diagnosis
Control = Callable[[Robot, Measurements, Sequence[str]], str | Mapping[str, Any] | Diagnosis]
# residuals (N, 6), m and rad, that the fitted model leaves of the noise-free rows of each set of truths
Baseline = Callable[[Case, Sequence[Sequence[Truth]]], list[Array]]


def linear_baseline(case: Case, sets: Sequence[Sequence[Truth]]) -> list[Array]:
    """Return residuals of the linear fit of the compliances that the robot lists to identify."""
    fit = linear_fit(case.robot, case.machine, case.campaign)
    return [fit.residual(truths) for truths in sets]


@dataclass(frozen=True)
class Examiner:
    """Who is examined, and how."""

    diagnose: Diagnose
    baseline: Baseline = linear_baseline  # fits noise-free rows; the residual it leaves is the gap
    controls: Mapping[str, Control] = field(default_factory=dict)  # plain methods to compare with
    reports: Path | None = None  # folder for every report, as ``case-000012.json``


def keep_report(examiner: Examiner, name: str, report: dict[str, Any]) -> None:
    """Write a report into the examiner's folder, if there is one."""
    if examiner.reports is not None:
        write_output(examiner.reports / name, json.dumps(report, indent=1) + "\n")


def report_name(case: int) -> str:
    """Return the name of the file of a case's report."""
    return f"case-{case:06d}.json"


def examined(exam: Exam, drawn: Case, examiner: Examiner) -> tuple[Record, dict[str, Any]]:
    """Return the record of a case that was drawn, and the report of its diagnosis; nothing is written."""
    case, seal = drawn.label.case, drawn.label.digest()
    rows = simulate(drawn.machine, drawn.truths, drawn.campaign, np.random.default_rng([exam.seed, case, 1]))
    outcome = diagnosed(drawn.robot, rows, drawn.label.withheld, examiner)
    answer, error, shifts = outcome.answer, outcome.error, None
    if outcome.diagnosis is not None and is_named(answer.verdict):
        try:
            shifts = outcome.diagnosis.predict_shift(unmeasured(drawn.robot, drawn.fresh))
        except Exception as failure:  # whatever it is: the case counts as failed, the exam goes on
            answer, error = failed(), one_line(failure)
    report_seal = sha256({"report": outcome.report, "promise": None if shifts is None else plain(shifts)})
    controls = {
        name: control_verdict(method, drawn.robot, rows, drawn.label.withheld)
        for name, method in examiner.controls.items()
    }
    # from here on the label is open
    gap, gaps = _gaps(drawn, examiner.baseline)
    shrink = None if shifts is None else true_shrink(drawn, *shifts)
    seconds = outcome.seconds
    record = Record(drawn.label, answer, gap, gaps, shrink, controls, seal, report_seal, seconds, error)
    return record, outcome.report


def true_shrink(case: Case, before: Array, after: Array) -> float | None:
    """Return ``1 - (after/before)^2`` of the RMS position errors on new rows, clipped to [0, 1].

    None where the truth holds outliers, which new rows do not have, and where they show no gap at all.
    """
    if any(truth.effect == "outliers" for truth in case.truths):
        return None
    truth = true_rows(case.machine, case.truths, case.fresh)[:, :3]
    left = [float(np.square(predicted[:, :3] - truth).sum(axis=1).mean()) for predicted in (before, after)]
    if left[0] < NO_GAP**2:
        return None
    return float(np.clip(1.0 - left[1] / left[0], 0.0, 1.0))


def unmeasured(robot: Robot, fresh: SimulatedCampaign) -> Measurements:
    """Return new rows as a plan: poses and loads, nothing measured."""
    nothing = np.full((len(fresh), 6), np.nan)
    absolute = fresh.kind == "absolute"
    read = {"position": nothing[:, :3]} if absolute else {"displacement": nothing}
    return table_of(robot, fresh, **read)


@dataclass(frozen=True, eq=False)
class Outcome(Generic[A]):
    """The result of a diagnosis: nothing but an error where it broke off."""

    answer: A
    diagnosis: Diagnosis | None
    report: dict[str, Any]
    seconds: float
    error: str | None


def attempted(ask: Callable[[], Diagnosis], read: Callable[[dict[str, Any]], A], failure: A) -> Outcome[A]:
    """Return the outcome of a diagnosis, its report read; where it breaks off, why."""
    start = time.perf_counter()
    try:
        diagnosis = ask()
        report = diagnosis.to_dict()
        answer = read(report)
    except Exception as error:  # whatever it is: the case counts as failed, the exam goes on
        return Outcome(failure, None, {}, time.perf_counter() - start, one_line(error))
    return Outcome(answer, diagnosis, report, time.perf_counter() - start, None)


def diagnosed(
    robot: Robot, rows: Measurements, withheld: Sequence[str], examiner: Examiner
) -> Outcome[Answer]:
    """Return the outcome of the examined diagnosis on the rows."""
    return attempted(lambda: examiner.diagnose(robot, rows, without=withheld, seed=0), answer_of, failed())


def control_verdict(method: Control, robot: Robot, rows: Measurements, withheld: Sequence[str]) -> str:
    """Return the verdict of a plain control on the rows, ``effect:component``."""
    try:
        report = method(robot, rows, withheld)
        if isinstance(report, str):
            return normal(report)
        return answer_of(report if isinstance(report, Mapping) else report.to_dict()).verdict
    except Exception:  # a control that breaks off is wrong
        return normal("failed")


def _gaps(case: Case, baseline: Baseline) -> tuple[float, tuple[float, ...]]:
    if not case.truths:
        return 0.0, ()
    sets = [case.truths, *((truth,) for truth in case.truths)] if len(case.truths) > 1 else [case.truths]
    residuals = baseline(case, sets)
    gap, *single = (whitened_gap(case.campaign, residual) for residual in residuals)
    return gap, tuple(single) or (gap,)


def plain(shifts: tuple[Array, Array]) -> list[list[list[float | None]]]:
    """Return predictions as plain data, to be sealed."""
    return [[[round(v, 12) if v == v else None for v in row] for row in s.tolist()] for s in shifts]


def one_line(error: Exception) -> str:
    """Return an error as one line of at most 300 characters."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]
