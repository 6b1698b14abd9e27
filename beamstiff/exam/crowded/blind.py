"""One crowded case examined blind: sealed, diagnosed by all from the rows alone, and only then opened."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from beamstiff.exam.blind import Diagnosis, Examiner, attempted, one_line, plain, unmeasured
from beamstiff.exam.campaign import Array
from beamstiff.exam.crowded.cases import CrowdedCase, CrowdedExam
from beamstiff.exam.crowded.record import EXAMINED, CrowdedRecord, Reply
from beamstiff.exam.names import FAILED, key_of, normal
from beamstiff.exam.record import sha256
from beamstiff.measure.registration import fit_rigid_motion

Shifts = tuple[Array, Array]
Report = Mapping[str, Any]


def examined_crowded(
    exam: CrowdedExam, drawn: CrowdedCase, examiner: Examiner
) -> tuple[CrowdedRecord, dict[str, Any]]:
    """Return the record of a case that was drawn, and all reports on it by who made them."""
    seal, robot = drawn.label.digest(), drawn.robot
    rows = drawn.measured(np.random.default_rng([exam.seed, drawn.label.case, 4]))
    asked: dict[str, Callable[[], Any]] = {
        EXAMINED: partial(examiner.diagnose, robot, rows, without=(), seed=0)
    }
    asked |= {name: partial(control, robot, rows, ()) for name, control in examiner.controls.items()}
    answers = {name: _answer(ask, drawn) for name, ask in asked.items()}
    reports = {name: dict(report) for name, (_, report, _) in answers.items()}
    promises = {name: shifts and plain(shifts) for name, (_, _, shifts) in answers.items()}
    report_seal = sha256({"reports": reports, "promises": promises})
    # from here on the label is open
    replies = {name: _opened(reply, shifts, drawn) for name, (reply, _, shifts) in answers.items()}
    return CrowdedRecord(drawn.label, replies, seal, report_seal), reports


def _answer(ask: Callable[[], Diagnosis], drawn: CrowdedCase) -> tuple[Reply, Report, Shifts | None]:
    """Return what was said of the rows, and what it says of the fresh poses if it names anything."""
    found = attempted(ask, reply_of, Reply(normal(FAILED)))
    reply = replace(found.answer, seconds=found.seconds, error=found.error)
    if found.diagnosis is None or not reply.named:
        return reply, found.report, None
    try:
        return reply, found.report, found.diagnosis.predict_shift(unmeasured(drawn.robot, drawn.fresh))
    except Exception as error:  # the names stand; its promise is compared with no gain
        return replace(reply, error=one_line(error)), found.report, None


def reply_of(report: Report) -> Reply:
    """Return what a report says, format ``beamstiff-diagnosis/1`` with ``causes``.

    >>> verdict = {"effect": "unknown", "component": None}
    >>> cause = {"effect": "backlash", "component": "q3", "closes": 0.4, "indistinguishable": []}
    >>> remainder = {"rms_mm": 0.2, "unclear": [{"one_of": ["hysteresis:q3"], "closes": 0.1}]}
    >>> reply = reply_of({"verdict": verdict, "causes": [cause], "remainder": remainder})
    >>> reply.verdict, reply.named, reply.promised, reply.said_mm
    ('unknown:null', ('backlash:q3',), 0.5, 0.2)
    """
    verdict, causes = report["verdict"], report["causes"]
    first = causes[0] if causes else verdict
    remainder = report.get("remainder") or {}
    said = remainder.get("rms_mm")
    # what is undecided is in the robot that predicts, and what lies outside the library but has an effect
    outside = [law for law in remainder.get("outside_library", ()) if "effect" in law]
    written = [*causes, *remainder.get("unclear", ()), *outside]
    return Reply(
        verdict=key_of(verdict["effect"], verdict["component"]),
        named=tuple(key_of(cause["effect"], cause["component"]) for cause in causes),
        alike=tuple(normal(text) for text in first.get("indistinguishable") or ()),
        promised=float(sum(cause["closes"] or 0.0 for cause in written)),
        said_mm=None if said is None else float(said),
    )


def _opened(reply: Reply, shifts: Shifts | None, drawn: CrowdedCase) -> Reply:
    """Return a reply with what its causes really leave, and close on fresh poses."""
    if reply.said_mm is None:
        return reply
    label = drawn.label
    real = {cause for key in reply.named if (cause := label.named_by(key)) is not None}
    ends = [
        float(np.hypot(1e3 * drawn.left_by([*some]), label.noise_mm))
        for some in (real | {cause for cause in label.library if cause.hidden}, real)
    ]
    closing = 0.0 if reply.named else None
    if shifts is not None:
        closing = true_closing(drawn.fresh_positions(), drawn.fresh.kind, shifts)
    return replace(reply, least_mm=ends[0], left_mm=ends[1], closing=closing)


def true_closing(truth: Array, kind: str, shifts: Shifts) -> float:
    """Return ``1 - (after/before)^2`` of the RMS errors against true positions (N, 3), clipped to [-1, 1].

    Absolute positions are first laid over the true ones, as the measuring frame is not known.
    """
    squares = []
    for predicted in shifts:
        error = truth - predicted[:, :3]
        if kind == "absolute":
            error = fit_rigid_motion(predicted[:, :3], truth).residuals
        squares.append(float(np.square(error).sum()))
    return float(np.clip(1.0 - squares[1] / squares[0], -1.0, 1.0))
