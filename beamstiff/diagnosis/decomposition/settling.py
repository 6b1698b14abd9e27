"""Causes fitted until neither the drives nor the loads beside them change.

Each fit is linear about the geometry, drives and loads of the one before: what an error of a load moves is a
product with the drives, and with what else is compliant.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.decomposition.causes import MINOR, Decomposition
from beamstiff.diagnosis.decomposition.fit import build_choice
from beamstiff.diagnosis.decomposition.folds import Folds, folds_of
from beamstiff.diagnosis.decomposition.forms import Form, Shapes, by_form, forms_of, shift_of
from beamstiff.diagnosis.decomposition.loads import (
    beside_loads,
    follows_drives,
    has_loads,
    moved_by,
    under_loads,
    unlike,
    unlike_linear,
    without_errors,
)
from beamstiff.diagnosis.decomposition.open_model import OpenModel, open_geometry, open_stiffness
from beamstiff.diagnosis.decomposition.solution import solved
from beamstiff.diagnosis.decomposition.unmodelled import unmodelled_forms
from beamstiff.diagnosis.prior import Prior
from beamstiff.diagnosis.residual.baseline import KNOWN_FACTOR, around
from beamstiff.errors import BeamstiffError
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

SETTLED = MINOR  # share by which drives may change what a cause moves
SHOWS = 0.3  # of what the readings scatter: a change up to it does not show, it adds a twentieth
SETTLING = 8  # turns: Newton's method takes four, from drives that are off by any factor
HALFWAY, LEAST_PART = 0.5, 0.1  # that a turn goes before two tell how far; at least, to get on at all


@dataclass(frozen=True)
class Settings:
    """What holds for every fit of causes.

    Attributes
    ----------
    robot : Robot
    parameters : tuple of str, or None
        Groups of the geometry that are open.
    stations : bool
    prior : Prior
    seed : int
    """

    robot: Robot
    parameters: tuple[str, ...] | None
    stations: bool
    prior: Prior
    seed: int

    def calibrated(
        self,
        model: OpenModel,
        chosen: Sequence[Form],
        solution: tuple[Array, list[Array]],
        beside: Array | None = None,
        held: bool = False,
    ) -> OpenModel:
        """Return the open model that is calibrated beside causes, and linear about these loads and drives.

        Beside what they move by their `solution_of`, or (N, 6). Drives are those of the calibration, or
        `held` as they fit best with errors of loads, not beside them: a step of Newton's method, which is
        sure to lead on near the end alone.
        """
        change, thetas = solution
        if model.problem is None:
            opened = open_stiffness(around(model.baseline, model.stiffness(change)))
        else:
            moved = moved_by(model, chosen, thetas, change) if beside is None else beside
            there = model.robot(change)
            names = self.robot.identify if held and has_loads(chosen) else ()
            opened = open_geometry(
                self.robot,
                model.baseline.rows,
                moved,
                parameters=self.parameters,
                stations=self.stations,
                # one that comes out rigid is open about a compliance that hardly is any
                drives={
                    name: min(there.parameter(name), KNOWN_FACTOR * self.robot.parameter(name))
                    for name in names
                },
                near=model.near,
            )
        return under_loads(beside_loads(opened, chosen, thetas), chosen, thetas)

    def folds(self, model: OpenModel, chosen: Sequence[Form]) -> tuple[Folds, list[int]]:
        """Return the folds of a model calibrated anew, and the numbers of the forms chosen before."""
        carrying = None if model.carried is None else model
        model = without_errors(model)  # a fit without these errors is one on drives under stated loads
        choice, names = build_choice(model, all_forms(model, self.prior)), set(map(_name, chosen))
        same = [number for number, form in enumerate(choice.forms) if _name(form) in names]
        folds = replace(folds_of(model, choice, self.seed), carrying=carrying)
        if model.stated is None:
            return folds, same
        choice = replace(choice, kept=frozenset(k for k in same if choice.forms[k].key in model.under))
        stated = replace(model, baseline=model.stated, under=frozenset(), stated=None)
        known = {(*_name(form), form.sizes.size): form for form in all_forms(stated, self.prior)}
        forms = [known.get((*_name(form), form.sizes.size), form) for form in choice.forms]
        bare = replace(folds, model=stated, choice=build_choice(stated, forms), carrying=None)
        return replace(folds, choice=choice, stated=bare), same


def settle(settings: Settings, model: OpenModel, scatter: float, chosen: Sequence[Form]) -> OpenModel | None:
    """Return the open model beside causes once neither loads nor drives change; None: they do.

    Errors of loads and what is compliant under them are fitted in turn, and overshoot the more the more of
    the compliance is a cause's. So a turn goes a part of the way, the one by which the last two would have
    led to no further change (Aitken's relaxation: Küttler and Wall, Comput. Mech. 43 (2008) 61).
    """
    share, least = np.inf, SHOWS * max(scatter, 1.0)
    names = {_name(form) for form in chosen}
    try:
        change, thetas = solution_of(model, chosen)
        moved, errors = moved_by(model, chosen, thetas, change), _errors_of_loads(chosen, thetas)
        part, way = HALFWAY, None
        for turn in range(SETTLING):
            held = turn >= SETTLING // 2
            if turn:
                now, found_errors = moved_by(model, chosen, thetas, change), _errors_of_loads(chosen, thetas)
                before_way, way = way, {name: found_errors[name] - error for name, error in errors.items()}
                part = _part(part, before_way, way) if errors else 1.0 if held else HALFWAY
                moved = moved + part * (now - moved)
                errors = {name: error + part * way[name] for name, error in errors.items()}
            beside = [errors.get(_name(form), theta) for form, theta in zip(chosen, thetas, strict=True)]
            model = settings.calibrated(model, chosen, (change, beside), moved, held)
            before, chosen = chosen, _same(model, settings.prior, names)
            deformed = _deformed(model, before, chosen, thetas)
            change, thetas = solution_of(model, chosen)
            share, size = unlike_linear(without_errors(model), chosen, thetas, change)
            if size <= least and (deformed[0] <= SETTLED or deformed[1] <= least):
                return model
    except BeamstiffError:  # the machine may buckle beside loads that are far too large
        return None
    return model if max(share, deformed[0]) <= SETTLED else None


def _same(model: OpenModel, prior: Prior, names: Collection[tuple[str, str]]) -> list[Form]:
    """Return the forms of some names about another model."""
    keys = {key for key, _ in names}
    forms = (*forms_of(model, prior, keys), *unmodelled_forms(model, keys))
    return [form for form in forms if _name(form) in names]


def _errors_of_loads(chosen: Sequence[Form], thetas: Sequence[Array]) -> dict[tuple[str, str], Array]:
    """Return the parameters of the forms that are errors of loads, by name."""
    pairs = zip(chosen, thetas, strict=True)
    return {_name(form): theta for form, theta in pairs if form.shape.wrench is not None}


def _part(
    part: float, before: dict[tuple[str, str], Array] | None, way: dict[tuple[str, str], Array]
) -> float:
    """Return the part of its way that a turn goes, after one that went a part of the way `before`."""
    if before is None:
        return HALFWAY
    other = sum(float((way[name] - one) @ (way[name] - one)) for name, one in before.items())
    along = sum(float((way[name] - one) @ one) for name, one in before.items())
    return float(np.clip(-part * along / other, LEAST_PART, 1.0)) if other > 0.0 else 1.0


def _deformed(
    model: OpenModel, before: Sequence[Form], after: Sequence[Form], thetas: Sequence[Array]
) -> tuple[float, float]:
    """Return how much otherwise compliances deform under other errors of loads, as `unlike_linear`.

    `thetas`: of the forms before. What has other parameters now follows the data, and no load.
    """
    size_of = {_name(form): theta for form, theta in zip(before, thetas, strict=True)}
    pairs = [(form, size_of[_name(form)]) for form in after if not follows_drives(model, form)]
    same = {_name(form): theta for form, theta in pairs if form.sizes.size == theta.size}

    def moved(forms: Sequence[Form]) -> Array:
        some = [form for form in forms if _name(form) in same]
        return shift_of(some, [same[_name(form)] for form in some], len(model.baseline.rows))

    return unlike(model, moved(before), moved(after))


def unsettled(found: Decomposition, share: float = SETTLED) -> set[str]:
    """Return the causes that move otherwise on the drives as they were fitted, ``effect:component``."""
    least = (share, SHOWS * max(found.scatter, 1.0))
    unlike = [unlike_linear(found.model, one.forms, one.theta, found.change) for one in found.every]
    return {one.key for one, how in zip(found.every, unlike, strict=True) if (np.array(how) > least).all()}


def solution_of(model: OpenModel, chosen: Sequence[Form]) -> tuple[Array, list[Array]]:
    """Return the change of the open parameters (t,), and the parameters of each form."""
    change, parts = np.split(solved(model, chosen)[0], [model.tangent.shape[1]])
    return change, by_form(chosen, parts)


def _name(form: Form) -> tuple[str, str]:
    return form.key, form.shape.name


def all_forms(model: OpenModel, prior: Prior, known: Shapes | None = None) -> list[Form]:
    """Return all forms that causes may have, with those that no effect of the library has."""
    laws = (form for form in unmodelled_forms(model) if form.key not in prior.without)
    return [*forms_of(model, prior, known=known), *laws]
