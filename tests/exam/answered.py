"""Answered cases made by hand: a truth, a verdict, and what else a test is about."""

from typing import Any

from beamstiff.exam.names import NONE, UNKNOWN, is_named, normal
from beamstiff.exam.record import Answer, Label, Record


def answered(truth: str = "backlash:q3", verdict: str = "none", **more: Any) -> Record:
    """Return a case; `truth` is ``none``, or one effect or two joined by a blank.

    More: case, kind, gap, gaps, also, set (declared equivalents), p (of the verdict), probabilities,
    promised, shrink, controls, robot, design, readings, author, withheld.
    """
    truths = () if truth == "none" else tuple(normal(key) for key in truth.split())
    kind = more.get("kind", ("null", "single", "pair")[len(truths)])
    gap = more.get("gap", 0.0 if kind == "null" else 2.0)
    verdict, p = normal(verdict), more.get("p", 1.0)
    label = Label(
        case=more.get("case", 0),
        kind=kind,
        truths=truths,
        sizes=(0.5,) * len(truths),
        withheld=more.get("withheld", ()),
        robot=more.get("robot", "kr240-2"),
        design=more.get("design", "rich"),
        data="displacement",
        claimed="true",
        readings=more.get("readings", 6),
        author=more.get("author", 1),
    )
    answer = Answer(
        verdict=verdict,
        probability=p,
        also=tuple(map(normal, more.get("also", ()))),
        indistinguishable=tuple(map(normal, more.get("set", ()))),
        probabilities={normal(k): v for k, v in more.get("probabilities", {verdict: p}).items()},
        promised=more.get("promised", 0.9 if is_named(verdict) else None),
    )
    return Record(
        label=label,
        answer=answer,
        gap=gap,
        gaps=more.get("gaps", (gap,) * len(truths)),
        shrink=more.get("shrink", 0.9 if is_named(verdict) else None),
        controls={k: normal(v) for k, v in more.get("controls", {}).items()},
        label_sha256="",
        report_sha256="",
        seconds=0.0,
        error=more.get("error"),
    )


def of_every_kind(component: str = "q3", said: str = "ValueError: broke") -> list[Record]:
    """Return cases of every kind: found, missed, quiet, broken off, outside the table, two at once."""
    return [
        answered("backlash:q3", "backlash:q3", p=0.95),
        answered(f"backlash:{component}", "hardening:q3", p=0.55),
        answered("hysteresis:q2", "hysteresis:q2", p=0.9, gap=5.0),
        answered("load-error", NONE, p=0.7, gap=0.5),
        answered("none", NONE, p=0.9),
        answered("none", UNKNOWN, p=0.6, error=said),
        answered("warm-up:q1", UNKNOWN, p=0.9, kind="outside"),
        answered("backlash:q3 hardening:q2", "backlash:q3", also=["hardening:q2"]),
    ]
