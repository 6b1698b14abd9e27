"""How sure a correction is: what standard deviations of stiffness, effects and load move the real tool by."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from beamstiff.compensation.machine import Machine
from beamstiff.compensation.taught_base import TaughtBase
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

STEP = 1e-3  # of a stiffness: the compliance follows its inverse
SURE = 2.0  # standard deviations, below which a correction is doubtful


def parameter_columns(
    machine: Machine, q: Array, wrench: Array, tip: Array, std: Mapping[str, float]
) -> Array:
    """Return how the real tool moves with one standard deviation of every uncertain parameter, (K, N, 6).

    `std`: of stiffness parameters, as `identify` gives them, SI. Effects of the real robot bring their own,
    but for `correlated_effects`.
    `q` (N, A), `wrench` (N, 6), `tip` (N, 4, 4): as of `Machine.moved`.
    """
    columns = [*stiffness_columns(machine, q, wrench, tip, std)]
    alone = uncertain_effects(machine.real, machine.real.effects)
    if alone:  # an effect is its parameters times its shapes
        bare = machine.real.model_copy(update={"effects": ()})
        without = replace(machine, actual=bare).moved(q, wrench, tip)
        columns += [replace(machine, actual=robot).moved(q, wrench, tip) - without for robot in alone]
    return np.array(columns).reshape(-1, len(q), 6)


def stiffness_columns(
    machine: Machine, q: Array, wrench: Array, tip: Array, std: Mapping[str, float]
) -> Array:
    """Return how the real tool moves with one standard deviation of each stiffness in `std`, (K, N, 6)."""
    if not std:
        return np.zeros((0, len(q), 6))
    as_is = machine.moved(q, wrench, tip)
    columns = [
        (replace(machine, actual=robot).moved(q, wrench, tip) - as_is) * scale
        for robot, scale in _stiffness(machine.real, std)
    ]
    return np.array(columns).reshape(-1, len(q), 6)


def from_start_values(
    machine: Machine, q: Array, wrench: Array, tip: Array, base: TaughtBase | None = None
) -> Array:
    """Return the displacement (N, 6) by stiffness that no measured load touched, m and rad.

    A compliance 1/k displaces by what it is, to first order: -k times the derivative by k. `base`: that the
    robot taught with these displacements: they count from the workpiece.
    """
    known = stiffness_parameters(machine.real)
    std = {name: known[name] for name in machine.real.unmeasured}
    moved = np.asarray(-stiffness_columns(machine, q, wrench, tip, std).sum(axis=0))
    if base is not None:
        still = np.zeros((len(base.q), 6))
        moved -= base.carried(from_start_values(machine, base.q, still, base.poses), tip)
    return moved


def load_columns(machine: Machine, q: Array, wrench: Array, tip: Array, load_std: Array) -> Array:
    """Return how the real tool moves with a standard deviation of every component of the load, (K, N, 6)."""
    steps = [np.eye(6)[axis] * load_std[axis] for axis in np.flatnonzero(load_std)]
    if not steps:
        return np.zeros((0, len(q), 6))
    as_is = machine.moved(q, wrench, tip)
    return np.array([machine.moved(q, wrench + step, tip) - as_is for step in steps])


def correction_std(
    machine: Machine,
    q: Array,
    wrench: Array,
    tip: Array,
    std: Mapping[str, float],
    load_std: Array,
    base: TaughtBase | None = None,
) -> Array:
    """Return the standard deviations (N, 6) of corrections, m and rad; zero where none is stated.

    `base`: that the real robot taught: parameters move the workpiece too.
    """
    parameters = parameter_columns(machine, q, wrench, tip, std)
    if base is not None:
        still = np.zeros((len(base.q), 6))
        at_base = parameter_columns(machine, base.q, still, base.poses, std)
        parameters -= np.array([base.carried(one, tip) for one in at_base]).reshape(parameters.shape)
    columns = [parameters, load_columns(machine, q, wrench, tip, load_std)]
    return np.asarray(np.sqrt((np.concatenate(columns) ** 2).sum(axis=0)))


def doubtful(correction: Array, std: Array) -> NDArray[np.bool_]:
    """Tell which corrections (N, 6) are below twice their standard deviation (N, 6), turn and way alike."""
    parts = [
        np.linalg.norm(correction[:, part], axis=1) < SURE * np.linalg.norm(std[:, part], axis=1)
        for part in (slice(0, 3), slice(3, 6))
    ]
    return np.asarray(parts[0] & parts[1])


def _stiffness(robot: Robot, std: Mapping[str, float]) -> list[tuple[Robot, float]]:
    known = stiffness_parameters(robot)
    for name in std:
        if name not in known:
            raise BeamstiffError(
                f"std: found {name!r}{suggest(name, known)}, expected stiffness of robot {robot.name!r}: "
                f"{listed(known)}"
            )
    return [
        (robot.with_parameters({name: known[name] * (1 + STEP)}), sigma / (STEP * known[name]))
        for name, sigma in std.items()
        if np.isfinite(known[name]) and known[name] > 0 and sigma > 0
    ]


def uncertain_effects(robot: Robot, effects: Sequence[AddedEffect]) -> list[Robot]:
    """Return robots with one of some effects alone, of the size of one parameter's standard deviation.

    Only of effects with one such parameter, see `correlated_effects`.
    """
    apart = {one.label for one in correlated_effects(effects)}
    return [
        robot.model_copy(
            update={"effects": (effect.model_copy(update={"parameters": {name: sigma}, "std": {}}),)}
        )
        for effect in effects
        if effect.label not in apart
        for name, sigma in effect.std.items()
        if name in effect.parameters
    ]


def correlated_effects(effects: Sequence[AddedEffect]) -> tuple[AddedEffect, ...]:
    """Return the effects with several uncertain parameters.

    These were fitted together, and errors of one make up for those of another. A robot file holds their
    standard deviations and not their correlation: taken as independent they would make a correction many
    times as uncertain as it is.
    """
    uncertain = Counter(one.label for one in effects for name in one.std if name in one.parameters)
    return tuple(one for one in effects if uncertain[one.label] > 1)
