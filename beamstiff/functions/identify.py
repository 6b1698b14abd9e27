"""`identify`: stiffness values from measured displacements, beside the effects that a robot has."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamstiff.diagnosis.measured_torques import measured_torques
from beamstiff.diagnosis.notes import chosen_for
from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.diagnosis.without_effects import without_effects
from beamstiff.errors import OptionError, optional
from beamstiff.functions.checks import names_of, one_of, whole, without_model
from beamstiff.functions.fitted import fitted_robot, model_kind
from beamstiff.functions.robots import as_robot
from beamstiff.identification.assembly_plausibility import displacement_doubts
from beamstiff.identification.bootstrap import Bootstrap
from beamstiff.identification.bootstrap import bootstrap as draw
from beamstiff.identification.degeneracy import find_degeneracy
from beamstiff.identification.identify import identify as fit
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.minimise import GLOBAL, LEAST, METHODS, Effort, Progress
from beamstiff.identification.models.side_by_side import Options
from beamstiff.identification.objective import LOSSES, Loss
from beamstiff.identification.pareto import pareto_front
from beamstiff.identification.problem import Components, build_problem
from beamstiff.identification.reduced_model import Reduced, reduce_model
from beamstiff.identification.result import Identification
from beamstiff.identification.separating_rows import with_separations
from beamstiff.identification.statement import Statement, build_identification
from beamstiff.identification.wind_up import without_encoders
from beamstiff.measure.coerce import DataLike, TableLike, as_tables, doubted, doubts_of
from beamstiff.measure.plausibility import counted_once
from beamstiff.measure.rows import concatenate, require_tracker
from beamstiff.measure.table import Measurements
from beamstiff.parallel import check_places
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import RobotLike
from beamstiff.robot.stiffness_parameters import check_stiffness

USES: tuple[Components, ...] = ("both", "position", "rotation")


def identify(
    robot: RobotLike,
    data: DataLike,
    parameters: Sequence[str] | None = None,
    method: str = "trust-region",
    *,
    fixed: Sequence[str] = (),
    ties: Sequence[Sequence[str]] = (),
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: Loss = "linear",
    components: Components = "both",
    errors: InputErrors | None = None,
    folds: int = 5,
    bootstrap: int = 0,
    reduce: bool = False,
    seed: int = 0,
    evaluations: int = 20_000,
    population: int | None = None,
    searches: int = 1,
    processes: int = 1,
    scheduler: str | None = None,
    model: str | None = None,
    cube: float | None = None,
    separate: bool = False,
    positions: TableLike | None = None,
    pareto: int = 0,
    progress: Progress | None = None,
) -> Identification:
    """Identify stiffness values from measured displacements.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        Its present stiffness values are the start; all that is not among the parameters stays as it is. What
        its `effects` displace is taken off the readings first.
    data : Measurements or path, or several
        Displacements, loaded minus unloaded. Copies of rows count once.
    parameters : sequence of str, optional
        Stiffness values to identify: a joint's ``"J12.torsional"``, a strut ``"screw2"``, a beam's modulus
        ``"arm.E"``; default ``robot.identify``, or where that is empty the drives.
    method : str
        "trust-region" (default), "levenberg-marquardt", "linear" (in compliances), "slsqp", "mma", "lbfgs",
        "bobyqa"; and the global "isres", "crs2", "esch", "mlsl", "genetic".
    fixed : sequence of str
        Parameters that stay as they are in the robot.
    ties : sequence of sequences of str
        Parameters that keep the ratio of their starts.
    bounds : mapping of str to (low, high), optional
        SI; None for no bound.
    priors : mapping of str to (value, factor), optional
        Known beforehand: value, and the factor by which one standard deviation is off.
    loss : "linear", "soft_l1", "huber" or "cauchy"
        How residuals count: squared, or less where they are beyond two standard deviations.
    components : "position", "rotation" or "both"
        Which readings count; each by its noise.
    errors : InputErrors, optional
        Of the loads and of the joint values in the table: they add to the noise of the readings;
        default what the tables say (``sigma_load``).
    folds : int
        Folds of the held-out errors; 0 for none.
    bootstrap : int
        Fits to poses drawn again, for intervals; 0 for none.
    reduce : bool
        Reduce the robot to what the data can identify, see `Identification.reduced`.
    seed : int
        Of all that is drawn at random.
    evaluations, population, searches : int
        Limits of the method; of a global one how many candidates, and how many searches.
    processes : int
    scheduler : str, optional
        Of dask, ``tcp://host:port``: bootstrap and searches are spread over its workers.
    model : "fuzzy", "grid", "gray box" or "gaussian process", optional
        Fit a model of elasticity to the same rows too, judge it by held-out poses, and give the robot it as
        its `model`: what varies are the springs that are identified.
    cube : float, optional, m
        Side of a grid's cubes; default a third of the workspace.
    separate : bool
        As published: every cube by its own rows alone, every fuzzy compliance term with its own partition.
    positions : Measurements or path, optional
        Absolute positions of the unloaded TCP, for kinematic parameters of its own in every cube of a grid.
    pareto : int
        Points of the front of position error against rotation error (`Identification.front`), 0 for none:
        where the model fits neither, the two ask for other stiffness values.
    progress : callable, optional
        Called with the number of evaluations and the least cost.

    Returns
    -------
    Identification
        After Ctrl-C the best so far, `interrupted`.

    Raises
    ------
    BeamstiffError
        When the data cannot carry the identification; the message says what is missing.

    Examples
    --------
    >>> found = identify("ir663", "examples/data/ir663_compliance_xx.csv")
    >>> print(f"{1e3 * found.rms:.3f} mm")
    0.113 mm
    """
    machine, dropped = without_model(as_robot(robot), "the identification, nor of what it writes")
    check_stiffness(machine)
    kind = None if model is None else model_kind(model)
    if kind is None and (cube is not None or separate or positions is not None):
        raise OptionError("model", "is missing: cube, separate and positions say how it is fitted")
    one_of("method", method, list(METHODS))
    one_of("loss", loss, list(LOSSES))
    one_of("components", components, USES)
    for name, number in (("folds", folds), ("bootstrap", bootstrap), ("seed", seed)):
        whole(name, number, 0)
    for name, number in (("evaluations", evaluations), ("searches", searches)):
        whole(name, number, 1)
    if population is not None:
        whole("population", population, LEAST)
    if folds == 1:
        raise OptionError("folds", "found 1, expected 2 or more, or 0 for none")
    if searches > 1 and method not in GLOBAL:
        raise OptionError("searches", f"found the method {method}, expected {', '.join(GLOBAL)}")
    if pareto and (loss != "linear" or priors or components != "both"):
        raise OptionError("pareto", "is of squared errors of both: found a loss, priors or one of them alone")
    notes: list[str] = [*dropped]
    if bootstrap or searches > 1:
        check_places(processes, scheduler)
    elif processes > 1 or scheduler is not None:
        notes.append("one search is one process: only bootstrap and searches are spread")
    tables = as_tables(data, machine)
    doubts = doubts_of(machine, tables)
    rows = counted_once(concatenate(tables))
    if kind is not None:
        require_tracker(rows, "a model of elasticity")
    if errors is None and rows.sigma_load is not None:
        errors = InputErrors(load=rows.sigma_load)
    names = names_of("parameters", parameters)
    if names is None and not machine.identify:
        names = list(fitted_names(machine)) or None
        notes += chosen_for(machine)
    doubts += displacement_doubts(machine, rows, names or fitted_names(machine))
    said: dict[str, Any] = {
        "parameters": names,
        "fixed": names_of("fixed", fixed) or (),
        "ties": ties,
        "bounds": bounds,
        "priors": priors,
        "loss": loss,
        "components": components,
        "errors": errors,
    }
    effort = Effort(evaluations, seed, population, searches, processes, scheduler)
    with doubted(doubts):
        notes += measured_torques(machine, rows).doubts
        bare, rows = without_effects(machine, rows)
        if machine.effects and np.isfinite(rows.link).any():
            rows = without_encoders(rows)
            why = "the robot's effects are not in their readings"
            notes.append(f"encoders behind the gears are not used: {why}")
        found = fit(bare, rows, method=method, folds=folds, effort=effort, progress=progress, **said)
    drawn: Bootstrap | None = None
    reduced: Reduced | None = None
    left_out: list[str] = []
    if not found.interrupted:
        try:
            with optional("what would tell more", left_out.append):
                found = with_separations(found, bare, rows, components, seed)
            if bootstrap:
                with optional("the bootstrap", left_out.append):
                    drawn = _draw(build_identification(bare, rows, **said), found, bootstrap, effort)
        except KeyboardInterrupt:  # the values are there
            found = replace(found, interrupted=True)
    if reduce:
        with optional("the reduced robot", left_out.append):
            reduced = _reduce(bare, rows, found, components)
    if pareto and not found.interrupted:
        statement = build_identification(bare, without_encoders(rows), **{**said, "errors": None})
        found = replace(found, front=pareto_front(statement, found.stiffness, pareto))
    if kind is not None and not found.interrupted:
        varying = None if names is None else tuple(names)
        options = Options(varying, cube, seed, separate)
        placed = None if positions is None else as_tables(positions, machine, what="positions")[0]
        larger, said_of_model = fitted_robot(found.robot, bare, rows, kind, options, placed)
        found, notes = replace(found, robot=larger), [*notes, *said_of_model]
    if machine.effects:
        effects = {"effects": machine.effects}
        found = replace(found, robot=found.robot.model_copy(update=effects))
        if reduced is not None:
            reduced = replace(reduced, robot=reduced.robot.model_copy(update=effects))
    notes = [*doubts, *notes, *found.notes, *left_out]
    return replace(found, start=machine, rows=rows, bootstrap=drawn, reduced=reduced, notes=tuple(notes))


def _draw(statement: Statement, found: Identification, repetitions: int, effort: Effort) -> Bootstrap:
    """Return the bootstrap about what was found."""
    statement = statement.holding(found.stiffness).weighed(found.stiffness)
    where: dict[str, Any] = {"processes": effort.processes, "scheduler": effort.scheduler}
    return draw(statement, statement.theta(found.stiffness), repetitions, effort.seed, **where)


def _reduce(robot: Robot, rows: Measurements, found: Identification, components: Components) -> Reduced:
    names = [item.name for item in found.parameters]
    problem = build_problem(robot, rows, names, components)
    values = dict(zip(names, found.stiffness.tolist(), strict=True))
    return reduce_model(robot, find_degeneracy(problem), values, names)
