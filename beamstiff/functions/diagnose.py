"""`diagnose`: where the gap between model and machine is, and what causes it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np

from beamstiff.diagnosis.diagnose import diagnose as run
from beamstiff.diagnosis.excluded import not_noise
from beamstiff.diagnosis.measured_torques import BESIDE_EFFECTS
from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.diagnosis.without_effects import without_effects
from beamstiff.errors import OptionError, shown
from beamstiff.functions.checks import axes_of, names_of, whole
from beamstiff.functions.robots import as_robot
from beamstiff.identification.assembly_plausibility import displacement_doubts
from beamstiff.measure.coerce import DataLike, as_tables, doubted, doubts_of
from beamstiff.measure.position_plausibility import stands_doubts
from beamstiff.measure.rows import concatenate, row_digests
from beamstiff.model.correction import extrapolation_notes
from beamstiff.model.linear import preload_notes
from beamstiff.robot.planar_loops import closed_in_plane, note_of
from beamstiff.robot.reader import RobotLike


def diagnose(
    robot: RobotLike,
    data: DataLike,
    *,
    without: Sequence[str] = (),
    prior: Mapping[str, float] | None = None,
    region: Sequence[tuple[float, float]] | None = None,
    batch: int | None = None,
    directions: Sequence[str] = (),
    seed: int = 0,
    stations: bool = False,
) -> Diagnosis:
    """Diagnose the gap between a model and measurements.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        Its `identify` parameters are fitted first. Its effects stay as they are: the gap is what they leave.
    data : Measurements or path, or several
        Displacements or absolute positions.
    without : sequence of str
        Effects, or ``effect:component``, that cannot be the cause. A gap that they would explain does not
        count as noise: its cause is unknown then, and a note names them.
    prior : mapping of str to float, optional
        How many of a cause are expected at a component before the data, above 0 and at most 1, by effect or
        ``effect:component``; what is not named keeps the default (`docs/diagnosis_method.md`).
    region : three pairs, m, optional
        Least and largest x, y, z of the TCP in what is proposed to measure next.
    batch : int, optional
        Rows to propose at most, single ones of load cycles where no cause remembers the loads before; else
        load cycles.
    directions : sequence of str
        Axes of the base along which proposed loads may pull, such as ``("x", "-x", "z")``; default: along
        those of the rows.
    seed : int
        Of simulated campaigns and held-out postures.
    stations : bool
        Whether the robot, or the tracker, stood elsewhere for each table of absolute positions.

    Returns
    -------
    Diagnosis

    Raises
    ------
    BeamstiffError
        When the rows cannot be predicted, hold no position or nothing that an effect could show in
        (nothing but zeros, all against their load), or `without` or `prior` names no effect.
    """
    machine = as_robot(robot)
    whole("seed", seed, 0)
    excluded = names_of("without", without) or ()
    expected = checked_prior(prior or {})
    tables = as_tables(data, machine)
    doubts = [*doubts_of(machine, tables), *(() if stations else stands_doubts(tables, machine))]
    rows = concatenate(tables)
    doubts += displacement_doubts(machine, rows, fitted_names(machine))
    where, axes = None if region is None else tuple(region), axes_of("directions", directions)
    digests = row_digests(rows)
    rows = replace(rows, region=where, batch=batch, directions=axes)
    with doubted(doubts):
        if rows.kind == "absolute":
            machine, planar = closed_in_plane(machine, rows.q)
            doubts += note_of(machine, planar)
        bare, left, known = machine, rows, machine.effects if rows.kind == "absolute" else ()
        if known:  # so that geometry and measuring frame can be left open beside them
            bare, left = without_effects(machine, rows, stations=stations)
            if np.isfinite(left.torque).any():
                left = replace(left, torque=np.full_like(left.torque, np.nan))
                doubts.append(BESIDE_EFFECTS)
        options: dict[str, Any] = {"prior": expected, "seed": seed, "stations": stations}
        found = run(bare, left, without=excluded, **options)
        if excluded and found.verdict.effect == "none":
            found = not_noise(found, run(bare, left, **options))
        result = replace(found, known=known, fitted_rows=tuple(digests))
        doubts += [*preload_notes(machine, rows), *extrapolation_notes(machine, rows.q)]
    # of the table before what is made of it
    return replace(result, notes=(*doubts, *(note for note in result.notes if note not in doubts)))


def checked_prior(prior: Mapping[str, Any]) -> dict[str, float]:
    """Return expected numbers of causes, each above 0 and at most 1.

    >>> checked_prior({"backlash": 0.0})
    Traceback (most recent call last):
    ...
    beamstiff.errors.OptionError: prior: backlash: found 0.0, expected a number above 0, at most 1
    """
    for name, value in prior.items():
        if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) <= 1.0):
            raise OptionError("prior", f"{name}: found {shown(value)}, expected a number above 0, at most 1")
    return {name: float(value) for name, value in prior.items()}
