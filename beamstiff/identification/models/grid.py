"""Gridded stiffness from measured displacements: each cube for itself, or shrunk towards what all share.

Kinematic parameters of their own in every cube, from absolute positions (seed 001), are linear about the
robot with the parameters that all cubes share, ``y = J (g + sum_c w_c x_c)``, with a realistic prior for g,
and ``x_c ~ N(0, t^2)`` of it; t and the noise maximise the evidence (MacKay, "Bayesian interpolation", 1992).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from beamstiff.errors import BeamstiffError, listed
from beamstiff.identification.identify import identify
from beamstiff.identification.models.configuration import Varying, begin_with, fit_varying
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.cube_kinematics import CubeDeviations, deviating, kinematic_parameters
from beamstiff.model.grid import ON_THE_FACE, Cubes, GriddedStiffness, tcp_positions
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

MOST_CUBES = 1000  # fitted together: their matrix is dense
REALISTIC = 1e-3  # m and rad: of parts that were machined; prior of what all cubes share
APART = (1e-3, 1.0)  # t: share of it by which cubes may differ
ROUNDS, COMMON_ROUNDS = 12, 4
MOST = 4000  # unknowns fitted together: their matrix is dense


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


def with_kinematics(model: GriddedStiffness, table: Measurements, shrink: bool = True) -> GriddedStiffness:
    """Return the gridded model with kinematic parameters of its own in every cube.

    `table`: absolute positions of the unloaded TCP, in the robot's base frame. `shrink`: shrink cubes
    towards what all share, as far as the readings ask for it; else each cube for itself, within what is
    realistic.
    """
    if table.kind != "absolute":
        raise BeamstiffError(
            f"{table.source}: holds displacements, expected absolute positions x y z of the TCP"
        )
    at = tcp_positions(model.robot, table.q)
    names = kinematic_parameters(model.robot)
    known = np.isfinite(table.position).all(axis=1)
    cubes, count = model.cubes.count, len(names)
    empty = np.logical_not(np.any(model.cubes.inside(at)[known], axis=0))
    if empty.any() and not shrink:
        raise BeamstiffError(
            f"{table.source}: cube {model.cubes.name(int(np.argmax(empty)))} holds no measured position; "
            "measure there, make the cubes larger, or shrink them towards the common value"
        )
    if cubes * count > MOST:
        raise BeamstiffError(
            f"{table.source}: found {cubes} cubes with {count} kinematic parameters each, expected at most "
            f"{MOST} in all: make the cubes larger"
        )
    machine, q = deviating(model.robot, names), table.q[known]
    gap, weights = (table.position - at)[known], model.cubes.weights(at[known], model.interpolate)
    sigma = np.where(table.sigma[known, :3] > 0, table.sigma[known, :3], np.nan)
    stated = bool(np.isfinite(sigma).all())
    scale = (sigma if stated else np.ones_like(gap))[:, :, None]
    common = np.zeros(count)
    for again in reversed(range(COMMON_ROUNDS)):
        everywhere = np.tile(common, (len(q), 1))
        columns = machine.jacobian(q, everywhere)[:, :3] / scale
        left = ((gap - machine.offsets(q, everywhere)[:, :3])[:, :, None] / scale).reshape(-1)
        if not again:
            break
        flat = columns.reshape(-1, count)
        noise = 1.0 if stated else max(float(np.sqrt((left**2).mean())), 1e-9)
        gram = flat.T @ flat / noise**2 + np.eye(count) / REALISTIC**2
        common = common + cho_solve(cho_factor(gram), flat.T @ left / noise**2 - common / REALISTIC**2)
    wide = (weights[:, None, :, None] * columns[:, :, None, :]).reshape(len(left), cubes * count)
    own = _by_cube(wide, left, stated, None if shrink else 1.0)
    deviations = CubeDeviations(names, common + own.reshape(cubes, count))
    return replace(model, deviations=deviations)


def _by_cube(columns: Array, left: Array, stated: bool, apart: float | None) -> Array:
    """Return what explains the rest (n,) beside the common parameters, by evidence where not `apart`."""
    gram, right = columns.T @ columns, columns.T @ left
    share = 0.1 if apart is None else apart
    noise = 1.0 if stated else max(float(np.sqrt((left**2).mean())), 1e-12)
    found = np.zeros(len(right))
    for _ in range(ROUNDS):
        prior = 1.0 / (share * REALISTIC) ** 2
        factor = cho_factor(gram / noise**2 + prior * np.eye(len(gram)))
        found = cho_solve(factor, right / noise**2)
        if apart is not None and stated:
            break
        free = len(gram) - prior * float(np.trace(cho_solve(factor, np.eye(len(gram)))))
        rest = float(((left - columns @ found) ** 2).sum())
        before = share
        if apart is None:
            share = float(np.clip(np.sqrt((found**2).sum() / max(free, 1e-9)) / REALISTIC, *APART))
        estimate = float(np.sqrt(rest / max(len(left) - free, 0.05 * len(left))))
        noise = max(estimate, 1.0) if stated else max(estimate, 1e-12)
        if abs(np.log(share / before)) < 1e-2:
            break
    return np.asarray(found)
