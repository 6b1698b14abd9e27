"""The robot with the causes that a decomposition found: fitted geometry and stiffness, and its effects."""

from __future__ import annotations

import numpy as np

from beamstiff.diagnosis.decomposition.decompose import Cause, Decomposition
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect


def applied(found: Decomposition) -> Robot:
    """Return the robot with the open parameters as fitted beside the causes, and the causes as its effects.

    What is of the measured campaign alone, as a target that slipped, is no part of the robot.
    """
    robot = found.model.robot(found.change)
    added = [effect for cause in found.causes if (effect := _added(found, cause)) is not None]
    return robot.model_copy(update={"effects": (*robot.effects, *added)})


def _added(found: Decomposition, cause: Cause) -> AddedEffect | None:
    form, values = cause.forms[0], cause.theta[0] * cause.forms[0].sizes
    values = np.where(form.positive, np.maximum(values, 0.0), values)
    parameters = {
        item.name: f"{value!r} {item.unit}" if item.unit[0].isalpha() and item.unit != "SI" else value
        for item, value in zip(form.shape.parameters, values.tolist(), strict=True)
        if not item.passing
    }
    if not parameters:
        return None
    scales = EFFECTS[form.effect].scales(found.model.baseline, form.component)
    against = form.shape.against
    return AddedEffect(
        effect=form.effect,
        component=form.component,
        shape=form.shape.name,
        parameters=parameters,
        scales={name: value for name, value in scales.items() if against is None or name in against},
        closes=round(cause.closes, 4),
    )
