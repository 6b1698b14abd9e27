"""Geometric calibration with the columns of the diagnosis, for the examples with public measurements.

The unknowns are components of `geometry-error`, ``base`` (how the measuring frame sits), ``target`` (where
the reflector sits on the tool), and linear effects that act along. Gauss-Newton; realistic sizes hold back
what the poses hardly show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff import Robot
from beamstiff.gap.baseline import Baseline, fit_baseline
from beamstiff.gap.effects import EFFECTS
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.robot.expression import parse_expression
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array, rotation_from_vector

NOISE = 1e-3  # m, of a position: with the sizes below it holds back what the poses hardly show
LENGTH, ANGLE = 5e-3, 1e-2  # m, rad: steps of a parameter of the kinematics
SOFT = 30.0  # times the largest realistic size: those are of industrial robots, light ones give way more
PLACED = 0.1  # m, rad: of the measuring frame and the reflector


@dataclass(frozen=True)
class Calibration:
    """A calibrated robot and what is left.

    Attributes
    ----------
    robot : Robot
        With the geometry found.
    rows : Measurements
        All rows, in the base frame found.
    effects : Mapping of (effect, component, shape) to array
        Parameters of the effects that act along.
    left : (N, 3) array, m
        Measured less predicted positions of all rows, those held out too.
    """

    robot: Robot
    rows: Measurements
    effects: Mapping[tuple[str, str | None, str], Array]
    left: Array


def calibrate(
    robot: Robot,
    rows: Measurements,
    train: Array,
    geometry: Sequence[str],
    effects: Sequence[tuple[str, str | None, str]] = (),
    rounds: int = 2,
) -> Calibration:
    """Fit geometry, and effects that act along, to the rows `train` (N,) of absolute positions."""
    theta = np.zeros(0)
    columns: list[Array] = []
    for turn in range(rounds):
        baseline = fit_baseline(robot, rows)
        geometric = [_geometry(baseline, name) for name in geometry]
        columns = [_effect(baseline, one) for one in effects]
        ends = np.cumsum([0, *(part.shape[-1] for part in (*geometric, *columns))])
        sizes = [np.full(part.shape[-1], _size(n)) for n, part in zip(geometry, geometric, strict=True)]
        sizes += [_effect_shape(baseline, one)[1] for one in effects]
        stacked = np.concatenate([*geometric, *columns], axis=-1)[:, :3]
        theta = _least_squares(
            stacked[train].reshape(-1, ends[-1]), baseline.gap[train, :3].ravel(), np.concatenate(sizes)
        )
        if turn == rounds - 1:
            break
        for at, name in enumerate(geometry):
            robot, rows = _moved(robot, rows, name, theta[ends[at] : ends[at + 1]])
        robot = _joined(robot)
    left = baseline.gap[:, :3] - stacked @ theta
    own = [theta[ends[at] : ends[at + 1]] for at in range(len(geometry), len(ends) - 1)]
    return Calibration(robot, rows, dict(zip(effects, own, strict=True)), left)


def without_effects(calibration: Calibration) -> Measurements:
    """Return the rows without what the effects do: what a model that has them has still to explain."""
    baseline = fit_baseline(calibration.robot, calibration.rows)
    shift = sum(_effect(baseline, one) @ theta for one, theta in calibration.effects.items())
    return replace(calibration.rows, position=calibration.rows.position - np.asarray(shift)[..., :3])


def held_out(count: int, share: float, seed: int = 0) -> Array:
    """Return which of some rows are to be fitted to (N,); the others are held out."""
    train = np.ones(count, dtype=np.bool_)
    train[np.random.default_rng(seed).permutation(count)[: round(share * count)]] = False
    return train


def rows_of(rows: Measurements, chosen: Array) -> Measurements:
    return subset(rows, np.flatnonzero(chosen))


def _geometry(baseline: Baseline, name: str) -> Array:
    if name == "base":
        return _effect(baseline, ("frame-misalignment", None, "turned and shifted"))
    if name == "target":
        return _effect(baseline, ("tool-offset", None, "target"))
    return _effect(baseline, ("geometry-error", name, "offset"))


def _effect(baseline: Baseline, which: tuple[str, str | None, str]) -> Array:
    return _effect_shape(baseline, which)[0]


def _effect_shape(baseline: Baseline, which: tuple[str, str | None, str]) -> tuple[Array, Array]:
    """Return columns (N, 6, c) of an effect, and sizes (c,) that it hardly exceeds."""
    effect, component, name = which
    shape = next(one for one in EFFECTS[effect].shapes(baseline, component) if one.name == name)
    return shape.columns, SOFT * shape.spread * np.array([item.size for item in shape.parameters])


def _size(name: str) -> float:
    if name in ("base", "target"):
        return PLACED
    return LENGTH if name.rpartition(".")[2] in ("b", "d", "r") else ANGLE


def _least_squares(columns: Array, values: Array, sizes: Array) -> Array:
    """Return ridge regression's coefficients, with prior standard deviations `sizes`."""
    scaled = columns * sizes / NOISE
    gram = scaled.T @ scaled + np.eye(sizes.size)
    return np.asarray(sizes * np.linalg.solve(gram, scaled.T @ (values / NOISE)))


def _moved(robot: Robot, rows: Measurements, name: str, by: Array) -> tuple[Robot, Measurements]:
    """Return robot and rows with one correction made."""
    if name == "base":  # the measured point is where the turned and shifted frame has it: turn it back
        back = rotation_from_vector(-by[:3])
        return robot, replace(rows, position=(rows.position - by[3:]) @ back.T)
    if name == "target":
        nodes = [
            node.model_copy(update={"at": tuple((np.array(node.at) + by).tolist())})
            if node.name == robot.tcp
            else node
            for node in robot.nodes
        ]
        return robot.model_copy(update={"nodes": tuple(nodes)}), rows
    frame, _, parameter = name.rpartition(".")
    if not frame:  # the zero of an encoder
        q = rows.q.copy()
        q[:, rows.variables.index(name)] += by[0]
        return robot, replace(rows, q=q)
    kinds = {variable.name: variable.kind for variable in robot.variables}
    frames = []
    for item in robot.frames:
        if item.name == frame:
            kind = "angle" if parameter in ("alpha", "beta", "gamma", "theta") else "length"
            exact = parse_expression(getattr(item, parameter), kind, kinds)
            changed = replace(exact, constant=exact.constant + float(by[0]))
            value = str(changed) if changed.coefficients else changed.constant
            frames.append(item.model_copy(update={parameter: value}))
        else:
            frames.append(item)
    return robot.model_copy(update={"frames": tuple(frames)}), rows


def _joined(robot: Robot) -> Robot:
    """Return the robot with the first node of every joint where its second one is."""
    kinematics = compile_kinematics(robot)
    where = posture(kinematics, np.zeros((1, len(robot.actuated))))
    frame = {node.name: kinematics.node_frame[kinematics.node_index[node.name]] for node in robot.nodes}
    at = {}
    for joint in robot.joints:
        first, second = joint.nodes
        pose = where.transforms[0, frame[first]]
        seen = where.node_positions[0, kinematics.node_index[second]]
        at[first] = tuple((pose[:3, :3].T @ (seen - pose[:3, 3])).tolist())
    nodes = [node.model_copy(update={"at": at.get(node.name, node.at)}) for node in robot.nodes]
    return robot.model_copy(update={"nodes": tuple(nodes)})
