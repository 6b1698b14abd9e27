"""Gridded stiffness from measured displacements: each cube for itself, or shrunk towards what all share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.identification.identify import identify
from beamstiff.identification.models.configuration import Varying, begin_with, fit_varying
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.grid import ON_THE_FACE, Cubes, GriddedStiffness, tcp_positions
from beamstiff.robot.description import Robot

MOST_CUBES = 1000  # fitted together: their matrix is dense


@dataclass(frozen=True, eq=False)
class GridFit:
    """Fitted gridded stiffness."""

    model: GriddedStiffness
    varying: Varying | None  # what the hierarchical fit says; None where each cube was fitted for itself
    # cube by cube, which springs are identifiable only in combination, and which its rows do not feel
    notes: tuple[str, ...] = ()


def cubes_about(robot: Robot, table: Measurements, size: float) -> Cubes:
    """Return cubes of a size, m, centred about the TCP positions of a table, enough to hold all."""
    at = tcp_positions(robot, table.q)
    low, high = at.min(axis=0), at.max(axis=0)
    counts = np.maximum(np.ceil((high - low) / size - ON_THE_FACE), 1)
    if counts.prod() > MOST_CUBES:
        raise BeamstiffError(
            f"{table.source}: found {counts.prod():.3g} cubes of {1e3 * size:.4g} mm about the TCP, "
            f"expected {MOST_CUBES} at most: make them larger"
        )
    nx, ny, nz = counts.astype(int).tolist()
    return Cubes(0.5 * (low + high) - 0.5 * size * counts, size, (nx, ny, nz))


def fit_grid(
    robot: Robot,
    table: Measurements,
    cubes: Cubes,
    parameters: Sequence[str] | None = None,
    shrink: bool = True,
    interpolate: bool = False,
) -> GridFit:
    """Fit springs that change from cube to cube to measured displacements.

    `table`: displacements, loaded minus unloaded; rows on the face of cubes count for all that meet there.
    `parameters`: springs that may vary; default ``robot.identify``. `shrink`: shrink cubes towards what all
    share, as far as the readings ask for it: a cube without data then has the common value, and is flagged.
    Else each cube is identified by its own rows alone, as in seed 001: springs identifiable only in
    combination keep their ratio. `interpolate`: between the centres of neighbouring cubes.
    """
    at = tcp_positions(robot, table.q)
    inside = cubes.inside(at)
    if (lost := ~inside.any(axis=1)).any():
        row = int(np.argmax(lost))
        where = ", ".join(f"{value:.3f}" for value in at[row])
        raise BeamstiffError(
            f"{table.place(row)}: the TCP at {where} m lies beyond the grid; make it larger, "
            "or leave the row out"
        )
    rows = inside.sum(axis=0).astype(np.int64)
    if not shrink:
        return _each_for_itself(robot, table, cubes, parameters, inside, interpolate)
    start = begin_with(robot, table, parameters)
    varying = fit_varying(start.problem, cubes.weights(at, interpolate), start.compliance)
    compliance = start.compliance * np.exp(varying.change)
    model = GriddedStiffness(start.robot, start.parameters, cubes, compliance, rows, interpolate)
    return GridFit(model, varying)


def _each_for_itself(
    robot: Robot,
    table: Measurements,
    cubes: Cubes,
    parameters: Sequence[str] | None,
    inside: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    interpolate: bool,
) -> GridFit:
    names = tuple(parameters) if parameters is not None else robot.identify
    compliance, notes = np.ones((cubes.count, len(names))), []
    for cube in range(cubes.count):
        name = cubes.name(cube)
        if not inside[:, cube].any():
            raise BeamstiffError(
                f"{table.source}: cube {name} holds no row; measure there, make the cubes larger, or shrink "
                "them towards the common value"
            )
        try:
            found = identify(robot, subset(table, inside[:, cube]), names, folds=0)
        except BeamstiffError as error:
            raise BeamstiffError(f"cube {name}: {error}") from None
        compliance[cube] = 1.0 / found.stiffness
        silent = [item.name for item in found.parameters if item.silent]
        notes += [f"cube {name}: its rows do not feel {listed(silent)}"] if silent else []
        notes += [
            f"cube {name}: only {one.relation or listed(one.parameters)} is known" for one in found.degenerate
        ]
    rows = inside.sum(axis=0).astype(np.int64)
    return GridFit(GriddedStiffness(robot, names, cubes, compliance, rows, interpolate), None, tuple(notes))
