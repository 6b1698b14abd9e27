"""The diagnosis: where the gap is, which effect causes it, how far it shrinks, how sure that is."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from beamstiff.diagnosis.decomposed import beside_calibration, diagnosis_of, with_next
from beamstiff.diagnosis.decomposition.causes import HALF, NOISE, QUARTER
from beamstiff.diagnosis.decomposition.decompose import decompose
from beamstiff.diagnosis.decomposition.folds import FOLDS
from beamstiff.diagnosis.decomposition.forms import OF_GEOMETRY, Shapes
from beamstiff.diagnosis.decomposition.outlier_influence import Apart, places_apart
from beamstiff.diagnosis.decomposition.same_mechanics import same_mechanics
from beamstiff.diagnosis.inference.library import Library, build_library, by_candidate
from beamstiff.diagnosis.inference.search import NONE, UNKNOWN
from beamstiff.diagnosis.linear_statics import as_loaded
from beamstiff.diagnosis.measured_torques import measured_torques
from beamstiff.diagnosis.notes import notes, order_taken
from beamstiff.diagnosis.one_by_one import weigh_one_by_one
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline
from beamstiff.diagnosis.residual.outlier_screening import Screened, screen
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.shared_reading import shared_reading
from beamstiff.errors import BeamstiffError, UnusableError
from beamstiff.identification.problem import LEAST_LOAD
from beamstiff.measure.plausibility import LARGE_DISPLACEMENT, counted_once, require_usable
from beamstiff.measure.rows import in_runs, without_rows
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.stages import stage

MOST_ROWS = 4000  # that are diagnosed: they take 3 GB and a minute, and more say hardly more


def diagnose(
    robot: Robot,
    measurements: Measurements,
    *,
    without: Sequence[str] = (),
    prior: Mapping[str, float] | None = None,
    seed: int = 0,
    stations: bool = False,
) -> Diagnosis:
    """Diagnose the gap of a robot and a table; as of `beamstiff.diagnose`."""
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices are slower on several threads
        return _diagnose(robot, measurements, Prior(tuple(without), prior or {}), seed, stations)


def _diagnose(robot: Robot, measurements: Measurements, prior: Prior, seed: int, stations: bool) -> Diagnosis:
    require_usable(measurements)
    if stations and measurements.kind != "absolute":
        raise BeamstiffError(
            f"{measurements.source}: displacements know no base frame: stations are for absolute positions"
        )
    every = counted_once(measurements)
    rows = in_runs(every, MOST_ROWS)
    said = measured_torques(robot, rows, prior)
    found = _of_rows(robot, rows, said.informed(prior), seed, stations)
    if found.verdict.key != NONE and (loaded := as_loaded(robot, rows)) is not None:
        found = _of_rows(robot, loaded[0], said.informed(prior), seed, stations)
        found = replace(found, notes=(loaded[1], *found.notes))
    found = with_next(found, seed)
    several = found.decomposition
    causes = several.every if several is not None else ()
    order = order_taken(found.baseline, {found.verdict.effect, *(one.forms[0].effect for one in causes)})
    every_note = (*found.notes, *said.doubts, *said.notes, *order)
    found = replace(found, notes=every_note, loads_contradicted=said.sure)
    if doubt := shared_reading(found):
        found = replace(found, notes=(*found.notes, doubt))
    if len(rows) == len(every):
        return found
    sample = f"{len(rows)} of {len(every)} rows are diagnosed: ten runs of postures, spread over the table"
    return replace(found, notes=(sample, *found.notes))


def _of_rows(robot: Robot, rows: Measurements, prior: Prior, seed: int, stations: bool) -> Diagnosis:
    rows = replace(rows, wrench=np.where(np.abs(rows.wrench) > LEAST_LOAD, rows.wrench, 0.0))
    absolute = rows.kind == "absolute"
    as_calibrated, why = None, None
    try:
        if absolute:
            as_calibrated, needless = beside_calibration(robot, rows, prior, seed, stations)
            if not needless:
                return as_calibrated()
    except UnusableError:
        raise
    except BeamstiffError as error:
        if stations or rows.targets or rows.camera:  # whose readings say nothing without a calibration
            raise
        why = error
    try:  # the geometry as described
        baseline, library, screened = _screened(robot, rows, prior)
        found = weigh_one_by_one(library, screened, prior, seed)
    except BeamstiffError as error:  # of readings in another frame that no calibration took up, say why
        raise why or error from None
    if why is not None and found.rms > LARGE_DISPLACEMENT:  # nor is the geometry near what is described
        raise why
    if as_calibrated is not None and (calibrated := _rather(as_calibrated, found)) is not None:
        return calibrated
    usual = _usual_name(found)
    left = found.features["misfit"] > NOISE
    if absolute or not (left or usual) or np.unique(rows.pose).size < FOLDS:
        return found  # of fewer postures than folds those that are held out tell too little
    # neither one cause nor two, weighed in all their forms, leave but noise: more causes at once.
    # What a table states of its noise is left as it is: rows that a crowd moves look as noisy as anything
    stated = baseline if baseline.claimed else screened.baseline
    at = by_candidate(library.hypotheses)
    known: Shapes | None = {key: [library.hypotheses[k].shape for k in places] for key, places in at.items()}
    apart = Apart() if "outliers" in prior.without else places_apart(stated)
    if apart.left_out:
        stated, known = fit_baseline(robot, without_rows(rows, apart.left_out)), None
    several = decompose(robot, stated.rows, prior=prior, seed=seed, baseline=stated, known=known)
    told = several.every
    if found.verdict.key == UNKNOWN:  # what no effect of the library is says at least what it looks like
        told = (*told, *several.unmodelled)
    if not left and (several.verdict is None or several.verdict.key != usual):
        return found
    # of postures that had no say in their selection
    if told and sum(cause.closes for cause in told) >= QUARTER:
        said = notes(screened, whiten(screened.baseline, screened.used))
        return diagnosis_of(replace(several, apart=apart), tuple(said))
    return found


def _rather(as_calibrated: Callable[[], Diagnosis], found: Diagnosis) -> Diagnosis | None:
    """Return the diagnosis beside a calibration where that with the geometry as described is none.

    Where it is not sure, or asks for a geometry that no machine has, and the other one is.
    """
    if _beyond_any_machine(found):
        return as_calibrated()
    if found.verdict.key == NONE or (found.verdict.key != UNKNOWN and found.verdict.probability >= HALF):
        return None
    calibrated = as_calibrated()
    return None if calibrated.verdict.key in (NONE, UNKNOWN) else calibrated


def _beyond_any_machine(found: Diagnosis) -> bool:
    """Return whether the verdict is one error of the geometry that is larger than those of any machine."""
    verdict = found.verdict
    return verdict.effect in OF_GEOMETRY and not all(one.plausible for one in verdict.estimates)


def _usual_name(found: Diagnosis) -> str:
    """Return the usual name of the verdict's mechanics, if it is not told beside it; mostly empty."""
    usual, *_ = same_mechanics(found.baseline.nominal).get(found.verdict.key, ("",))
    return "" if usual in (found.verdict.key, *found.indistinguishable) else usual


def _screened(robot: Robot, rows: Measurements, prior: Prior) -> tuple[Baseline, Library, Screened]:
    """Return the rows, what could be the cause, and the rows with their noise as they show it."""
    stage("fitting the stiffness")
    baseline = fit_baseline(robot, rows)
    if not baseline.used[:, :3].any():
        raise BeamstiffError(
            f"{rows.source}: no row has a measured position: the gap is one of positions (dx dy dz or x y z)"
        )
    library = build_library(baseline, whiten(baseline), prior)
    return baseline, library, screen(baseline, library)
