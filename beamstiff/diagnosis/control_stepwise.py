"""A plain method to compare with on crowded machines: forward stepwise regression, the best BIC enters.

Geometry, base frame, reflectors and drives are fitted; then the first-order columns of one form after another
are added to the regression, everything refitted, as long as the BIC falls. All of it is in sample: no
constraint on a parameter, no held-out postures, no prior, no look-alikes, no removal.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.diagnosis.decomposed import diagnosis_of
from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition
from beamstiff.diagnosis.decomposition.forms import REPEATED, SLIP, Form, forms_of
from beamstiff.diagnosis.decomposition.open_model import OpenModel, open_geometry, open_stiffness, orthonormal
from beamstiff.diagnosis.decomposition.remainder import Remainder
from beamstiff.diagnosis.effects.external import shift_alone
from beamstiff.diagnosis.predictions import as_measured, columns_at
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import at_rows, fit_baseline, nominal_pose
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

# fall of the BIC from which a form enters: "very strong" (Kass and Raftery, JASA 90 (1995) 773); hundreds of
# forms are tried, and with less one of them enters by chance
ENOUGH = 10.0
TEXTBOOK = 3  # parameters of a form at most: a vector; freer ones follow whatever is left, unless held back
MOST = 20  # forms
SILENT = 1e-6  # of the noise: a column so small, of a realistic size, is rounding
STEP = 1e-3  # of the open parameters' change, along which they act linearly
ABSORBED = 1e-4  # share of a column, below which the fit has taken it up already


@dataclass(frozen=True, eq=False)
class PlainStepwise:
    """What the regression says, as a diagnosis says it."""

    found: Decomposition

    def to_dict(self) -> dict[str, Any]:
        """Return the report, format ``beamstiff-diagnosis/1``."""
        return diagnosis_of(self.found).to_dict()

    def predict_shift(self, rows: Measurements) -> tuple[Array, Array]:
        """Return what the model as calibrated, and it with the regression, say of rows, (N, 6) each.

        The regression's parameters as they are, also where no machine could have them.
        """
        model, change = self.found.model, self.found.change
        # the regression is linear: of large changes a robot would make something else
        views = (fit_baseline(model.robot(by * change), rows, keep=()) for by in (0.0, STEP))
        before, moved = (as_measured(view, view.predicted) for view in views)
        near, after = at_rows(model.baseline, rows), before + (moved - before) / STEP
        if model.problem is not None:  # what is common to base frame and first axis must cancel
            pairs = zip(model.problem.parameters, change.tolist(), strict=True)
            base = {item.name: value for item, value in pairs if item.group == "base"}
            along, about = (
                np.array([base.get(f"base.{way}{axis}", 0.0) for axis in "xyz"]) for way in ("", "r")
            )
            after[:, :3] += along + np.cross(about, before[:, :3])
        for cause in self.found.causes:
            for form, theta in zip(cause.forms, cause.theta, strict=True):
                if form.effect == SLIP:  # it stays where it came to rest
                    here = rows.point == (form.component or near.nominal.tcp)
                    axes = nominal_pose(near.nominal, near.rows, form.component)[1]
                    columns = shift_alone(axes * here[:, None, None])
                else:
                    columns = columns_at(near, form)
                after = after + columns @ (theta * form.sizes)
        return before, after


def plain_stepwise(robot: Robot, measurements: Measurements, withheld: Sequence[str] = ()) -> PlainStepwise:
    """Return the causes that a forward stepwise regression names, in the order in which they enter.

    ``BIC = n log(RSS/n) + k log n`` (Schwarz, Ann. Statist. 6 (1978) 461) over the values in units of the
    noise as the table states it; k counts the columns added. A cause `closes` what its entry takes from the
    sum of squares beyond what noise would leave.

    `withheld`: effects to do without.
    Raises BeamstiffError as of `calibrate` and `fit_baseline`.
    """
    if measurements.kind == "absolute":
        model = open_geometry(robot, measurements)
    else:
        model = open_stiffness(fit_baseline(robot, measurements))
    every = forms_of(model, Prior(tuple(withheld)))
    forms = [form for form in every if form.sizes.size <= TEXTBOOK and not form.outside_library]
    chosen, squares = _entered(model, forms)
    return PlainStepwise(_told(model, chosen, squares))


def _entered(model: OpenModel, forms: Sequence[Form]) -> tuple[list[Form], list[float]]:
    """Return the forms that enter, in order, and the sums of squares left before and after each."""
    basis = orthonormal(model.tangent)
    left = model.residual - basis @ (basis.T @ model.residual)
    sizes = [form.columns.shape[1] for form in forms]
    every = np.concatenate([np.zeros((len(left), 0)), *(form.columns for form in forms)], axis=1)
    size = np.linalg.norm(every, axis=0)
    every = every * (size > SILENT) / np.where(size > SILENT, size, 1.0)
    every -= basis @ (basis.T @ every)
    parts = np.split(np.arange(every.shape[1]), np.cumsum(sizes)[:-1])
    chosen: list[Form] = []
    squares, n = [float(left @ left)], model.count
    while len(chosen) < MOST:
        taken = {form.key for form in chosen if form.effect not in REPEATED}
        best, entering = -ENOUGH, None
        for form, at in zip(forms, parts, strict=True):
            if form.key in taken or any(form is one for one in chosen):
                continue
            columns = orthonormal(every[:, at][:, np.linalg.norm(every[:, at], axis=0) > ABSORBED])
            rest = squares[-1] - float(np.square(left @ columns).sum())
            k = columns.shape[1]
            change = n * np.log(max(rest, 1e-12) / squares[-1]) + k * np.log(n)
            if k and change < best:
                best, entering = change, (form, columns)
        if entering is None:
            break
        form, columns = entering
        chosen.append(form)
        left = left - columns @ (columns.T @ left)
        every -= columns @ (columns.T @ every)
        squares.append(float(left @ left))
    return chosen, squares


def _told(model: OpenModel, chosen: Sequence[Form], squares: Sequence[float]) -> Decomposition:
    """Return the fit with the forms, told as a decomposition, so that it is reported as one."""
    matrix = np.concatenate([model.tangent, *(form.columns for form in chosen)], axis=1)
    size = np.linalg.norm(matrix, axis=0)
    matrix, size = matrix * (size > SILENT), np.where(size > SILENT, size, 1.0)
    theta = np.linalg.lstsq(matrix / size, model.residual, rcond=1e-8)[0] / size
    starts = model.tangent.shape[1] + np.cumsum([0, *(form.sizes.size for form in chosen)])
    noise2 = float(np.mean(model.baseline.sigma[:, :3][model.used[:, :3]] ** 2)) * 3.0
    explainable = max(squares[0] - model.count, 1e-12)

    def rms(at: int) -> float:
        free = max(model.count - int(starts[at]), 1)
        return float(np.sqrt(noise2 * squares[at] / free))

    causes: dict[str, Cause] = {}
    for at, form in enumerate(chosen):
        own: Array = theta[starts[at] : starts[at + 1]]
        closes = (squares[at] - squares[at + 1]) / explainable
        before = causes.get(form.key)  # orders of a curve and moments of a slip are one cause
        closes += before.closes if before else 0.0
        causes[form.key] = Cause(
            forms=(*(before.forms if before else ()), form),
            theta=(*(before.theta if before else ()), own),
            std=(*(before.std if before else ()), np.zeros_like(own)),
            probability=1.0,
            present=1.0,
            closes=closes,
            shown=closes,
            closes_interval=(closes, closes),
            rms_after=rms(at + 1),
            indistinguishable=(),
            rivals=(),
        )
    last = len(chosen)
    scatter = rms(last) / np.sqrt(noise2)
    left = max(squares[last] - model.count, 0.0) / explainable
    return Decomposition(
        model=model,
        causes=tuple(causes.values()),
        unclear=(),
        unmodelled=(),
        remainder=Remainder(rms(last), left, (), ()),
        unexplained=left,
        rms=rms(0),
        noise=float(np.sqrt(noise2)),
        change=theta[: model.tangent.shape[1]],
        scatter=scatter,
        bic=float(model.count * np.log(max(squares[last], 1e-12) / model.count)),
        largest=1.0,
    )
