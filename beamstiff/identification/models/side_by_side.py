"""Every model of elasticity, fitted to the same rows and judged by held-out rows (seed 003, 3.3)."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError, counted, listed, suggest
from beamstiff.identification.identify import identify
from beamstiff.identification.models.fuzzy import fit_fuzzy, fit_fuzzy_correction
from beamstiff.identification.models.fuzzy_rules import require_tcp
from beamstiff.identification.models.gaussian_process import fit_gaussian_process
from beamstiff.identification.models.grid import cubes_about, fit_grid
from beamstiff.identification.models.split import KINDS, Split, position_errors
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.grid import tcp_positions
from beamstiff.model.protocol import Model, RigidModel, StructuralModel
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array
from beamstiff.shown import Shown

MOST_NOTES = 4  # on single cubes
CUBES_ALONG = 3  # the longest side of the workspace, where no size of cubes is given


@dataclass(frozen=True)
class Options:
    """How models are fitted."""

    # springs that are fitted, and may vary; default ``robot.identify``
    parameters: tuple[str, ...] | None = None
    # m: side of the cubes; default a third of the longest side of where the TCP was
    cube: float | None = None
    seed: int = 0
    # as published: every cube by its own rows alone (seed 001), every term of the compliance with a partition
    # of its own (seed 003)
    separate: bool = False


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted model, ready to predict."""

    model: Model
    about: str = ""  # what came out, in a few words
    # which postures (N, A) lie outside what was trained
    outside: Callable[[Array], NDArray[np.bool_]] | None = None


@dataclass(frozen=True, eq=False)
class Judged:
    """How a model does, N rows."""

    name: str
    about: str  # what came out, in a few words; or why there is no such model
    model: Model | None  # None where these rows cannot carry it
    predicted: Array  # (N, 6): NaN where the model has no answer
    error: Array  # (N,), m: norm of the position error; NaN where it has no answer
    outside: NDArray[np.bool_]  # (N,): rows outside what the model was trained on
    seconds: float  # that the fit took

    def rms(self, rows: NDArray[np.bool_]) -> float | None:
        """Return the root mean square of the error over some rows, m; None without an answer for any."""
        own = self.error[rows & np.isfinite(self.error)]
        return float(np.sqrt((own**2).mean())) if own.size else None

    def largest(self, rows: NDArray[np.bool_]) -> float | None:
        """Return the largest error over some rows, m."""
        own = self.error[rows & np.isfinite(self.error)]
        return float(own.max()) if own.size else None


@dataclass(frozen=True, eq=False, repr=False)
class Models(Shown):
    """Models side by side."""

    judged: tuple[Judged, ...]
    table: Measurements
    split: Split
    position: Array  # (N, 3), m: nominal TCP of every row
    robot: Robot | None = None  # as it was given
    notes: tuple[str, ...] = ()  # about the data

    def __getitem__(self, name: str) -> Judged:
        """Return a model by name."""
        by_name = {one.name: one for one in self.judged}
        if name not in by_name:
            raise BeamstiffError(f"there is no model {name!r}{suggest(name, by_name)}")
        return by_name[name]

    @property
    def noise(self) -> float | None:
        """Expected root mean square of the noise's norm, m; None where the table does not state it."""
        seen = self.table.measured_mask[:, :3]
        sigma = np.where(seen, self.table.sigma[:, :3], 0.0)
        if np.isnan(sigma).any() or not seen.any():
            return None
        return float(np.sqrt((sigma**2).sum() / seen.any(axis=1).sum()))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: lengths in mm, loads in N (or N m)."""
        split = self.split
        unseen = ~split.fitted

        def errors(one: Judged, rows: NDArray[np.bool_]) -> dict[str, Any]:
            rms, largest = one.rms(rows), one.largest(rows)
            return {
                "rows": int(rows.sum()),
                "answered": int((rows & np.isfinite(one.error)).sum()),
                "rms_mm": None if rms is None else 1e3 * rms,
                "max_mm": None if largest is None else 1e3 * largest,
            }

        return {
            "format": "beamstiff-compare/1",
            "source": self.table.source,
            "noise_mm": None if self.noise is None else 1e3 * self.noise,
            "split": {
                "rows": len(self.table),
                "fitted": int(split.fitted.sum()),
                "poses_held_out": np.unique(self.table.pose[split.new_pose]).tolist(),
                "load_unit": split.unit,
                "loads_held_out": [
                    load for at, load in enumerate(split.loads) if split.new_load[split.level == at].all()
                ],
            },
            "models": [
                {
                    "name": one.name,
                    "about": one.about,
                    "fitted": one.model is not None,
                    "seconds": one.seconds,
                    "outside": int(one.outside.sum()),
                    "by_kind": {
                        kind.replace(" ", "_"): errors(one, split.kind == at)
                        for at, kind in enumerate(KINDS)
                        if (split.kind == at).any()
                    },
                    "unseen": errors(one, unseen),
                    "by_load": [
                        {"load": load, **errors(one, unseen & (split.level == at))}
                        for at, load in enumerate(split.loads)
                        if (unseen & (split.level == at)).any()
                    ],
                }
                for one in self.judged
            ],
        }


def _rigid(robot: Robot, table: Measurements, options: Options) -> Fitted:  # noqa: ARG001 (as all of `FITS`)
    return Fitted(RigidModel(), "no compliance at all")


def _nominal(robot: Robot, table: Measurements, options: Options) -> Fitted:  # noqa: ARG001 (as all of `FITS`)
    return Fitted(StructuralModel(robot), "stiffness as the robot's file says")


def _parametric(robot: Robot, table: Measurements, options: Options) -> Fitted:
    found = identify(robot, table, options.parameters, folds=0)
    unknown = [item.name for item in found.parameters if not item.identifiable]
    count = len(found.parameters)
    said = f"{count - len(unknown)} of {count} stiffness values known"
    if unknown:
        said += f"; the fitted rows do not determine {listed(unknown, 6)}"
    return Fitted(StructuralModel(found.robot), said)


def _gray(robot: Robot, table: Measurements, options: Options) -> Fitted:
    fit = fit_fuzzy_correction(robot, table, options.parameters)
    premises = fit.model.system.premises
    sets = _sets(premises.inputs, fit.sets[-1][0])
    about = f"{counted(premises.count, 'rule')} for {counted(len(fit.model.parameters), 'spring')} ({sets})"
    return Fitted(fit.model.extrapolating(), about, fit.model.outside)


def _fuzzy(robot: Robot, table: Measurements, options: Options) -> Fitted:
    fit = fit_fuzzy(robot, table, seed=options.seed, each_term=options.separate)
    premises = [system.premises for system in fit.model.systems]
    about = "; ".join(f"{counted(one.count, 'rule')} ({_sets(one.inputs, one.sets)})" for one in premises)
    return Fitted(fit.model.extrapolating(), about, fit.model.outside)


def _grid(robot: Robot, table: Measurements, options: Options) -> Fitted:
    at = tcp_positions(robot, table.q)
    size = options.cube or max(float(np.ptp(at, axis=0).max()) / CUBES_ALONG, 1e-3)
    cubes = cubes_about(robot, table, size)
    smooth = not options.separate
    fit = fit_grid(robot, table, cubes, options.parameters, shrink=smooth, interpolate=smooth)
    empty = int((fit.model.rows == 0).sum())
    counts = " x ".join(str(count) for count in cubes.counts)
    about = f"{counts} cubes of {1e3 * size:.0f} mm" + (f", {empty} of them empty" if empty else "")
    about += "".join(f"; {note}" for note in fit.notes[:MOST_NOTES])
    about += f"; and {len(fit.notes) - MOST_NOTES} such notes more" if len(fit.notes) > MOST_NOTES else ""
    return Fitted(fit.model.extrapolating(), about, fit.model.outside)


def _process(robot: Robot, table: Measurements, options: Options) -> Fitted:
    fit = fit_gaussian_process(robot, table, options.parameters, options.seed)
    covariance = fit.model.covariance
    varied = np.sqrt(covariance.own_spread**2 + covariance.spread**2).max()
    return Fitted(fit.model, f"springs vary by a factor of up to {np.exp(varied):.2f}")


def _sets(inputs: Sequence[str], sets: Sequence[int]) -> str:
    used = [f"{count} sets of {name}" for name, count in zip(inputs, sets, strict=True) if count > 1]
    return listed(used) if used else "no input"


GIVEN = ("rigid", "nominal")  # what needs no fit
FITS: Mapping[str, Callable[[Robot, Measurements, Options], Fitted]] = {
    "rigid": _rigid,
    "nominal": _nominal,
    "parametric": _parametric,
    "fuzzy": _fuzzy,
    "grid": _grid,
    "gray box": _gray,
    "gaussian process": _process,
}


def fit_models(
    robot: Robot,
    table: Measurements,
    split: Split,
    names: Sequence[str] = tuple(FITS),
    options: Options | None = None,
    progress: Callable[[str], None] | None = None,
) -> Models:
    """Fit models to the rows that a split says, and predict all rows.

    `table`: displacements of the TCP under loads there, N rows; `names`: among `FITS`; `progress` gets
    the name of the model fitted next. A model that these rows cannot carry has no answers, and says why.
    """
    for name in names:
        if name not in FITS:
            raise BeamstiffError(
                f"there is no model {name!r}{suggest(name, FITS)}; known: {listed(FITS, 12)}"
            )
    require_tcp(table, robot.tcp, "compare", "to compare models")
    for name in (options or Options()).parameters or ():
        robot.parameter(name)  # one that does not exist is refused here, not by every model
    training = subset(table, split.fitted)
    judged = []
    for name in names:
        if progress is not None:
            progress(name)
        judged.append(_judge(name, robot, training, table, options or Options()))
    fits = [one for one in judged if one.name not in GIVEN]
    if fits and all(one.model is None for one in fits):
        raise BeamstiffError(fits[0].about)
    return Models(tuple(judged), table, split, tcp_positions(robot, table.q))


def _judge(name: str, robot: Robot, training: Measurements, table: Measurements, options: Options) -> Judged:
    begin = time.perf_counter()
    predicted, outside = np.full((len(table), 6), np.nan), np.zeros(len(table), dtype=np.bool_)
    model: Model | None = None
    try:
        fitted = FITS[name](robot, training, options)
        seconds = time.perf_counter() - begin
        predicted = fitted.model.predict(table.q, table.wrench)
        model, about = fitted.model, fitted.about
        outside = outside if fitted.outside is None else fitted.outside(table.q)
    except BeamstiffError as error:
        seconds, about = time.perf_counter() - begin, str(error)
    return Judged(name, about, model, predicted, position_errors(table, predicted), outside, seconds)
