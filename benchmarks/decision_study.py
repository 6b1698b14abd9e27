"""The decision between no cause, one, two and the unknown: its coefficients, and how far they carry.

Simulated campaigns of `beamstiff exam` are diagnosed; of each the evidence that the decision is given is kept
in CAMPAIGNS, a file of pickles that is taken up after a break. To these the three logistic models of
`beamstiff.diagnosis.decision.classifier` are fitted. Their priors are the shares of the exam: of a hundred
30 nulls, 42 single effects, 9 pairs and 19 whose cause is outside the library. What leaves less than 0.3 of
the noise counts as none, of two causes each by itself.

Printed, over campaigns that are not lean: the exam's figures, each campaign judged by a fit to nine tenths of
the others; the same, each author's forms judged by a fit to those of the other authors; and the calibration
error where nulls, or causes outside the library, are twice or half as frequent as where it was fitted.

Run `python -m benchmarks.decision_study CAMPAIGNS [CASES [SEED [PROCESSES]]]`; `--write` behind it writes the
coefficients that all campaigns ask for into the package.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy.optimize import minimize
from scipy.special import expit, log_expit

import beamstiff.diagnosis.diagnose as diagnosis
from beamstiff.diagnosis.decision import classifier
from beamstiff.diagnosis.decision.classifier import (
    Coefficients,
    Terms,
    features_of,
    probability,
    unknown_log_odds,
)
from beamstiff.diagnosis.decision.verdict import Judged, judge
from beamstiff.diagnosis.inference.search import OUTLIERS, Search
from beamstiff.exam import score
from beamstiff.exam.blind import Examiner, examined
from beamstiff.exam.cases import Exam, draw_case
from beamstiff.exam.record import Record
from beamstiff.exam.score import calibration_error
from beamstiff.exam.table import headline
from beamstiff.outputs import write_output
from beamstiff.parallel import parallel_map
from beamstiff.report.tables import table
from beamstiff.se3 import Array

SEED, CASES = 20261420, 600
FOLDS = 10
SHRINKAGE = 1.0  # of coefficients per standard deviation of their features: a prior N(0, 1) of each
FREE_SIGN = ("values",)  # of features; the others speak for their model alone
FILE = Path(classifier.__file__).with_name("decision.json")
NULL, OUTSIDE, ONE, TWO = range(4)


@dataclass(frozen=True)
class Sample:
    """A campaign.

    Attributes
    ----------
    record : Record
    evidence : dict of str to any
        What the decision was given; empty where it was not asked for, as of several causes at once.
    """

    record: Record
    evidence: dict[str, Any]

    @property
    def kind(self) -> int:
        """What is right of it."""
        label = self.record.label
        gaps = zip(label.truths, self.record.gaps, strict=True)
        # wrong rows are left out before, and named for what they are beside any answer
        shown = sum(gap >= score.HARDLY for truth, gap in gaps if truth != OUTLIERS)
        if not shown:
            return NULL
        return OUTSIDE if label.kind in ("outside", "removed") else TWO if shown > 1 else ONE

    def judged(self, coefficients: Coefficients) -> Record:
        """Return the record as it is with other coefficients."""
        if not self.evidence:
            return self.record
        found = judge(**self.evidence, coefficients=coefficients)
        also = () if found.also is None else (found.also,)
        answer = replace(
            self.record.answer,
            verdict=found.verdict,
            probability=found.probabilities[found.verdict],
            also=also,
            indistinguishable=found.indistinguishable,
            probabilities=found.probabilities,
        )
        return replace(self.record, answer=answer)


def collected(file: Path, count: int, seed: int, processes: int) -> list[Sample]:
    """Return the samples of the first cases of an exam; those in the file already are not made again."""
    found: dict[int, Sample] = {}
    if file.exists():
        with file.open("rb") as stored:
            while stored.peek(1):
                one: Sample = pickle.load(stored)
                found[one.record.label.case] = one
    missing = [case for case in range(count) if case not in found]
    with file.open("ab") as out:
        for _, made in parallel_map(partial(sample, Exam(seed=seed)), missing, processes=processes):
            if made is not None:
                pickle.dump(made, out)
                out.flush()
                found[made.record.label.case] = made
    return [found[case] for case in sorted(found) if found[case].record.error is None]


def sample(exam: Exam, case: int) -> Sample | None:
    """Return a case; None where the simulator cannot make it."""
    given: dict[str, Any] = {}

    def recorded(search: Search, *more: Any) -> Judged:
        pairs = tuple(replace(pair, shapes=([], [])) for pair in search.pairs)
        names = ("freedom", "outliers", "single", "both", "may_be_outliers", "by_load")
        given.update(zip(names, more, strict=False), search=replace(search, shapes={}, pairs=pairs))
        return judge(search, *more)

    try:
        drawn = draw_case(exam, case)
    except Exception:  # counts nowhere, as in the exam
        return None
    with patch.object(diagnosis, "judge", recorded):
        record, report = examined(exam, drawn, Examiner(diagnosis.diagnose))
    return Sample(record, {} if "bic" in report.get("features", {}) else given)


def fitted(samples: Sequence[Sample]) -> Coefficients:
    """Return the coefficients that campaigns ask for."""
    some = [one for one in samples if one.evidence]
    left_out = ("outliers", "may_be_outliers")
    features = [
        features_of(**{key: value for key, value in one.evidence.items() if key not in left_out})
        for one in some
    ]
    kind = np.array([one.kind for one in some])
    none = logistic([one.none for one in features], kind == NULL)
    weighed = [k for k, one in enumerate(features) if one.two and kind[k] != NULL]
    two = logistic([features[k].two for k in weighed], kind[weighed] == TWO)
    there = np.flatnonzero(kind != NULL)
    named = [
        one.unknown_of_two if one.two and probability(two, one.two) > 0.5 else one.unknown for one in features
    ]
    unknown = of_unknown([named[k] for k in there], kind[there] == OUTSIDE)
    return {"none": none, "two": two, "unknown": unknown}


def of_unknown(terms: Sequence[Terms], right: NDArray[np.bool_]) -> Terms:
    """Return the coefficients of the model of the unknown, by the names of its terms."""
    names = ("left", "free")
    size = {name: float(np.std([one[name] for one in terms])) + 1e-9 for name in names}
    sign = np.where(right, 1.0, -1.0)

    def coefficients(c: Array) -> Terms:
        constant, left, free, few = c.tolist()
        return {
            "constant": constant,
            "left": left / size["left"],
            "free": free / size["free"],
            "few": few,
        }

    def loss(c: Array) -> float:
        odds = np.array([unknown_log_odds(coefficients(c), one) for one in terms])
        return float(-log_expit(sign * odds).sum() + 0.5 * SHRINKAGE * (c[1:3] ** 2).sum())

    bounds = [
        (None, None),
        (0.0, None),
        (0.0, None),
        (-10.0, 0.0),
    ]  # no law is likelier than its evidence says
    c = minimize(loss, np.array([-1.0, 1.0, 1.0, -1.0]), bounds=bounds, method="L-BFGS-B").x
    return rounded(coefficients(c))


def logistic(terms: Sequence[Terms], right: NDArray[np.bool_]) -> Terms:
    """Return the coefficients of a logistic model, of the right sign, by the names of its terms."""
    names = list(terms[0])
    x = np.array([[one[name] for name in names] for one in terms])
    size = x.std(axis=0) + 1e-9
    z = np.column_stack([np.ones(len(x)), (x - x.mean(axis=0)) / size])
    sign = np.where(right, 1.0, -1.0)

    def loss(c: Array) -> tuple[float, Array]:
        odds = z @ c
        held = SHRINKAGE * np.concatenate([[0.0], c[1:]])
        return float(-log_expit(sign * odds).sum() + 0.5 * held @ c), z.T @ (expit(odds) - right) + held

    bounds = [(None, None), *((None if name in FREE_SIGN else 0.0, None) for name in names)]
    c = minimize(loss, np.zeros(z.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B").x
    own = c[1:] / size
    found = {"constant": float(c[0] - own @ x.mean(axis=0)), **dict(zip(names, own.tolist(), strict=True))}
    return rounded(found)


def rounded(found: Terms) -> Terms:
    """Return coefficients with four digits."""
    return {name: float(f"{value:.4g}") for name, value in found.items()}


def in_folds(samples: Sequence[Sample], fold: Array, tested: Callable[[int], Array]) -> list[Record]:
    """Return campaigns, those of each fold judged by a fit to what is not left out with it."""
    result: list[Record] = []
    for k in np.unique(fold).tolist():
        out = tested(k)
        coefficients = fitted([one for one, left in zip(samples, out, strict=True) if not left])
        result += [one.judged(coefficients) for one, own in zip(samples, fold, strict=True) if own == k]
    return result


def by_author(samples: Sequence[Sample], rng: np.random.Generator) -> list[Record]:
    """Return campaigns judged by a fit without their author's forms; nulls, which have none, in folds."""
    author = np.array([one.record.label.author if one.record.label.forms else 0 for one in samples])
    part = np.where(author == 0, -1 - rng.integers(0, FOLDS, len(samples)), author)
    return in_folds(samples, part, lambda k: part == k)


def calibration(records: Sequence[Record]) -> Iterator[tuple[str, float]]:
    """Yield the calibration error of campaigns as they are, and of mixtures that were not fitted."""
    nulls = [one for one in records if one.label.kind == "null"]
    outside = [one for one in records if one.label.kind in ("outside", "removed")]

    def without(some: Sequence[Record]) -> list[Record]:
        return [one for one in records if all(one is not other for other in some)]

    yield "as fitted", calibration_error(records).value or 0.0
    for what, some in (("nulls", nulls), ("outside the library", outside)):
        yield f"twice as many {what}", calibration_error([*records, *some]).value or 0.0
        rest = without(some)
        yield f"half as many {what}", calibration_error([*rest, *rest, *some]).value or 0.0


def main(file: str, count: int = CASES, seed: int = SEED, processes: int = 1, *, write: bool = False) -> None:
    """Collect, fit, judge, print."""
    samples = collected(Path(file), count, seed, processes)
    rng = np.random.default_rng(seed)
    fold = rng.integers(0, FOLDS, len(samples))
    ways = {
        "as stored": [one.record for one in samples],
        "ten folds": in_folds(samples, fold, lambda k: fold == k),
        "other authors": by_author(samples, rng),
    }
    rich = {name: [one for one in some if one.label.design != "lean"] for name, some in ways.items()}
    figures = {name: headline(some) for name, some in rich.items()}
    console = Console(width=140)
    told = table(f"{len(rich['as stored'])} campaigns, seed {seed}", "figure", "asked", *rich, "of")
    for rows in zip(*figures.values(), strict=True):
        asked = "" if rows[0].required is None else f"{rows[0].required:g}"
        shown = ["" if row.figure.value is None else f"{row.figure.value:.3f}" for row in rows]
        told.add_row(rows[0].name, asked, *shown, f"{rows[0].figure.count}")
    console.print(told)
    errors = table("expected calibration error", "mixture", *rich)
    for lines in zip(*map(calibration, rich.values()), strict=True):
        errors.add_row(lines[0][0], *(f"{value:.3f}" for _, value in lines))
    console.print(errors)
    found = fitted(samples)
    coefficients = table("coefficients, all campaigns", "model", "feature", "coefficient")
    for model, terms in found.items():
        for name, value in terms.items():
            coefficients.add_row(model, name, f"{value:g}")
    console.print(coefficients)
    if write:
        kinds = {name: sum(one.record.label.kind == name for one in samples) for name in Exam(seed).shares}
        told_of = {"seed": seed, "campaigns": len(samples), "kinds": kinds}
        text = {"format": "beamstiff-decision/1", "fitted_to": told_of, **found}
        write_output(FILE, json.dumps(text, indent=1) + "\n")


if __name__ == "__main__":
    rest = [text for text in sys.argv[1:] if text != "--write"]
    main(rest[0], *map(int, rest[1:]), write="--write" in sys.argv)
