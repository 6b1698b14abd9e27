"""The robot with the causes that a decomposition found: fitted geometry and stiffness, and its effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import chi2

from beamstiff.calibration.calibrate import calibrate
from beamstiff.calibration.corrected import corrected
from beamstiff.diagnosis.absorbed import absorbed_by, difference, total
from beamstiff.diagnosis.added_effect import added_effect
from beamstiff.diagnosis.apply import effects_displacement
from beamstiff.diagnosis.decomposition.causes import MINOR, Cause, Decomposition
from beamstiff.diagnosis.decomposition.fit import SURELY
from beamstiff.diagnosis.decomposition.forms import Form, shift_of
from beamstiff.diagnosis.decomposition.loads import OF_THE_CLOCK, has_loads
from beamstiff.diagnosis.decomposition.open_model import OpenModel, inverse_of, open_geometry
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.effects import Shape
from beamstiff.diagnosis.effects.thermal_drift import by_temperature
from beamstiff.diagnosis.residual.baseline import KNOWN_FACTOR
from beamstiff.errors import BeamstiffError
from beamstiff.measure.camera import without_motion
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array

VAGUE = 0.5  # of a compliance, standard deviation from which on it is not determined
ROUNDING = 1e-9  # of a stiffness that is as described, by way of its compliance


def calibrated_beside(found: Decomposition) -> Robot:
    """Return the robot calibrated beside the causes, without them.

    The geometry is fitted once more: the step from where the causes were linear may be long. What was known
    of it beforehand counts as it did there: a calibration that is free makes up few postures by a geometry
    that no other posture has. A target that slipped stands where it came to rest, a zero that a joint lost is
    as it is since.
    """
    past = (law for law in found.unmodelled if law.nameless and law.past)
    robot = _calibrated(found, (*found.written, *past))
    slips = total(_slips(found, cause) for cause in found.written)
    return corrected(robot, slips, found.model.baseline.rows.q[:1]) if slips else robot


def applied(found: Decomposition, robot: Robot | None = None) -> Robot:
    """Return the robot calibrated beside the causes (`robot`, if at hand), and the causes as its effects.

    What is of the measured campaign alone, a slip, is no part of the robot, nor of the gap of which its
    effects are said to close a share: other rows do not hold it. Nor is a drift with time that is not named
    as a cause: that the next campaign drifts so as well would be a guess upon a guess.
    """
    robot = robot or calibrated_beside(found)
    gap = _lasting_gap(found)
    added = [
        one
        for cause, absorbed in zip(found.written, _absorbed(found, robot), strict=True)
        for one in _added(found, cause, {"closes": round(cause.closes / gap, 4), "absorbed": absorbed})
    ]
    return robot.model_copy(update={"effects": (*robot.effects, *added)})


def unlike_written(found: Decomposition) -> float:
    """Return how much otherwise the causes move the rows' points once they are a robot's effects, RMS, m.

    Errors of loads act on all that is compliant, so that what both move is a product, which was linear about
    other loads. Infinite where the machine buckles under them.
    """
    rows, lasting = found.model.baseline.rows, [one for one in found.written if _lasts(found, one)]
    effects = tuple(one for cause in lasting for one in _added(found, cause, {}))
    robot = calibrated_beside(found).model_copy(update={"effects": effects})
    try:
        other = effects_displacement(robot, rows) - _moved(found, lasting)
    except BeamstiffError:
        return np.inf
    return float(np.sqrt((other[:, :3] ** 2).sum(axis=1).mean()))


def written_share(found: Decomposition) -> float:
    """Return the share that the effects of the written robot are said to close together, see `applied`."""
    return sum(cause.closes for cause in found.written if _lasts(found, cause)) / _lasting_gap(found)


def of_the_campaign(found: Decomposition) -> list[Cause]:
    """Return the causes that are of the measured campaign alone, see `applied`."""
    return [cause for cause in found.written if not _lasts(found, cause)]


def _lasting_gap(found: Decomposition) -> float:
    """Return the share of the gap that is not of the measured campaign alone."""
    return max(1.0 - sum(cause.closes for cause in of_the_campaign(found)), MINOR)


def _absorbed(found: Decomposition, robot: Robot) -> list[dict[str, float]]:
    """Return what a calibration without each cause and those behind it differs by from one without those.

    The geometry is calibrated with the first causes alone, one more each time: how closely it keeps to what
    is known beforehand depends on what it has to make up for. Stiffness of displacements is linear.
    """
    model, causes = found.model, found.written
    if model.problem is None:
        result, soft = list[dict[str, float]](), _compliances(found, robot)
        for cause in reversed(causes):  # `verify` leaves out the last ones first
            result.insert(0, absorbed_by(*model.told_apart, cause.moved, soft))
            soft = {name: value + result[0].get(name, 0.0) for name, value in soft.items()}
        return result
    bare, kept = model.given.model_copy(update={"identify": ()}), as_given(found, robot)
    stages = list[dict[str, float]]()
    for count in range(len(causes) + 1):
        rows = without_motion(model.baseline.rows, _moved(found, causes[:count]))
        alone = calibrate(bare, rows, model.parameters, compliances=model.given.identify, folds=0)
        stages.append({one.name: one.change for one in alone.parameters if one.name not in kept})
    return [difference(*pair) for pair in pairwise(stages)]


def as_given(found: Decomposition, robot: Robot) -> set[str]:
    """Return the drives of a calibrated robot that the readings do not determine: they are as described."""
    given = found.model.given
    both = ((name, robot.parameter(name), given.parameter(name)) for name in given.identify)
    return {name for name, value, described in both if np.isclose(value, described, rtol=ROUNDING, atol=0.0)}


def _compliances(found: Decomposition, robot: Robot) -> dict[str, float]:
    """Return the compliances of a robot's drives that are open, by name; 0 of rigid ones."""
    return {name: 1.0 / robot.parameter(name) for name in found.model.given.identify}


def absorbed_changes(found: Decomposition, robot: Robot) -> list[dict[str, float]]:
    """Return what a calibration without the causes differs by from the robot with them, see `absorbed_by`.

    Of what is of the campaign alone too: targets that slipped it finds between where they were and where
    they came to rest.
    """
    result = [dict(one.absorbed) for one in robot.effects]
    if of_the_campaign(found):
        for cause, by in zip(found.written, _absorbed(found, robot), strict=True):
            if not _lasts(found, cause):
                result += [{name: -shift for name, shift in _slips(found, cause).items()}, by]
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
    rows = without_motion(model.baseline.rows, _moved(found, causes))
    held = None
    if has_loads([form for cause in causes for form in cause.forms]):  # found on these drives
        held = {name: linear.parameter(name) for name in model.given.identify}
    try:
        again = open_geometry(model.given, rows, parameters=model.parameters, settled=True, drives=held)
    except BeamstiffError:  # drives may come out so soft that the machine buckles: the linear step stands
        return linear
    again = again.of_told_apart
    if held:
        change = np.append(inverse_of(again.geometry) @ again.residual, np.zeros(again.present.size))
    else:
        change = _as_described(again)
    robot = again.robot(change)
    # effects of a drive are beside its compliance: one that was fitted as rigid is very stiff
    given = {name: model.given.parameter(name) for name in model.given.identify}
    stiff = {name: KNOWN_FACTOR * value for name, value in given.items() if np.isinf(robot.parameter(name))}
    finite = {name: value for name, value in stiff.items() if value < np.inf}
    return robot.with_parameters(finite).model_copy(update={"identify": linear.identify})


def _as_described(model: OpenModel) -> Array:
    """Return how the open parameters (t,) change, drives that the readings do not determine as described.

    Of those whose compliance is known to no better than half of it one after another, where all others make
    up for that: all together by no more than two standard deviations would by chance. A weight that hardly
    turns a drive leaves any value.
    """
    assert model.problem is not None
    names, first = model.problem.elastic.names, model.tangent.shape[1] - model.present.size
    given = np.array([1.0 / model.given.parameter(name) for name in names])

    def fitted(held: Sequence[int]) -> tuple[Array, float, Array]:
        """Return the change (t,), the sum of squares that it leaves, and the std of the compliances (d,)."""
        result, std = np.zeros(model.tangent.shape[1]), np.zeros(len(names))
        result[np.add(held, first).astype(int)] = (given - model.present)[held]
        free = np.setdiff1d(np.arange(len(result)), np.add(held, first))
        drives = free[free >= first] - first
        rest = replace(
            model,
            residual=model.residual - model.tangent @ result,
            tangent=model.tangent[:, free],
            present=model.present[drives],
            realistic=model.realistic[drives],
        )
        result[free] = solved(rest, ())[0]
        left = model.residual - model.tangent @ result
        std[drives] = np.linalg.norm(inverse_of(rest.tangent), axis=1)[len(free) - len(drives) :]
        return result, float(left @ left), std

    held: list[int] = []
    change, squares, std = fitted(held)
    least, scatter2 = squares, max(squares / max(model.count - model.determined, 1.0), 1.0)
    while True:
        more = float(chi2.isf(chi2.sf(SURELY**2, 1), len(held) + 1))
        vague = np.flatnonzero(np.sqrt(scatter2) * std > VAGUE * (model.present + change[first:]))
        tried = [(fitted([*held, one]), one) for one in vague.tolist() if one not in held]
        if not tried:
            return change
        best, one = min(tried, key=lambda item: item[0][1])
        if best[1] > least + more * scatter2:
            return change
        (change, _, std), held = best, [*held, one]


def _moved(found: Decomposition, causes: Sequence[Cause]) -> Array:
    """Return what causes move the points of the rows, (N, 6)."""
    forms = [form for cause in causes for form in cause.forms]
    thetas = [theta for cause in causes for theta in cause.theta]
    return shift_of(forms, thetas, len(found.model.baseline.rows))


def _lasts(found: Decomposition, cause: Cause) -> bool:
    """Return whether a cause is one of the robot, not of the measured campaign alone."""
    return any(_of_the_robot(found, cause, form) for form in cause.forms)


def _of_the_robot(found: Decomposition, cause: Cause, form: Form) -> bool:
    """Return whether a form is one of the robot, not of the measured campaign alone."""
    if form.effect in OF_THE_CLOCK and not by_temperature(form.shape):
        return any(cause is one for one in found.causes)
    return not form.past


def _added(found: Decomposition, cause: Cause, told: Mapping[str, Any]) -> Iterator[AddedEffect]:
    """Yield an entry for every effect and component of a cause, with all its forms."""
    own: dict[tuple[str, str | None], list[tuple[Shape, float, Array, Array]]] = {}
    for form, theta, std in zip(cause.forms, cause.theta, cause.std, strict=True):
        if _of_the_robot(found, cause, form):
            part = (form.shape, 1.0, theta * form.sizes, std * form.sizes)
            own.setdefault((form.effect, form.component), []).append(part)
    for (effect, component), shapes in own.items():
        yield added_effect(found.model.baseline, effect, component, shapes, **told)
        told = {}  # of the whole cause: it stands in the first
