"""`calibrate`: geometry, and compliances if wanted, from measured absolute positions or poses."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from beamstiff.calibration.calibrate import calibrate as fit
from beamstiff.calibration.elastic import felt_names
from beamstiff.calibration.identifiability import NOTICED
from beamstiff.calibration.parameters import Parameter
from beamstiff.calibration.result import Calibration
from beamstiff.calibration.statement import build_calibration
from beamstiff.calibration.validation import errors_on
from beamstiff.diagnosis.measured_torques import measured_torques
from beamstiff.diagnosis.without_effects import positions_without_effects
from beamstiff.errors import BeamstiffError, OptionError, listed, optional, shown, suggest
from beamstiff.functions.checks import effects_text, names_of, whole, without_model
from beamstiff.functions.robots import as_robot
from beamstiff.measure.coerce import DataLike, TableLike, as_tables, doubted, doubts_of, refuse_fitted
from beamstiff.measure.position_plausibility import stands_doubts
from beamstiff.measure.rows import concatenate, ranges_of, require_tracker, row_digests
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.planar_loops import closed_as_described, closed_in_plane, note_of
from beamstiff.robot.reader import RobotLike
from beamstiff.units import quantity

Prior = float | str
KINDS: dict[str, Literal["length", "angle"]] = {"m": "length", "rad": "angle"}


def calibrate(
    robot: RobotLike,
    data: DataLike,
    parameters: Sequence[str] | None = None,
    method: str = "levenberg-marquardt",
    *,
    fixed: Sequence[str] = (),
    last: Sequence[str] = (),
    compliances: Sequence[str] = (),
    priors: Mapping[str, Prior | Sequence[Prior]] | None = None,
    noticed: float = NOTICED,
    stations: bool = False,
    folds: int = 5,
    test: Sequence[TableLike] = (),
) -> Calibration:
    """Calibrate the geometry of a robot from measured absolute positions, or poses.

    Weighted least squares over the parameters that the poses can distinguish; the others stay as they are.
    Gravity, payload and loads act as the robot's stiffness says; the stiffness values called `compliances`
    are estimated along with the geometry.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    data : Measurements or path, or several
        Absolute rows: joint readings, position of a reflector (`point`), or pose; loaded or not.
    parameters : sequence of str, optional
        What to seek: parameters (``"f3.d"``, ``"q2"`` the zero of an encoder, ``"n7.x"`` the place of a
        reflector), groups (``"base"``, ``"target"``, ``"offsets"``, ``"frames"``) or frames; default all.
    method : "levenberg-marquardt" or "gauss-newton"
    fixed : sequence of str
        Likewise: what stays. Readings in the robot's own base frame call for ``"base"``.
    last : sequence of str
        Likewise: what is held first where it cannot be distinguished from others.
    compliances : sequence of str
        Stiffness values to estimate along, such as ``"J2.torsional"``, as compliances.
    priors : mapping of str to float or str, optional
        Standard deviations about the robot's values: SI, or a text with its unit (``"0.2 mm"``). Of a group
        or frame a text holds for the parameters that have such a unit; several texts give it both units.
    noticed : float
        Signal over noise of a realistic deviation (1 mm, 1 mrad) from which a parameter is sought.
    stations : bool
        Every table was measured with the robot, or the tracker, in another place: each has a base of its own,
        ``base1``, ``base2`` and so on.
    folds : int
        Of the poses, for the errors held out; 0 for none.
    test : sequence of Measurements or paths
        Readings to test the calibrated robot on, see `Calibration.tests`.

    Returns
    -------
    Calibration

    Raises
    ------
    BeamstiffError
        When the rows hold no absolute readings or too few, a pose cannot close its loops, a parameter is
        unknown or would open a loop, a compliance is not loaded.
    """
    machine, dropped = without_model(as_robot(robot), "the calibration, nor of what it writes")
    whole("folds", folds, 0)
    if isinstance(test, str | os.PathLike) or not isinstance(test, Sequence):
        raise OptionError("test", f"found {shown(test)}, expected a list of tables")
    tables = as_tables(data, machine)
    refuse_fitted(test, data)
    tested = {_name(one): as_tables(one, machine, what="test")[0] for one in test}
    if stations and tested:
        raise OptionError("test", "beside stations it is not said where the robot stood; leave one out")
    doubts = [*doubts_of(machine, tables), *(() if stations else stands_doubts(tables, machine))]
    rows = concatenate(tables)
    digests = row_digests(rows)
    described, (machine, planar) = machine, closed_in_plane(machine, rows.q)
    if machine.effects:
        require_tracker(rows, "the calibration of a robot with effects")
    said: dict[str, Any] = {
        "parameters": names_of("parameters", parameters),
        "fixed": names_of("fixed", fixed) or (),
        "last": names_of("last", last) or (),
        "compliances": names_of("compliances", compliances) or (),
        "noticed": noticed,
        "stations": stations,
        "encoders": not machine.effects,
    }
    dropped += start_values_taken(machine, rows, said["compliances"])
    if np.isfinite(rows.link).any() and (machine.effects or not compliances):
        why = "the robot has effects" if machine.effects else "no compliances are sought"
        dropped += (f"encoders behind the gears are not used: {why}",)
    bare = machine.model_copy(update={"effects": ()})
    with doubted(doubts):
        if priors:
            said["priors"] = each_prior(priors, build_calibration(bare, rows, **said).problem.parameters)
        found = fit(bare, rows, method=method, folds=0 if machine.effects else folds, **said)
        if machine.effects:  # of the measuring frame, which only a fit tells: twice
            rows = positions_without_effects(machine, rows, found.bases)
            found = fit(bare, rows, method=method, folds=folds, **said)
            dropped += (f"the fit includes the robot's effects unchanged: {effects_text(machine.effects)}",)
        if compliances:  # which wind-up by weights and loads tells
            dropped += measured_torques(machine, rows).doubts
        errors, left_out = {}, list[str]()
        for name, table in tested.items():
            with optional(f"the test on {name}", left_out.append):
                if machine.effects:
                    table = positions_without_effects(machine, table, found.bases)
                errors[name] = errors_on(found, table)
    calibrated = found.robot.model_copy(update={"effects": machine.effects}).with_fitted_rows(
        digests, ranges_of(rows), (found.held_out or found.after).position_rms
    )
    calibrated = closed_as_described(calibrated, described, rows.q)
    dropped += note_of(calibrated, planar)
    found = replace(found, robot=calibrated)
    return replace(found, rows=rows, tests=errors, notes=(*dropped, *doubts, *found.notes, *left_out))


def start_values_taken(robot: Robot, rows: Measurements, fitted: Sequence[str]) -> tuple[str, ...]:
    """Return which start values of a stiffness the deformation counts with as if they were measured."""
    guessed = [name for name in robot.unmeasured if name not in fitted]
    if not guessed or not (guessed := felt_names(robot, rows, guessed)):
        return ()
    names = ",".join(guessed)
    return (
        f"deformation counts by start values that no measurement determined: {listed(guessed, 6)}. Fit them "
        f"too (--compliances {names}), or take beamstiff diagnose, which does",
    )


def each_prior(
    priors: Mapping[str, Prior | Sequence[Prior]], parameters: Sequence[Parameter]
) -> dict[str, float]:
    """Return standard deviations, SI, by parameter, of those given by parameter, group or frame."""
    goes_by = [(item, _goes_by(item)) for item in parameters if item.unit in KINDS]
    result: dict[str, float] = {}
    several = {name: one if isinstance(one, list | tuple) else [one] for name, one in priors.items()}
    for name, value in ((name, one) for name, values in several.items() for one in values):
        own = [item for item, names in goes_by if name in names]
        if not own:
            hint = suggest(name, [one for _, names in goes_by for one in names])
            raise OptionError("priors", f"{name!r} is no geometric parameter that is sought{hint}")
        if not isinstance(value, str) and len({item.unit for item in own}) > 1:
            raise OptionError("priors", f"{name}: found {shown(value)}, expected a unit such as mm or deg")
        found, failure = {}, None
        for item in own:
            try:
                found[item.name] = quantity(value, KINDS[item.unit])
            except BeamstiffError as error:  # a group has lengths and angles
                failure = error
        if not found:
            raise OptionError("priors", f"{name}: {failure}")
        if min(found.values()) <= 0:
            told = f"found {shown(value)}, expected a positive standard deviation"
            raise OptionError("priors", f"{name}: {told}")
        result |= found
    return result


def _goes_by(item: Parameter) -> tuple[str, ...]:
    """Return what a parameter goes by: its name, its group, its frame."""
    group = f"{item.group}s" if item.group in ("offset", "frame") else item.group
    frame = item.name.rpartition(".")[0] if item.group == "frame" else item.name
    return item.name, group, frame


def _name(table: TableLike) -> str:
    return os.fspath(table) if isinstance(table, str | os.PathLike) else table.source
