"""`compare_runs`: what changed between two campaigns of one machine, beyond the uncertainty of both."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.calibration.least_squares import estimate
from beamstiff.calibration.statement import build_calibration
from beamstiff.diagnosis.changes import (
    CampaignFit,
    RunComparison,
    campaign_fit,
    causes_displacement,
    compare_fits,
)
from beamstiff.diagnosis.without_effects import turned, without_effects
from beamstiff.errors import BeamstiffError, OptionError, shown
from beamstiff.functions.calibrate import calibrate
from beamstiff.functions.checks import names_of
from beamstiff.functions.identify import identify
from beamstiff.functions.robots import as_robot
from beamstiff.identification.input_errors import InputErrors, build_response
from beamstiff.identification.problem import build_problem
from beamstiff.identification.result import Identification
from beamstiff.identification.series_parallel import INVERSE_UNITS
from beamstiff.identification.statement import Statement, build_identification
from beamstiff.measure.coerce import TableLike, as_tables, doubts_of
from beamstiff.measure.rows import require_tracker
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import RobotLike
from beamstiff.robot.stiffness_parameters import parameter_unit
from beamstiff.se3 import Array

OF_SIZE = "of the size in the robot"  # unit of a cause's size


def compare_runs(
    robot: RobotLike,
    a: TableLike,
    b: TableLike,
    parameters: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    compliances: Sequence[str] = (),
    level: float = 0.05,
) -> RunComparison:
    """Find what changed between two campaigns of one machine, beyond the uncertainty of both.

    The robot is fitted to both tables together. About that fit each table alone then determines the
    parameters again, and Wald's test (1943) says whether any of them changed; Holm's procedure (1979) says
    which, and names none unless the test of all finds a change. Displacements are compared by the compliances
    ``1/k`` of what `identify` fits; absolute positions by what `calibrate` fits, each campaign having a
    measuring frame of its own. The size of every cause among the robot's effects is a parameter too.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    a, b : Measurements or path
        The earlier and the later campaign: displacements both, or absolute positions both. Postures and loads
        need not be the same.
    parameters, fixed : sequence of str
        As of `identify`, or of `calibrate`.
    compliances : sequence of str
        As of `calibrate`.
    level : float
        Chance of a false alarm, 0 to 1.

    Returns
    -------
    RunComparison
        Changes are B minus A, SI. Where a fit leaves more than the stated noise, or none is stated, standard
        deviations are those of the scatter, and the test is an F-test.

    Raises
    ------
    BeamstiffError
        When the tables are of different kinds, cannot be fitted together or determine no parameter both.

    Examples
    --------
    A campaign measured twice: nothing changed.

    >>> import numpy as np
    >>> from beamstiff import load_robot, predict, read_measurements
    >>> rows = read_measurements("examples/data/ir663_compliance_xx.csv", load_robot("ir663"))
    >>> found = compare_runs("ir663", rows, rows)
    >>> found.changed, round(found.p, 3)
    (False, 1.0)
    """
    machine = as_robot(robot)
    if not 0.0 < level < 1.0:
        raise OptionError("level", f"found {shown(level)}, expected a number above 0 and below 1")
    names, fixed = names_of("parameters", parameters), names_of("fixed", fixed) or []
    tables = [as_tables(one, machine)[0] for one in (a, b)]
    for table in tables:
        require_tracker(table, "compare-runs")
    first, second = ("absolute positions" if one.kind == "absolute" else "displacements" for one in tables)
    if first != second:
        raise BeamstiffError(
            f"{tables[0].source} and {tables[1].source}: found {first} in the first and {second} in the "
            "second, expected the same kind of readings"
        )
    if tables[0].kind == "absolute":
        each = names_of("compliances", compliances) or []
        found = _of_positions(machine, tables, names, fixed, each)
    elif compliances:
        raise OptionError("compliances", "is of absolute positions; of displacements name them as parameters")
    else:
        found = _of_displacements(machine, tables, names, fixed)
    fits = []
    for table, fit in zip(tables, found.fits, strict=True):
        try:
            fits.append(campaign_fit(*fit))
        except BeamstiffError as error:
            raise BeamstiffError(f"{table.source}: {error}") from None
    result = compare_fits(found.names, found.units, found.sizes, fits[0], fits[1], level)
    left_out = (*result.not_compared, *found.left_out)
    return replace(result, not_compared=left_out, notes=(*found.notes, *_widened(tables, fits)))


Linearised = tuple[Array, Array, Array, int, bool]  # arguments of `campaign_fit`


@dataclass(frozen=True)
class _Both:
    """Both campaigns, linearised in the same t parameters."""

    names: list[str]
    units: list[str]
    sizes: Array  # (t,): realistic deviations
    fits: list[Linearised]
    left_out: list[str]  # what both together do not determine
    notes: tuple[str, ...]


def _of_displacements(
    machine: Robot, tables: Sequence[Measurements], names: list[str] | None, fixed: list[str]
) -> _Both:
    """Return both campaigns in compliances, about the stiffness that both together identify."""
    pooled = identify(machine, tables, names, fixed=fixed, folds=0)
    bare = machine.model_copy(update={"effects": ()})
    sought = [item.name for item in pooled.parameters]
    assert pooled.rows is not None
    statement = build_identification(bare, pooled.rows, sought).holding(pooled.stiffness)
    free = _free_compliances(machine, pooled, statement)
    value = np.array([one for _, _, one in free])
    fits: list[Linearised] = []
    for table in tables:
        causes = causes_displacement(machine, table)
        rows = replace(table, displacement=table.displacement - sum(causes.values()))
        problem = build_problem(bare, rows, sought)
        if rows.sigma_load is not None and problem.sigma_known:
            errors = InputErrors(load=rows.sigma_load)
            response = build_response(bare, rows, errors, tuple(sought), problem.behind)
            problem = problem.disturbed(response.disturbance(pooled.stiffness))
        residual, by_log = problem.jacobian(pooled.stiffness)
        still = np.zeros((len(problem.used) - len(rows), 6))  # encoders behind the gears see no cause
        more = [problem.whitening @ np.concatenate([one, still])[problem.used] for one in causes.values()]
        columns = np.column_stack([by_log @ statement.parameters.sums / value, *more])
        known = np.concatenate([value, np.ones(len(causes))])
        fits.append((residual, columns, known, len(known), problem.sigma_known))
    labels, units = [*(name for name, _, _ in free), *causes], [unit for _, unit, _ in free]
    silent = [f"1/{item.name}" for item in pooled.parameters if item.silent]
    sizes = np.full(len(labels), np.inf)
    return _Both(labels, [*units, *(OF_SIZE for _ in causes)], sizes, fits, silent, pooled.notes)


def _free_compliances(
    robot: Robot, pooled: Identification, statement: Statement
) -> list[tuple[str, str, float]]:
    """Return name, unit and value of the compliance that each free value moves: a spring's, or a sum."""
    stated, found = statement.parameters, []
    for number, first in enumerate(stated.first):
        leader = stated.names[first]
        members = {stated.names[at] for at in np.flatnonzero(stated.tied == number)}
        name, value = f"1/{leader}", float(1.0 / pooled.stiffness[first])
        for group in pooled.degenerate:
            if set(group.parameters) == members and group.value:
                parallel = group.kind == "parallel"
                name = f"1/({group.relation})" if parallel else group.relation
                value = 1.0 / group.value if parallel else group.value
        found.append((name, INVERSE_UNITS[parameter_unit(robot, leader)], value))
    return found


def _of_positions(
    machine: Robot,
    tables: Sequence[Measurements],
    names: list[str] | None,
    fixed: list[str],
    compliances: list[str],
) -> _Both:
    """Return both campaigns in what a calibration of both, each with a base of its own, identifies."""
    bare = machine.model_copy(update={"effects": ()})
    causes = [causes_displacement(machine, table) for table in tables]
    rows = [without_effects(machine, table)[1] for table in tables]
    pooled = calibrate(bare, rows, names, fixed=fixed, compliances=compliances, stations=True, folds=0)
    told = [item.parameter for item in pooled.parameters if item.identified]
    tested = [item for item in told if item.group != "base"]
    if not tested:
        raise BeamstiffError("beside the measuring frames nothing is calibrated: nothing can be compared")
    geometric = [item.name for item in tested if item.group != "compliance"]
    springs = [item.name for item in tested if item.group == "compliance"]
    placed = [item.name.replace("base1.", "base.") for item in told if item.name.startswith("base1.")]
    fits: list[Linearised] = []
    for table, own in zip(rows, causes, strict=True):
        seek = [*placed, *geometric]
        statement = build_calibration(pooled.robot, table, seek, compliances=springs)
        problem = statement.problem
        theta = estimate(problem, statement.begin, statement.identified).theta
        residual, columns = problem.linearised(theta)
        at = {item.name: number for number, item in enumerate(problem.parameters)}
        turn = problem.geometry.turn(problem.split(theta)[0])
        moved = [turned(one, turn) / problem.sigma for one in own.values()]
        order = [at[item.name] for item in tested if item.name in at]
        if len(order) < len(tested):
            lost = [item.name for item in tested if item.name not in at]
            raise BeamstiffError(f"{table.source}: nothing loads {', '.join(lost)}, leave it out")
        nuisance = [number for number in at.values() if number not in order]
        stack = [columns[:, order], *(one[problem.used][:, None] for one in moved), columns[:, nuisance]]
        nominal = np.array([pooled[item.name].value for item in tested])
        value = np.concatenate([nominal + (theta - problem.expected)[order], np.ones(len(own))])
        fits.append((residual, np.concatenate(stack, axis=1), value, len(value), problem.claimed))
    return _Both(
        [*(item.name if item.name not in springs else f"1/{item.name}" for item in tested), *causes[0]],
        [*(item.unit for item in tested), *(OF_SIZE for _ in causes[0])],
        np.array([*(item.size for item in tested), *(np.inf for _ in causes[0])]),
        fits,
        [item.name for item in pooled.parameters if not item.identified and item.parameter.group != "base"],
        # what the fit of both leaves is no matter here: where something changed it cannot fit both
        (*doubts_of(machine, tables), *pooled.statement.notes),
    )


def _widened(tables: Sequence[Measurements], fits: Sequence[CampaignFit]) -> list[str]:
    return [
        f"{table.source}: the residual is {fit.noise:.2g} times the stated noise: the model is incomplete, "
        "and standard deviations are scaled by this factor; other postures may then look like another machine"
        for table, fit in zip(tables, fits, strict=True)
        if fit.freedom is not None and np.isfinite(table.sigma[table.measured_mask]).any()
    ]
