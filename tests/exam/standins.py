"""Diagnoses that know nothing, or everything: what the exam must say of them is known beforehand."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from beamstiff.exam.cases import Case, Exam, draw_case
from beamstiff.exam.names import EFFECTS
from beamstiff.exam.sizes import true_rows
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

PLACES = (None, *(f"q{k}" for k in range(1, 7)))


@dataclass(frozen=True)
class StandIn:
    """A diagnosis that says this."""

    effect: str
    component: str | None
    probability: float = 1.0
    also: tuple[str, str | None] | None = None
    predict: Callable[[Measurements], tuple[Array, Array]] | None = None
    shrink: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        candidate = {"effect": self.effect, "component": self.component, "probability": self.probability}
        verdict = {**candidate, "indistinguishable": []}
        if self.also is not None:
            effect, component = self.also
            verdict["also"] = {"effect": effect, "component": component, "probability": 1.0}
        which = [{**candidate, "parameters": {}, "shrink": self.shrink}]
        return {"format": "beamstiff-diagnosis/1", "which": which, "verdict": verdict}

    def predict_shift(self, measurements: Measurements) -> tuple[Array, Array]:
        assert np.isnan(measurements.measured).all(), "the new rows must not tell what was measured"
        if self.predict is None:
            nothing = np.zeros((len(measurements), 6))
            return nothing, nothing
        return self.predict(measurements)


def always_none(*_: object, **__: object) -> StandIn:
    """Say that nothing is missing."""
    return StandIn("none", None)


def anything(robot: Robot, measurements: Measurements, **_: object) -> StandIn:
    """Name an effect and a place at random, from a generator that the readings seed."""
    readings = np.nan_to_num(measurements.measured)
    rng = np.random.default_rng(np.frombuffer(np.ascontiguousarray(readings).tobytes(), dtype=np.uint32)[:64])
    return StandIn(EFFECTS[rng.integers(len(EFFECTS))], PLACES[rng.integers(len(PLACES))], 0.05)


def broken(robot: Robot, measurements: Measurements, **_: object) -> StandIn:
    """Break off."""
    raise ZeroDivisionError(f"{len(measurements)} rows")


@cache
def draw_once(exam: Exam, case: int) -> Case:
    """Draw a case of an exam, the same one whoever asks."""
    return draw_case(exam, case)


class Oracle:
    """A diagnosis that has seen the labels: it knows a case by its poses."""

    def __init__(self, cases: Iterable[Case]) -> None:
        self.cases: dict[bytes, Case] = {case.campaign.q.tobytes(): case for case in cases}
        self.withheld: list[tuple[str, ...]] = []

    def __call__(
        self, robot: Robot, measurements: Measurements, *, without: Sequence[str] = (), seed: int = 0
    ) -> StandIn:
        case = self.cases[measurements.q.tobytes()]
        self.withheld.append(tuple(without))
        if case.label.kind == "null":
            return StandIn("none", None)
        if case.label.kind in ("outside", "removed"):
            return StandIn("unknown", None)
        first, *rest = case.truths

        def predict(_: Measurements) -> tuple[Array, Array]:
            return true_rows(case.machine, (), case.fresh), true_rows(case.machine, case.truths, case.fresh)

        second = (rest[0].effect, rest[0].component) if rest else None
        return StandIn(first.effect, first.component, 1.0, second, predict, shrink=1.0)
