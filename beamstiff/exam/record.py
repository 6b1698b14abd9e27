"""One examined case: the sealed label, the verdict given blind, and what is compared."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, TypeAdapter

from beamstiff.exam.names import FAILED, NONE, UNKNOWN, is_named, key_of, normal

Kind = Literal["null", "single", "pair", "outside", "removed"]
KINDS: tuple[Kind, ...] = ("null", "single", "pair", "outside", "removed")


def _nan_of_null(gap: Any) -> Any:
    return float("nan") if gap is None else gap


Gap = Annotated[float, BeforeValidator(_nan_of_null)]  # null in JSON


@dataclass(frozen=True)
class Label:
    """What is true in a case; the diagnosis never sees it.

    `kind`: "null", "single", "pair", "outside" or "removed"; ``outside``: the effect is in nobody's library;
        ``removed``: its class is withheld from the library.
    `author`: who wrote the forms, the last of them: 1 is who writes the diagnosis and has not read the
        others'.
    """

    case: int
    kind: Kind
    truths: tuple[str, ...]  # ``effect:component`` of every effect at work; empty for a null
    sizes: tuple[float, ...]  # of each truth, from 0 (smallest) to 1 (largest realistic)
    withheld: tuple[str, ...]  # effects that the library has to do without
    robot: str  # its name
    design: str  # ``rich``, ``lean`` or ``plan``
    data: str  # ``displacement`` or ``absolute``
    claimed: str  # of the noise: ``true``, ``half``, ``twice`` or ``absent``
    readings: int  # 3 or 6 components
    forms: tuple[str, ...] = ()  # constitutive form of each truth
    author: int = 1

    def digest(self) -> str:
        """Return the SHA-256 of the label, which seals it."""
        return sha256(asdict(self))


@dataclass(frozen=True)
class Answer:
    """What a diagnosis said, taken from its JSON."""

    verdict: str  # ``effect:component``, ``none:null``, ``unknown:null``, ``failed:null`` where it broke off
    probability: float  # of the verdict
    also: tuple[str, ...] = ()  # further effects named
    indistinguishable: tuple[str, ...] = ()  # what these data cannot distinguish from the verdict
    probabilities: Mapping[str, float] | None = None  # of all candidates, those below 1e-6 left out
    promised: float | None = None  # the shrink said of the verdict; None where no effect is named


@dataclass(frozen=True)
class Record:
    """A case, answered and opened.

    `gap`: gap over noise: RMS over the measured values of the noise-free residual that the fitted baseline
        leaves, each divided by the true standard deviation of its noise; NaN where the baseline failed.
    `shrink`: share of the gap on new poses and new loads, noise-free, that the verdict's effect closes, as
        ``1 - (after/before)^2`` of the position errors, clipped to [0, 1]; None where no effect is named.
    """

    label: Label
    answer: Answer
    gap: Gap
    gaps: tuple[Gap, ...]  # the same of each truth by itself
    shrink: float | None
    controls: Mapping[str, str]  # what the plain controls name, ``effect:component``
    label_sha256: str  # seal of the label, before the diagnosis
    report_sha256: str  # seal of its report, before the label was opened
    seconds: float  # time that the diagnosis took
    error: str | None = None  # why it broke off

    @property
    def truth(self) -> str:
        """The right verdict: the effect of a single, ``none`` of a null, ``unknown`` outside the library."""
        if self.label.kind == "null":
            return key_of(NONE, None)
        if self.label.kind in ("outside", "removed"):
            return key_of(UNKNOWN, None)
        return self.label.truths[0]

    @property
    def verdict_set(self) -> frozenset[str]:
        """The verdict and what is indistinguishable from it with these data."""
        return frozenset((self.answer.verdict, *self.answer.indistinguishable))

    @property
    def named(self) -> tuple[str, ...]:
        """All effects that the verdict names: none for ``none``, ``unknown`` and a diagnosis that failed."""
        return tuple(key for key in (self.answer.verdict, *self.answer.also) if is_named(key))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for one line of JSON; a gap that is no number is null."""
        gap, *gaps = (one if isfinite(one) else None for one in (self.gap, *self.gaps))
        return {**asdict(self), "gap": gap, "gaps": gaps}


def answer_of(report: Mapping[str, Any]) -> Answer:
    """Return what a diagnosis says, from its JSON (format ``beamstiff-diagnosis/1``).

    >>> answer_of({"which": [], "verdict": {"effect": "none", "component": None, "probability": 0.9}})
    Answer(verdict='none:null', probability=0.9, also=(), indistinguishable=(), probabilities={},
           promised=None)
    """
    verdict = report["verdict"]
    key = key_of(verdict["effect"], verdict["component"])
    second = verdict.get("also")
    candidates = {key_of(c["effect"], c["component"]): c for c in report["which"]}
    promised = candidates[key]["shrink"] if is_named(key) and key in candidates else None
    return Answer(
        verdict=key,
        probability=float(verdict["probability"]),
        also=(key_of(second["effect"], second["component"]),) if second else (),
        indistinguishable=tuple(normal(text) for text in verdict.get("indistinguishable") or ()),
        probabilities={k: float(c["probability"]) for k, c in candidates.items() if c["probability"] > 1e-6},
        promised=None if promised is None else float(promised),
    )


def failed() -> Answer:
    """Return the answer of a diagnosis that broke off; it counts as wrong wherever it is asked."""
    return Answer(verdict=key_of(FAILED, None), probability=0.0, probabilities={})


record_from = TypeAdapter(Record).validate_python  # of what `Record.to_dict` made


def sha256(value: Any) -> str:
    """Return the SHA-256 of plain data, written as JSON with sorted keys and no blanks."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
