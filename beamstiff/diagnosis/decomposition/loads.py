"""Errors of loads beside drives: what a load moves is the product of both, and both are open.

``d = (F + L theta) c``, with compliances c, loads F as they are stated and their error ``L theta``. About
``(c_0, theta_0)`` the drives' columns are ``F + L theta_0``, not F: else a load that is too large makes the
drives too stiff, these the load too large again, and other causes make up for what is left. What else is
compliant is so under ``F + L theta_0``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.decomposition.forms import Form, by_form, shift_of
from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.external import OF_LOADS, under_errors
from beamstiff.diagnosis.residual.baseline import Baseline, around, on_drives, tool_response
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array

OF_THE_CLOCK = ("thermal-drift",)  # whatever the drives
CARRYING = 3  # fits in turn of the errors of loads and of the drives that carry them


def beside_loads(model: OpenModel, forms: Sequence[Form], thetas: Sequence[Array]) -> OpenModel:
    """Return the open model whose drives carry the errors of loads among causes, in realistic sizes."""
    loads = _following(model, forms, thetas)
    drives = model.present.size
    if not loads or not drives:
        return model
    here, slopes = _moved(model.baseline, loads), []
    for at, step in enumerate(model.present, start=model.tangent.shape[1] - drives):
        change = np.zeros(model.tangent.shape[1])
        change[at] = step  # of any size: what loads move is proportional to it
        slopes.append((_moved(_there(model, change, on_drives), loads) - here) / step)
    carried = np.stack(slopes, axis=-1)
    tangent = model.tangent.copy()
    tangent[:, -drives:] += model.weighed(carried)
    return replace(model, tangent=tangent, carried=carried)


def under_loads(model: OpenModel, forms: Sequence[Form], thetas: Sequence[Array]) -> OpenModel:
    """Return the open model whose causes are looked for under the loads with their errors among causes."""
    errors = [
        (EFFECTS[form.effect].place, form.shape.wrench @ (theta * form.sizes))
        for form, theta in zip(forms, thetas, strict=True)
        if form.shape.wrench is not None
    ]
    if not errors:
        return model
    under = frozenset(form.key for form in forms if form.shape.wrench is not None)
    return replace(model, baseline=under_errors(model.baseline, errors), under=under, stated=model.baseline)


def solved_beside(model: OpenModel, forms: Sequence[Form]) -> tuple[Array, Array]:
    """Return what `solved` does, on drives that carry the errors of loads among the causes."""
    found = solved(model, forms)
    for _ in range(CARRYING if model.carried is None else 0):
        thetas = by_form(forms, found[0][model.tangent.shape[1] :])
        beside = beside_loads(model, forms, thetas)
        if beside is model:
            break
        found = solved(beside, forms)
    return found


def has_loads(forms: Iterable[Form]) -> bool:
    """Return whether errors of loads are among some causes."""
    return any(form.effect in EFFECTS and EFFECTS[form.effect].place in OF_LOADS for form in forms)


def without_errors(model: OpenModel) -> OpenModel:
    """Return the open model whose drives carry the loads as stated: what is left without errors of loads."""
    if model.carried is None:
        return model
    tangent = model.tangent.copy()
    tangent[:, -model.present.size :] -= model.weighed(model.carried)
    return replace(model, tangent=tangent, carried=None)


def moved_by(model: OpenModel, forms: Sequence[Form], thetas: Sequence[Array], change: Array) -> Array:
    """Return what causes move the points of all rows, errors of loads on drives as fitted, (N, 6), m and rad.

    `thetas` of the forms in realistic sizes, `change` of the open parameters (t,).
    """
    moved = shift_of(forms, thetas, len(model.baseline.rows))
    return moved if model.carried is None else moved + model.carried @ change[-model.present.size :]


def unlike_linear(
    model: OpenModel, forms: Sequence[Form], thetas: Sequence[Array], change: Array
) -> tuple[float, float]:
    """Return how much otherwise what follows the drives acts on these as they were fitted beside it.

    By what share, and by how many times the stated noise, RMS. Arguments as of `moved_by`.
    """
    loads = _following(model, forms, thetas)
    if not model.present.size or not (loads or model.carried is not None):
        return 0.0, 0.0
    try:
        after = _moved(_there(model, change), loads)
    except BeamstiffError:  # on such drives the machine buckles
        return np.inf, np.inf
    before = moved_by(model, [form for form, _ in loads], [theta for _, theta in loads], change)
    return unlike(model, before, after)


def unlike(model: OpenModel, before: Array, after: Array) -> tuple[float, float]:
    """Return by what share displacements (N, 6) differ, and by how many times the stated noise, RMS."""
    size, other = float(np.linalg.norm(before[:, :3])), after - before
    share = float(np.linalg.norm(other[:, :3])) / size if size else 0.0
    return share, float(np.sqrt((model.weighed(other[..., None]) ** 2).sum() / max(model.count, 1)))


def follows_drives(model: OpenModel, form: Form) -> bool:
    """Return whether what a form moves follows the drives; of displacements nothing else is calibrated."""
    if form.effect not in EFFECTS or form.effect in OF_THE_CLOCK:
        return False
    return model.problem is None or has_loads([form])


def _following(model: OpenModel, forms: Sequence[Form], thetas: Sequence[Array]) -> list[tuple[Form, Array]]:
    return [(form, theta) for form, theta in zip(forms, thetas, strict=True) if follows_drives(model, form)]


def _there(
    model: OpenModel, change: Array, with_stiffness: Callable[[Baseline, Array], Baseline] = around
) -> Baseline:
    """Return what causes look at, on a robot whose open parameters are changed by (t,).

    `with_stiffness`: how exactly, where it is drives alone.
    """
    if model.problem is None:
        there = with_stiffness(model.baseline, model.stiffness(change))
        # the wrenches inside hold the errors of loads, which those of the rows do not
        return there if model.stated is None else replace(there, places=model.baseline.places)
    robot, rows = model.robot(change), model.baseline.rows
    return replace(model.baseline, robot=robot, nominal=robot, response=tool_response(robot, rows))


def _moved(baseline: Baseline, loads: Iterable[tuple[Form, Array]]) -> Array:
    """Return what errors of loads move on a robot's drives, (N, 6)."""
    result = np.zeros((len(baseline.rows), 6))
    for form, theta in loads:
        shapes = EFFECTS[form.effect].shapes(baseline, form.component)
        columns = next(shape.columns for shape in shapes if shape.name == form.shape.name)
        result += columns @ (theta * form.sizes)
    return result
