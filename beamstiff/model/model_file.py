"""Fitted models of elasticity to the key `model` of a robot's file, and back."""

from functools import lru_cache
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.table import Measurements
from beamstiff.model.cube_kinematics import CubeDeviations
from beamstiff.model.fuzzy_compliance import FuzzyCompliance
from beamstiff.model.fuzzy_correction import FuzzyCorrection
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition
from beamstiff.model.gaussian_process import Covariance, GaussianProcessStiffness, taught
from beamstiff.model.grid import Cubes, GriddedStiffness, tcp_positions
from beamstiff.robot.description import Robot
from beamstiff.robot.fitted_model import (
    DISPLACEMENT,
    VERSION,
    WRENCH,
    CubeGrid,
    CubeKinematics,
    FittedModel,
    FittedRange,
    FuzzyRules,
    TaughtProcess,
)
from beamstiff.se3 import Array

DIGITS = 10  # of the numbers that are written
NONE = "none"  # what a spring follows that turns with no variable

Fitted = FuzzyCompliance | GriddedStiffness | FuzzyCorrection | GaussianProcessStiffness


def with_model(robot: Robot, model: Fitted, rows: Measurements) -> Robot:
    """Return a robot with a model of its elasticity that was fitted to rows; it replaces one it has."""
    return robot.model_copy(update={"model": model_data(model, rows, robot)})


def model_data(model: Fitted, rows: Measurements, robot: Robot) -> FittedModel:
    """Return a fitted model as plain data, with the postures that it was fitted to."""
    names = [variable.name for variable in robot.actuated]
    q, at = (np.round(values, 9) + 0.0 for values in (rows.q, tcp_positions(robot, rows.q)))
    fields: dict[str, Any] = {
        "version": VERSION,
        "source": rows.source,
        "ranges": [
            FittedRange(variable=name, low=low, high=high)
            for name, low, high in zip(names, _numbers(q.min(axis=0)), _numbers(q.max(axis=0)), strict=True)
        ],
        "workspace": [_numbers(at.min(axis=0)), _numbers(at.max(axis=0))],
    }
    match model:
        case FuzzyCompliance():
            fields |= {"kind": "fuzzy", "rules": [_compliance_rules(one) for one in model.systems]}
        case GriddedStiffness():
            cubes = model.cubes
            x, y, z = _numbers(cubes.low)
            rows_of_each = tuple(model.rows.tolist())
            grid = CubeGrid(low=(x, y, z), size=cubes.size, counts=cubes.counts, rows=rows_of_each)
            fields |= {"kind": "grid", "cubes": grid, "interpolate": model.interpolate}
            fields |= {"springs": model.parameters, "stiffness": _table(1.0 / model.compliance)}
            if model.deviations is not None:
                own = _table(model.deviations.values)
                parameters = model.deviations.parameters
                fields["kinematics"] = CubeKinematics(parameters=parameters, deviations=own)
        case FuzzyCorrection():
            fields |= {"kind": "gray box", "rules": [_rules(model.system, model.parameters)]}
            fields |= {"springs": model.parameters, "stiffness": _table(1.0 / model.compliance[None])}
        case GaussianProcessStiffness():
            fields |= {"kind": "gaussian process", "process": _process(model, names)}
            fields |= {"springs": model.parameters, "stiffness": _table(1.0 / model.compliance[None])}
    return FittedModel(**fields)


def _rules(system: FuzzySystem, terms: tuple[str, ...]) -> FuzzyRules:
    premises, support = system.premises, system.support
    return FuzzyRules(
        terms=terms,
        inputs=premises.inputs,
        sets=tuple(map(_numbers, premises.modal_values)),
        conclusions=_table(system.conclusions.reshape(premises.count, -1).T),
        support=() if support is None else _numbers(support),
    )


def _compliance_rules(system: FuzzySystem) -> FuzzyRules:
    known = np.isfinite(system.conclusions).all(axis=0)
    pairs = np.argwhere(known)
    terms = tuple(f"{DISPLACEMENT[i]}/{WRENCH[j]}" for i, j in pairs.tolist())
    return _rules(FuzzySystem(system.premises, system.conclusions[:, known], system.support), terms)


def _process(model: GaussianProcessStiffness, names: list[str]) -> TaughtProcess:
    covariance = model.covariance
    return TaughtProcess(
        follows=tuple(names[at] if at >= 0 else NONE for at in covariance.own.tolist()),
        own_spread=_numbers(covariance.own_spread),
        spread=_numbers(covariance.spread),
        own_length=_number(covariance.own_length),
        lengths=_numbers(covariance.lengths),
        scale=_numbers(covariance.scale),
        noise=_number(model.noise),
        misfit=_six(model.misfit),
        postures=_table(model.postures),
        posture=tuple(model.posture_of.tolist()),
        value=_numbers(model.value),
        slopes=_table(model.slopes),
    )


def _six(values: Array) -> tuple[float, float, float, float, float, float]:
    dx, dy, dz, rx, ry, rz = _numbers(values)
    return dx, dy, dz, rx, ry, rz


def fitted_model(robot: Robot) -> Fitted | None:
    """Return the model of a robot's file, ready to predict, also beyond what it was fitted to; or None."""
    data = robot.model
    if data is None:
        return None
    names = tuple(variable.name for variable in robot.actuated)
    if data.kind == "fuzzy":
        first, *others = (_compliance_system(rules, _trained(data, rules.inputs)) for rules in data.rules)
        return FuzzyCompliance(names, first, tuple(others), extrapolate=True)
    compliance = 1.0 / np.array(data.stiffness)
    if data.cubes is not None:
        cubes = Cubes(np.array(data.cubes.low), data.cubes.size, data.cubes.counts)
        deviations = None
        if data.kinematics is not None:
            values = np.array(data.kinematics.deviations)
            deviations = CubeDeviations(data.kinematics.parameters, values)
        rows = np.array(data.cubes.rows, dtype=np.int64)
        return GriddedStiffness(
            robot, data.springs, cubes, compliance, rows, data.interpolate, True, deviations
        )
    if data.process is not None:
        return _taught_process(robot, data.springs, compliance[0], data.process)
    rules = data.rules[0]
    conclusions = np.array(rules.conclusions).T
    premises = _premises(rules, _trained(data, rules.inputs))
    system = FuzzySystem(premises, conclusions, np.array(rules.support) if rules.support else None)
    return FuzzyCorrection(robot, data.springs, compliance[0], system, extrapolate=True)


def _trained(data: FittedModel, inputs: tuple[str, ...]) -> Array | None:
    """Return the fitted range of each input, (n, 2); None where the file does not say it."""
    known = {one.variable: (one.low, one.high) for one in data.ranges}
    return np.array([known[name] for name in inputs]) if known.keys() >= set(inputs) else None


def _premises(rules: FuzzyRules, trained: Array | None) -> Partition:
    return Partition(rules.inputs, tuple(np.array(values) for values in rules.sets), trained)


def _compliance_system(rules: FuzzyRules, trained: Array | None) -> FuzzySystem:
    premises = _premises(rules, trained)
    conclusions = np.full((premises.count, 6, 6), np.nan)
    for term, values in zip(rules.terms, rules.conclusions, strict=True):
        moved, _, load = term.partition("/")
        if moved not in DISPLACEMENT or load not in WRENCH:
            raise BeamstiffError(
                f"model.rules.terms: found {term!r}, expected a displacement and a load, such as dx/fz: "
                f"{listed(DISPLACEMENT)} and {listed(WRENCH)}"
            )
        conclusions[:, DISPLACEMENT.index(moved), WRENCH.index(load)] = values
    return FuzzySystem(premises, conclusions, np.array(rules.support) if rules.support else None)


def _taught_process(
    robot: Robot, springs: tuple[str, ...], compliance: Array, found: TaughtProcess
) -> GaussianProcessStiffness:
    names = [variable.name for variable in robot.actuated]
    covariance, postures, root, weights = _solved(found, tuple(names))
    return GaussianProcessStiffness(
        robot=robot,
        parameters=springs,
        compliance=compliance,
        covariance=covariance,
        postures=postures,
        posture_of=np.array(found.posture, dtype=np.int64),
        slopes=np.array(found.slopes),
        root=root,
        weights=weights,
        misfit=np.array(found.misfit),
        value=np.array(found.value),
        noise=found.noise,
    )


@lru_cache(maxsize=4)  # many predictions of one process, whose covariance takes a while to factor
def _solved(found: TaughtProcess, names: tuple[str, ...]) -> tuple[Covariance, Array, Array, Array]:
    covariance = Covariance(
        own=np.array([names.index(name) if name in names else -1 for name in found.follows]),
        scale=np.array(found.scale),
        own_length=found.own_length,
        lengths=np.array(found.lengths),
        own_spread=np.array(found.own_spread),
        spread=np.array(found.spread),
    )
    postures, of = np.array(found.postures), np.array(found.posture, dtype=np.int64)
    slopes, value = np.array(found.slopes), np.array(found.value)
    root, weights = taught(covariance, postures, of, slopes, value, found.noise)
    return covariance, postures, root, weights


def _number(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(map(_number, values.tolist()))


def _table(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(map(_numbers, values))
