"""Fitted models of elasticity as part of a robot: chosen, fitted to all rows, judged by held-out poses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamstiff.errors import BeamstiffError, OptionError, shown, suggest
from beamstiff.identification.models.grid import with_kinematics
from beamstiff.identification.models.side_by_side import FITS, GIVEN, Judged, Models, Options, fit_models
from beamstiff.identification.models.split import split_rows
from beamstiff.measure.table import Measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance
from beamstiff.model.grid import GriddedStiffness
from beamstiff.model.model_file import Fitted, with_model
from beamstiff.model.protocol import StructuralModel
from beamstiff.robot.description import Robot
from beamstiff.robot.fitted_model import KINDS

SHARE = 0.25  # of the poses, by which a model is judged
PARAMETRIC = "parametric"


def model_kind(name: str) -> str:
    """Return a kind of model by its name; a hyphen stands for a space."""
    kind = name.strip().lower().replace("-", " ")
    if kind not in KINDS:
        raise OptionError("model", f"found {shown(name)}{suggest(kind, KINDS)}, expected {', '.join(KINDS)}")
    return kind


def fitted_robot(
    robot: Robot,
    bare: Robot,
    rows: Measurements,
    kind: str,
    options: Options,
    positions: Measurements | None = None,
) -> tuple[Robot, tuple[str, ...]]:
    """Return a robot with a model of its elasticity fitted to all rows, and what is worth knowing of it.

    `robot`: with the identified stiffness. `bare`: as the rows are fitted with. `positions`: absolute ones of
    the unloaded TCP, for the kinematic parameters of a grid's cubes.
    """
    if positions is not None and kind != "grid":
        raise OptionError("positions", f"goes with the model grid, found {kind}")
    notes: list[str] = []
    try:
        split = split_rows(rows, SHARE, None, options.seed)
        split = replace(split, new_load=np.zeros_like(split.new_load))
        notes += judged_notes(fit_models(bare, rows, split, (PARAMETRIC, kind), options))
    except BeamstiffError as error:
        notes.append(f"the model {kind} is not judged by held-out poses: {error}")
    fitted = FITS[kind](bare, rows, options)
    model = fitted.model
    if positions is not None and isinstance(model, GriddedStiffness):
        model = with_kinematics(replace(model, robot=robot), positions, shrink=not options.separate)
    notes.append(f"model {kind}: {fitted.about}")
    assert isinstance(model, Fitted)
    return with_model(robot, model, rows), tuple(notes)


def judged_notes(found: Models) -> list[str]:
    """Return how fitted models do on held-out rows beside constant springs, worse ones first."""
    unseen = ~found.split.fitted
    springs = next((one for one in found.judged if one.name == PARAMETRIC), None)
    notes: list[str] = []
    for one in found.judged:
        both = unseen & np.isfinite(one.error)  # where a model has no answer, nothing is held against it
        rms, other = one.rms(both), None if springs is None else springs.rms(both)
        if one.name not in KINDS or rms is None or other is None:
            continue
        beside = f"{1e3 * rms:.4f} against {1e3 * other:.4f} mm RMS on {int(both.sum())} held-out rows"
        if rms > other:
            notes.insert(0, f"the model {one.name} is worse than constant springs: {beside}")
        else:
            notes.append(f"the model {one.name} beside constant springs: {beside}")
    return notes


def worse_notes(found: Models) -> list[str]:
    """Return which fitted models are worse than constant springs on held-out rows."""
    return [text for text in judged_notes(found) if "worse" in text]


def best_of(found: Models) -> Judged:
    """Return the model that is best on held-out rows, of those that a robot's file can hold."""
    unseen = ~found.split.fitted
    known: Sequence[tuple[float, Judged]] = [
        (rms, one)
        for one in found.judged
        if one.name not in GIVEN and one.model is not None and (rms := one.rms(unseen)) is not None
    ]
    if not known:
        raise BeamstiffError("no model was fitted that a robot's file can hold")
    return min(known, key=lambda pair: pair[0])[1]


def robot_with(found: Models, judged: Judged) -> Robot:
    """Return the robot that models were compared for, with one of them."""
    robot = found.robot
    assert robot is not None
    if isinstance(judged.model, StructuralModel):
        return judged.model.robot.model_copy(update={"effects": robot.effects})
    model = judged.model
    assert isinstance(model, Fitted)
    base = robot if isinstance(model, FuzzyCompliance) else model.robot
    return with_model(base.model_copy(update={"effects": robot.effects}), model, found.table)
