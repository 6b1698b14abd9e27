"""The robot with the causes that a decomposition found: fitted geometry and stiffness, and its effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.absorbed import absorbed_by, total
from beamstiff.diagnosis.added_effect import added_effect
from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition
from beamstiff.diagnosis.decomposition.forms import shift_of
from beamstiff.diagnosis.decomposition.open_model import open_geometry
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.effects import Shape
from beamstiff.diagnosis.residual.baseline import KNOWN_FACTOR
from beamstiff.measure.camera import without_motion
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array


def applied(found: Decomposition) -> Robot:
    """Return the robot calibrated beside the causes, and the causes as its effects.

    The geometry is fitted once more: the step from where the causes were linear may be long. What was known
    of it beforehand counts as it did there: a calibration that is free makes up few postures by a geometry
    that no other posture has. A target that slipped stands where it came to rest; what else is of the
    measured campaign alone is no part of the robot.
    """
    causes = (*found.causes, *found.unclear)
    robot = _calibrated(found, causes)
    slips = total(_slips(found, cause) for cause in causes)
    robot = corrected(robot, slips, found.model.baseline.rows.q[:1]) if slips else robot
    added, soft = list[AddedEffect](), _compliances(found, robot)
    for cause in reversed(causes):  # `verify` leaves out the last ones first
        absorbed = absorbed_by(*found.model.told_apart, cause.moved, soft)
        if own := [*_added(found, cause, absorbed)]:
            added = [*own, *added]
            soft = {name: value + absorbed.get(name, 0.0) for name, value in soft.items()}
    return robot.model_copy(update={"effects": (*robot.effects, *added)})


def _compliances(found: Decomposition, robot: Robot) -> dict[str, float]:
    """Return the compliances of a robot's drives that are open, by name; 0 of rigid ones."""
    return {name: 1.0 / robot.parameter(name) for name in found.model.given.identify}


def absorbed_changes(found: Decomposition, robot: Robot) -> list[dict[str, float]]:
    """Return what a calibration without the causes differs by from the robot with them, see `absorbed_by`.

    Of targets that slipped too: it finds them between where they were and where they came to rest.
    """
    result = [dict(one.absorbed) for one in robot.effects]
    soft = _compliances(found, robot)
    for cause in (*found.causes, *found.unclear):
        if cause.rows:
            rest = {name: -by for name, by in _slips(found, cause).items()}
            left = {name: value + total(result).get(name, 0.0) for name, value in soft.items()}
            result += [rest, absorbed_by(*found.model.told_apart, cause.moved, left)]
    return result


def _slips(found: Decomposition, cause: Cause) -> dict[str, float]:
    """Return how far the targets of a cause slipped in all, m; empty for other causes."""
    forms = zip(cause.forms, cause.theta, strict=True) if cause.rows else ()
    return total(
        {
            f"{form.component or found.model.given.tcp}.{axis}": by
            for axis, by in zip("xyz", (theta * form.sizes).tolist(), strict=True)
        }
        for form, theta in forms
    )


def _calibrated(found: Decomposition, causes: Sequence[Cause]) -> Robot:
    model = found.model
    linear = model.robot(found.change)
    if model.problem is None:
        return linear
    rows = model.baseline.rows
    forms = [form for cause in causes for form in cause.forms]
    moved = shift_of(forms, [theta for cause in causes for theta in cause.theta], len(rows))
    again = open_geometry(model.given, without_motion(rows, moved), parameters=model.parameters, settled=True)
    robot = again.robot(solved(again.of_told_apart, ())[0])
    # effects of a drive are beside its compliance: one that was fitted as rigid is very stiff
    given = {name: model.given.parameter(name) for name in model.given.identify}
    stiff = {name: KNOWN_FACTOR * value for name, value in given.items() if np.isinf(robot.parameter(name))}
    finite = {name: value for name, value in stiff.items() if value < np.inf}
    return robot.with_parameters(finite).model_copy(update={"identify": linear.identify})


def _added(found: Decomposition, cause: Cause, absorbed: dict[str, float]) -> Iterator[AddedEffect]:
    """Yield an entry for every effect and component of a cause, with all its forms."""
    own: dict[tuple[str, str | None], list[tuple[Shape, float, Array, Array]]] = {}
    for form, theta, std in zip(cause.forms, cause.theta, cause.std, strict=True):
        if not all(item.posture_specific for item in form.shape.parameters):
            part = (form.shape, 1.0, theta * form.sizes, std * form.sizes)
            own.setdefault((form.effect, form.component), []).append(part)
    model = found.model
    told: dict[str, Any] = {"closes": round(cause.closes, 4), "absorbed": absorbed}
    for (effect, component), shapes in own.items():
        yield added_effect(model.baseline, effect, component, shapes, **told)
        told = {}  # of the whole cause: it stands in the first
