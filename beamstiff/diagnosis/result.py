"""What a diagnosis found, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from beamstiff.calibration.parameters import SOFTER
from beamstiff.diagnosis.absorbed import calibrated_without
from beamstiff.diagnosis.apply import FittedStiffness, extended, readable, written_stiffness
from beamstiff.diagnosis.candidate import Candidate
from beamstiff.diagnosis.decomposition.applied import (
    VAGUE,
    absorbed_changes,
    applied,
    as_given,
    calibrated_beside,
)
from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition, RunnerUp
from beamstiff.diagnosis.decomposition.open_model import inverse_of
from beamstiff.diagnosis.decomposition.plain_data import causes_dict
from beamstiff.diagnosis.drift_course import DRIFT, drift_courses
from beamstiff.diagnosis.held_out.score import Fitted, HeldOutError, shift
from beamstiff.diagnosis.inference.library import Untestable
from beamstiff.diagnosis.places import places_with_look_alikes
from beamstiff.diagnosis.predictions import as_measured, columns_at, residuals
from beamstiff.diagnosis.recalibration import Recalibration, recalibration_of
from beamstiff.diagnosis.residual.baseline import Baseline, at_rows, fit_baseline
from beamstiff.diagnosis.smallest import Smallest, smallest_sizes
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array
from beamstiff.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "beamstiff-diagnosis/1"
UNTOUCHED = 0.01  # of the noise: a joint that moves less at twice its compliance no load touches


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """A diagnosis; see the format ``beamstiff-diagnosis/1`` for what its JSON holds.

    Attributes
    ----------
    baseline : Baseline
        The model fitted without effects.
    linear : Baseline
        The one about whose stiffness effects are linear: `fits` change this.
    rms, noise : float, m
        Position gap on held-out postures, and the noise floor.
    candidates : tuple of Candidate
        The likeliest first; `none` and `unknown` among them.
    verdict : Candidate
    also : Candidate or None
        A second cause beside the verdict.
    indistinguishable : tuple of str
    untestable : tuple of Untestable
    outliers : tuple of str
        Rows that nothing explains, as ``file:line``.
    notes : tuple of str
        What limits the conclusions, a sentence each.
    first : HeldOutError or None
        Of two causes, what the verdict closes by itself; its `shrink` is that of both.
    where : mapping
    next : sequence of mapping
    fits : tuple of Fitted
        Of the verdict, and of the second cause with it.
    ceiling : float, m
        The least that effects of the library leave on held-out postures, all at once or
        the best alone: no cause of theirs can be expected to leave less.
    features : mapping of str to float
        What the verdict rests on.
    decomposition : Decomposition or None
        Causes and remainder, where several causes were weighed with all that a calibration fits.
    known : tuple of AddedEffect
        Effects that the robot has and that were taken off the readings: neither `baseline` nor `rows` hold
        them.
    fitted_rows : tuple of str
        Digests of the rows, for the written robot.
    loads_contradicted : bool
        Whether measured torques of the drives say for sure that weights or loads are not as stated.
    """

    baseline: Baseline
    linear: Baseline
    rms: float
    noise: float
    candidates: tuple[Candidate, ...]
    verdict: Candidate
    also: Candidate | None
    indistinguishable: tuple[str, ...]
    untestable: tuple[Untestable, ...]
    outliers: tuple[str, ...]
    notes: tuple[str, ...]
    fits: tuple[Fitted, ...]
    ceiling: float
    first: HeldOutError | None = None
    where: Mapping[str, Any] = field(default_factory=dict)
    next: Sequence[Mapping[str, Any]] = ()
    features: Mapping[str, float] = field(default_factory=dict)
    decomposition: Decomposition | None = None
    known: tuple[AddedEffect, ...] = ()
    fitted_rows: tuple[str, ...] = ()
    loads_contradicted: bool = False

    @property
    def runners_up(self) -> list[RunnerUp]:
        """The next best explanation in place of each cause that has no look-alike."""
        causes = self.decomposition.causes if self.decomposition is not None else ()
        return [one.runner_up for one in causes if one.runner_up is not None]

    @property
    def explainable(self) -> float:
        """Share of the gap's square that is more than noise."""
        return max(0.0, 1.0 - (self.noise / self.rms) ** 2) if self.rms > 0 else 0.0

    @property
    def left(self) -> float:
        """Position error that the fitted robot leaves on held-out postures, RMS, m."""
        found = self.decomposition
        if found is not None:
            return float(np.sqrt(max(found.left2_by(found.written), 0.0)))
        shrink = self.verdict.shrink
        return self.rms if shrink is None else min(shrink.after, self.rms)

    @property
    def law(self) -> Cause | None:
        """The law outside the library that explains more than any cause does, if there is one."""
        return None if self.decomposition is None else self.decomposition.law

    @property
    def start_values(self) -> tuple[str, ...]:
        """Stiffness that was fitted and that the robot file marks as start values: guesses, no statements."""
        described = self.baseline.given or self.baseline.nominal
        return tuple(name for name in described.unmeasured if name in self.linear_stiffness)

    @cached_property
    def recalibration(self) -> Recalibration | None:
        """What changed in the geometry beside the causes; None where it is as described."""
        return None if self.decomposition is None else recalibration_of(self.decomposition, self.calibrated)

    @cached_property
    def calibrated(self) -> Robot:
        """The robot calibrated beside the causes of its decomposition, without them."""
        assert self.decomposition is not None
        return calibrated_beside(self.decomposition)

    @cached_property
    def applied(self) -> Robot:
        """The same with the causes as its effects: a step on the way to `robot`, which is what to save."""
        assert self.decomposition is not None
        return applied(self.decomposition, self.calibrated)

    @property
    def robot(self) -> Robot:
        """The robot with the fitted geometry, stiffness and effects, as ``diagnose --apply`` writes it.

        `save_robot` writes it to a file.
        """
        return readable(extended(self), self.known)

    @property
    def causes(self) -> list[dict[str, Any]]:
        """The named causes as in the JSON, each beside those before it; empty where none is named.

        Each has `effect`, `component` (None for the machine as a whole), `probability`, `closes` (share of
        the gap's square above noise on held-out postures, 0 to 1), `closes_interval` (90 %), `rms_after_mm`,
        `parameters` (`value`, `std` and `unit` by name, SI), `shape`, and `indistinguishable`, names of its
        look-alikes.
        """
        named: list[dict[str, Any]] = self.explained()["causes"]
        return named

    @property
    def fitted(self) -> dict[str, FittedStiffness]:
        """Stiffness values that were fitted: `given`, `value` as `robot` has it, `std` and `touched`, SI.

        Those in `kept` are as given.
        """
        return {
            name: FittedStiffness(given, value, self.stiffness_std(name, value), name not in self.untouched)
            for name, (given, value) in self.fitted_stiffness.items()
        }

    @property
    def fitted_stiffness(self) -> dict[str, tuple[float, float]]:
        """The same as pairs: as given, and as `robot` has them."""
        return written_stiffness(self)

    @property
    def linear_stiffness(self) -> dict[str, tuple[float, float]]:
        """The same of the linear step in which causes are weighed, some percent off where that is long."""
        given, found = self.baseline.nominal, self.baseline.robot
        names: Sequence[str] = self.baseline.fitted
        if self.decomposition is not None:
            model = self.decomposition.model
            given, found = model.given, model.robot(self.decomposition.change)
            names = model.baseline.fitted if model.problem is None else given.identify
        return {name: (given.parameter(name), found.parameter(name)) for name in names}

    @cached_property
    def smallest(self) -> list[Smallest]:
        """The smallest sizes that these rows would have shown, those seen best first."""
        return smallest_sizes(self)

    @property
    def open_compliances(self) -> tuple[Array, dict[str, int]]:
        """Columns (n, t) of all that is open, noises per unit, and where each compliance stands there."""
        found, baseline = self.decomposition, self.baseline
        if found is None:
            columns = baseline.tangent[baseline.used] / baseline.sigma[baseline.used][:, None]
            return columns, {name: at for at, name in enumerate(baseline.fitted)}
        model = found.model
        problem = model.problem
        names = baseline.fitted if problem is None else [*problem.values(problem.expected)]
        fitted = self.linear_stiffness  # a calibration leaves out what it does not feel
        return model.tangent, {name: at for at, name in enumerate(names) if name in fitted}

    @cached_property
    def compliance_std(self) -> dict[str, float]:
        """Standard deviation of the compliance of each fitted stiffness beside the causes, SI."""
        columns, at = self.open_compliances
        found, scatter = self.decomposition, 1.0
        if found is not None:
            forms = [form.columns for cause in found.every for form in cause.forms]
            columns, scatter = np.concatenate([columns, *forms], axis=1), max(found.scatter, 1.0)
        std = scatter * np.linalg.norm(inverse_of(columns), axis=1)
        return {name: float(std[column]) for name, column in at.items()}

    @cached_property
    def softest(self) -> dict[str, float]:
        """The softest that each fitted stiffness may well be, SI: softer, weights would let the tool fall."""
        names, realistic = self.baseline.fitted, self.baseline.realistic
        if (found := self.decomposition) is not None and found.model.problem is not None:
            names, realistic = found.model.problem.elastic.names, found.model.realistic
        return {name: 1.0 / (SOFTER * one) for name, one in zip(names, realistic.tolist(), strict=True)}

    def stiffness_std(self, name: str, value: float) -> float | None:
        """Return the standard deviation of a fitted stiffness, SI; None where it is not determined."""
        std = self.compliance_std.get(name)
        if std is None or name in self.undetermined or name in self.untouched or not np.isfinite(value):
            return None
        return std * value**2

    @cached_property
    def undetermined(self) -> set[str]:
        """Fitted stiffness values whose compliance is known to no better than half of it.

        Beside the causes, or in the calibration that is written.
        """
        fitted = self.linear_stiffness
        vague = {name for name, std in self.compliance_std.items() if std * fitted[name][1] > VAGUE}
        return vague | self._as_described

    @cached_property
    def _as_described(self) -> set[str]:
        """Drives that the written calibration leaves as described."""
        found = self.decomposition
        if found is None or found.model.problem is None:
            return set()
        return as_given(found, self.calibrated) & {*self.compliance_std}

    @cached_property
    def untouched(self) -> tuple[str, ...]:
        """Fitted stiffness values that no load of the rows touches: they hold what the robot file says."""
        columns, at = self.open_compliances
        moved = np.abs(columns).max(axis=0, initial=0.0)
        return tuple(
            name
            for name, ends in self.linear_stiffness.items()
            if max(ends) < np.inf and (name not in at or moved[at[name]] < UNTOUCHED * min(ends))
        )

    @cached_property
    def kept(self) -> tuple[str, ...]:
        """Fitted stiffness values that the robot with the causes takes from the robot file.

        The untouched ones, and of those undetermined the ones that all readings together do not distinguish
        from the file's value: by less than two standard deviations.
        """
        found = self.decomposition
        if found is not None and found.model.problem is not None:
            own = {*self.untouched, *self._as_described}
            return tuple(name for name in self.linear_stiffness if name in own)
        columns, at = self.open_compliances
        vague = self.undetermined.difference(self.untouched)
        return tuple(
            name
            for name, (given, value) in self.linear_stiffness.items()
            if name in self.untouched
            or (name in vague and np.linalg.norm(columns[:, at[name]]) * abs(1 / given - 1 / value) < 2.0)
        )

    def predict_shift(self, rows: Measurements) -> tuple[Array, Array]:
        """Return what the fitted baseline, and it with the verdict's effects, say of rows, (N, 6) each.

        Displacements ``[d, r]``, or absolute positions and rotation vectors, as the rows are; base frame,
        without the effects that the robot had before (`known`).
        """
        if self.decomposition is not None:
            bare = self.applied.model_copy(update={"effects": ()})
            without = calibrated_without(bare, absorbed_changes(self.decomposition, self.applied), rows)
            views = [fit_baseline(*one, keep=()) for one in (without, (self.applied, rows))]
            return as_measured(views[0], views[0].predicted), as_measured(views[1], views[1].predicted)
        there = at_rows(self.baseline, rows)
        before = after = there.predicted
        if self.fits:
            near = at_rows(self.linear, rows)
            columns = [[columns_at(near, one.hypothesis) for one in fit.shapes] for fit in self.fits]
            after = near.predicted + shift(near, self.fits, columns)
        return as_measured(there, before), as_measured(there, after)

    def to_frame(self) -> pd.DataFrame:
        """Return the rows and what the model leaves of them, measured minus predicted.

        A pandas DataFrame, SI, base frame, a row a reading: the columns of the table, ``residual_x`` and the
        like of the fitted model, and ``residual_x_with_causes`` where causes were found.
        """
        return residuals(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain data, format ``beamstiff-diagnosis/1``."""
        also = self.also
        return {
            "format": FORMAT,
            "gap": {
                "rms_mm": 1e3 * self.rms,
                "noise_mm": 1e3 * self.noise,
                "ceiling_mm": 1e3 * self.ceiling,
                "explainable": self.explainable,
            },
            "where": {**self.where, "components": places_with_look_alikes(self)},
            "which": [self._candidate(one) for one in self.candidates],
            "verdict": {
                "effect": self.verdict.effect,
                "component": self.verdict.component,
                "probability": self.verdict.probability,
                "indistinguishable": list(self.indistinguishable),
                **(
                    {}
                    if also is None
                    else {
                        "also": {
                            "effect": also.effect,
                            "component": also.component,
                            "probability": also.probability,
                        }
                    }
                ),
            },
            **self.explained(),
            "next_best": [
                {
                    "in_place_of": one.cause,
                    "causes": list(one.keys),
                    "odds": one.odds,
                    "rms_mm": 1e3 * one.rms,
                    "rms_with_mm": 1e3 * one.rms_with,
                }
                for one in self.runners_up
            ],
            "calibration": None if self.recalibration is None else self.recalibration.to_dict(),
            "fitted": {name: one.to_dict() for name, one in self.fitted.items()},
            "next": [dict(item) for item in self.next],
            "untestable": [
                {"effect": one.effect, "component": one.component, "why": one.why} for one in self.untestable
            ],
            "outliers": list(self.outliers),
            "notes": list(self.notes),
            "features": {name: _plain(value) for name, value in self.features.items()},
        }

    def explained(self) -> dict[str, Any]:
        """Return the keys ``causes`` and ``remainder``."""
        found = self._explained()
        drifts = (one for one in found["causes"] if one["effect"] == DRIFT)
        for one, course in zip(drifts, drift_courses(self), strict=False):
            one["course"] = course.to_list()
        return found

    def _explained(self) -> dict[str, Any]:
        if self.decomposition is not None:
            return causes_dict(self.decomposition)
        told = [] if self.verdict.shrink is None else [(self.verdict, self.first or self.verdict.shrink)]
        if self.also is not None and self.also.shrink is not None and told:
            told.append((self.also, self.verdict.shrink or told[0][1]))  # the verdict's is that of both
        causes: list[dict[str, Any]] = []
        before, known, rms = 0.0, (0.0, 0.0), self.rms
        for one, error in told:
            closes, rms = error.shrink - before, error.after
            before = max(before, error.shrink)
            # of a second cause: what both close, less what the first does, however either interval lies
            low, high = error.interval[0] - known[1], error.interval[1] - known[0]
            known = error.interval
            causes.append(
                {
                    "effect": one.effect,
                    "component": one.component,
                    "probability": one.probability,
                    "closes": max(closes, 0.0),
                    "closes_interval": [max(low, 0.0), max(high, 0.0)],
                    "rms_after_mm": 1e3 * rms,
                    "parameters": self._candidate(one)["parameters"],
                    "shape": one.shape,
                    "indistinguishable": list(self.indistinguishable),
                }
            )
        return {
            "causes": causes,
            "remainder": {"rms_mm": 1e3 * rms, "share": 1.0 - before, "follows": [], "where": []},
        }

    def _candidate(self, one: Candidate) -> dict[str, Any]:
        result: dict[str, Any] = {
            "effect": one.effect,
            "component": one.component,
            "probability": one.probability,
            "parameters": {
                item.name: {
                    "value": item.value,
                    "std": item.std,
                    "unit": item.unit,
                    "realistic": list(item.realistic),
                    "plausible": item.plausible,
                }
                for item in one.estimates
            },
            "shape": one.shape,
        }
        if one.shrink is None:
            return result | {"rms_after_mm": 1e3 * self.rms, "shrink": 0.0, "shrink_interval": [0.0, 0.0]}
        return result | {
            "rms_after_mm": 1e3 * one.shrink.after,
            "shrink": one.shrink.shrink,
            "shrink_interval": list(one.shrink.interval),
        }


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
