"""Effects as part of a robot: added from a diagnosis, checked by name, and what they displace.

A robot's `effects` are plain data. Here they meet the library: an effect's columns, evaluated for the robot
without effects and with the scales that are written beside it, times its parameters.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from beamstiff.diagnosis.absorbed import absorbed_by
from beamstiff.diagnosis.added_effect import added_effect, needed_scales, rounded
from beamstiff.diagnosis.effects import EFFECTS, Normalisation, Shape
from beamstiff.diagnosis.effects.effect import LARGEST
from beamstiff.diagnosis.effects.external import OF_LOADS, under_errors
from beamstiff.diagnosis.residual.baseline import KNOWN_FACTOR, Baseline, fit_baseline, predict
from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.identification.whitening import whitening
from beamstiff.measure.rows import ranges_of
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import stiffness_text
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.parts import AddedEffect, AddedShape
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array
from beamstiff.units import in_unit

if TYPE_CHECKING:
    from beamstiff.diagnosis.result import Diagnosis

POSITIVE = (
    *("torque", "force", "moment", "compliance", "counts", "rows", "cycles", "lasts"),
    *("seats_radius", "seats_force", "longest_wave"),
)  # scales that divide
SAMPLES = 50  # postures tried, of which a few that close show what an effect is called


class EffectError(BeamstiffError):
    """An effect of a robot that cannot be used.

    `at`: its place among the robot's effects.
    `where`: the message from its key on, without the robot.
    """

    def __init__(self, robot: str, at: int, where: str) -> None:
        self.at, self.where = at, where
        super().__init__(f"robot {robot!r}: {where}")


def bare_baseline(robot: Robot, rows: Measurements) -> Baseline:
    """Return what the effects of a robot are evaluated for: the robot without them, nothing fitted."""
    return fit_baseline(robot.model_copy(update={"effects": ()}), rows, keep=())


def effects_displacement(robot: Robot, rows: Measurements, bare: Baseline | None = None) -> Array:
    """Return what the effects of a robot add to the displacement, or absolute pose, of every row, (N, 6).

    `bare`: `bare_baseline`, where several sets of effects are asked for; it takes most of the time.

    Raises EffectError when an effect, its component, shape, a parameter or a scale is unknown or missing; the
    message names it.
    """
    total = np.zeros((len(rows), 6))
    if not robot.effects:
        return total
    bare = bare or bare_baseline(robot, rows)
    keys = [(one.effect, one.component) for one in robot.effects for _ in one.each]
    seen, errors = list[tuple[str, str | None, AddedShape]](), list[tuple[str, Array]]()
    view = bare
    # errors of loads first: what is compliant deforms under these as well
    for at, effect in sorted(enumerate(robot.effects), key=lambda item: not _of_loads(item[1])):
        if view is bare and errors and not _of_loads(effect):
            view = under_errors(bare, errors)
        try:
            for part in effect.each:
                entry = (effect.effect, effect.component, part)
                if entry in seen:  # of another size it adds up: what a second diagnosis found beside it
                    raise BeamstiffError(f"shape {part.shape!r}: stands there before, once is enough")
                seen.append(entry)
                shape, values = _shown(effect, part, view, keys.count(entry[:2]) == 1)
                total += part.weight * (shape.columns @ values)
                if shape.wrench is not None:
                    errors.append((EFFECTS[effect.effect].place, part.weight * (shape.wrench @ values)))
        except BeamstiffError as error:
            raise EffectError(robot.name, at, f"effects[{at}] ({effect.effect}): {error}") from None
    return total


def is_elastic(effect: AddedEffect) -> bool:
    """Return whether an effect of a robot lets it move under load: of a part of it, not of the readings."""
    known = effect.effect in EFFECTS and effect.effect != "approach-direction"  # whatever the load
    return known and EFFECTS[effect.effect].family in ("drive", "structure")


def _of_loads(effect: AddedEffect) -> bool:
    return effect.effect in EFFECTS and EFFECTS[effect.effect].place in OF_LOADS


def check_effects(robot: Robot) -> None:
    """Refuse a robot whose effects the library does not know, whatever is asked of it.

    What an effect is called is found at a few postures, under loads of every direction. Where the machine
    takes no posture only the effects' names are checked: what is wrong with it, its use tells.

    Raises EffectError as of `effects_displacement`.
    """
    for at, effect in enumerate(robot.effects):
        try:
            _known("effect", effect.effect, EFFECTS)
        except BeamstiffError as error:
            raise EffectError(robot.name, at, f"effects[{at}] ({effect.effect}): {error}") from None
    with np.errstate(all="ignore"):
        try:
            tables = [_some_rows(robot, absolute) for absolute in (False, True)]
            predict(robot.model_copy(update={"effects": ()}), tables[0])
        except BeamstiffError:
            return
        for rows in tables:
            effects_displacement(robot, rows)


def _some_rows(robot: Robot, absolute: bool) -> Measurements:
    """Return rows of a few postures, each loaded in several ways, as time and warmth go on."""
    kinematics, random = compile_kinematics(robot), np.random.default_rng(0)
    ends = np.array([one.limits or (-1.0, 1.0) for one in robot.actuated]).reshape(-1, 2)
    drawn = random.uniform(ends[:, 0], ends[:, 1], (SAMPLES, len(ends)))
    closed = close_loops(kinematics, drawn, strict=False).closed
    q = np.repeat(drawn[closed][:4], 4, axis=0)
    wrench = np.tile(random.uniform(-100.0, 100.0, (2, 6)), (len(q) // 2, 1)) * np.tile(
        [[1.0], [1.0], [-1.0], [-1.0]], (len(q) // 4, 1)
    )
    read = np.zeros((len(q), 3))
    return make_measurements(
        [one.name for one in robot.actuated],
        q,
        tcp=robot.tcp,
        wrench=wrench,
        time=np.arange(len(q)),
        temperature=20.0 + np.arange(len(q)),
        position=read if absolute else None,
        displacement=None if absolute else read,
    )


def extended(diagnosis: Diagnosis) -> Robot:
    """Return the robot with what a diagnosis found: its stiffness, and the effects of the verdict.

    The stiffness is that of the fit with the effects: ``1/k`` of the baseline and what the effects' fit adds
    to it. A candidate makes one entry; where the data did not choose between its shapes it holds them all,
    each with its weight. Without an effect (`none`, `unknown`, `outliers`) only the stiffness changes.

    Effects that the robot had before and that were taken off the readings come first. Stiffness that the rows
    do not determine is the robot file's (`Diagnosis.kept`).

    It predicts what `Diagnosis.predict_shift` does, but for terms of second order in what was
    added and for what was of the measured postures alone and for compliances that the noise made negative,
    which are 0.
    """
    found = _found(diagnosis)
    fitted = diagnosis.linear_stiffness
    found = found.with_parameters({name: fitted[name][0] for name in diagnosis.kept})
    found = found.with_unmeasured(fitted, diagnosis.kept)
    ranges = ranges_of(diagnosis.baseline.rows)
    law = diagnosis.law
    unexplained = law.looks_like if law is not None and law.nameless else ""
    found = found.with_fitted_rows(diagnosis.fitted_rows, ranges, diagnosis.left, unexplained)
    return found.model_copy(update={"effects": (*diagnosis.known, *found.effects)})


@dataclass(frozen=True)
class FittedStiffness:
    """A stiffness value that a diagnosis fitted, SI."""

    given: float  # in the robot file
    value: float  # as the robot with what was found has it
    std: float | None  # of the value; None where these rows do not determine it
    touched: bool  # by any load of the rows: else the value is the given one

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; an infinite value is ``rigid``."""
        return asdict(self) | {"value": stiffness_text(self.value)}


def written_stiffness(diagnosis: Diagnosis) -> dict[str, tuple[float, float]]:
    """Return the fitted stiffness values: as given, and as `extended` has them, SI."""
    robot = diagnosis.calibrated if diagnosis.decomposition is not None else _refitted(diagnosis)
    return {
        name: (given, given if name in diagnosis.kept else robot.parameter(name))
        for name, (given, _) in diagnosis.linear_stiffness.items()
    }


def _refitted(diagnosis: Diagnosis) -> Robot:
    """Return the robot with the stiffness of the fit with the effects, without these."""
    fit = diagnosis.linear if diagnosis.fits else diagnosis.baseline
    return fit.robot.with_parameters(_stiffness(diagnosis)) if diagnosis.fits and fit.fitted else fit.robot


def _found(diagnosis: Diagnosis) -> Robot:
    """Return the robot that was diagnosed with what was found."""
    if diagnosis.decomposition is not None:
        return diagnosis.applied
    fit = diagnosis.linear if diagnosis.fits else diagnosis.baseline
    found: dict[tuple[str, str | None, str], tuple[Shape, float, Array, Array]] = {}
    for one in diagnosis.fits:
        start = 0
        known = np.sqrt(np.maximum(np.diag(one.covariance), 0.0))[one.compliance.size :]
        for weighted in one.shapes:
            hypothesis = weighted.hypothesis
            sizes = hypothesis.sizes
            own = slice(start, start + sizes.size)
            values, spread = (one.weight * part[own] * sizes for part in (one.theta, known))
            start += sizes.size
            key = (hypothesis.effect, hypothesis.component, hypothesis.shape.name)
            before = found.get(key, (hypothesis.shape, 0.0, 0.0, 0.0))
            # together, as parts of one weight: the fits to the same rows err alike
            found[key] = (hypothesis.shape, before[1] + one.weight, before[2] + values, before[3] + spread)
    used = _used(diagnosis)
    white = whitening(fit.sigma, used, fit.sharing)
    tangent = white @ fit.tangent[used]
    closing = {
        (one["effect"], one["component"]): round(one["closes"], 4) for one in diagnosis.explained()["causes"]
    }
    added = []
    for effect, component in dict.fromkeys(key[:2] for key in found):
        own_shapes = [
            (shape, weight, values / weight, std / weight)
            for key, (shape, weight, values, std) in found.items()
            if key[:2] == (effect, component) and weight > 0.0
        ]
        own_shapes.sort(key=lambda part: -part[1])
        moved = np.sum([weight * (shape.columns @ values) for shape, weight, values, _ in own_shapes], axis=0)
        added.append(
            added_effect(
                fit,
                effect,
                component,
                own_shapes,
                closes=closing.get((effect, component)),
                absorbed=absorbed_by(fit.fitted, tangent, white @ moved[used]),
            )
        )
    robot = _refitted(diagnosis)
    return robot.model_copy(update={"effects": (*robot.effects, *added)})


def readable(robot: Robot, known: Collection[AddedEffect] = ()) -> Robot:
    """Return a robot whose effects, but those known before, have the digits that their std is worth."""
    effects = tuple(one if one in known else rounded(one) for one in robot.effects)
    return robot.model_copy(update={"effects": effects})


def written_std(robot: Robot) -> dict[str, float]:
    """Return to what lengths, angles and stiffness values of a robot that was fitted are worth writing.

    A hundredth of these: nanometres and nanoradians, and stiffness to a millionth.
    """
    found = {f"{node.name}.{axis}": 1e-7 for node in robot.nodes for axis in "xyz"}
    found |= {f"{frame.name}.{key}": 1e-7 for frame in robot.frames for key in type(frame).model_fields}
    stiffness = stiffness_parameters(robot)
    return found | {name: 1e-4 * value for name, value in stiffness.items() if 0.0 < value < np.inf}


def _shown(effect: AddedEffect, part: AddedShape, bare: Baseline, alone: bool) -> tuple[Shape, Array]:
    """Return a shape and its parameters, SI; `alone` is the only one of its effect at its component.

    Without columns, and so without parameters, where such rows do not show it.
    """
    _known("effect", effect.effect, EFFECTS)
    law = EFFECTS[effect.effect]
    view = replace(bare, stated=part.scales)
    other = replace(view, rows=replace(view.rows, kind="displacement" if view.absolute else "absolute"))
    here, elsewhere = law.components(view), law.components(other)
    if effect.component not in here and effect.component not in elsewhere:
        _unknown_component(effect, [*here, *elsewhere])
    shows = effect.component in here
    if shows:
        scales = law.scales(view, effect.component)
        _check_scales(part, scales)
    shapes = {shape.name: shape for shape in law.shapes(view, effect.component)} if shows else {}
    if part.shape not in shapes:  # such rows do not show it: a payload, or a target's place, in differences
        others = {shape.name: shape for shape in law.shapes(other, effect.component)}
        _known("shape", part.shape, dict.fromkeys([*shapes, *others]))
        _values(part, others[part.shape], alone)
        return Shape(part.shape, np.zeros((len(view.rows), 6, 0)), ()), np.zeros(0)
    shape = shapes[part.shape]
    values = _values(part, shape, alone)
    if missing := [name for name in needed_scales(shape, scales) if name not in part.scales]:
        raise BeamstiffError(
            f"scales: {listed(missing)} missing: what the parameters are counted against, SI, as "
            "`beamstiff diagnose --apply` writes it"
        )
    return shape, values


def _values(effect: AddedShape, shape: Shape, alone: bool) -> Array:
    """Return the parameters of an entry in the order of its shape's, SI; those not named are 0."""
    parameters = [item.name for item in shape.parameters]
    values = np.zeros(len(parameters))
    for name, value in effect.parameters.items():
        _known("parameter", name, parameters)
        at = parameters.index(name)
        item = shape.parameters[at]
        try:
            values[at] = in_unit(value, item.unit)
        except BeamstiffError as error:
            raise BeamstiffError(f"parameters.{name}: {error}") from None
        if item.positive and alone and values[at] < 0:  # of several shapes only the sum is meant
            raise BeamstiffError(
                f"parameters.{name}: found {shown(value)}, expected nothing negative: a compliant part moves "
                "with its load"
            )
        if abs(values[at]) > LARGEST.get(item.unit, np.inf):
            raise BeamstiffError(
                f"parameters.{name}: found {shown(value)}, expected at most {LARGEST[item.unit]:g} "
                f"{item.unit}"
            )
    return values


def _check_scales(effect: AddedShape, expected: Normalisation) -> None:
    for name, value in effect.scales.items():
        _known("scale", name, expected)
        if isinstance(value, tuple) != isinstance(expected[name], tuple):
            kind = "a list" if isinstance(expected[name], tuple) else "a number"
            raise BeamstiffError(f"scales.{name}: found {shown(value)}, expected {kind}")
        if name in POSITIVE and np.min(value) <= 0:
            raise BeamstiffError(f"scales.{name}: found {shown(value)}, expected a positive number")
    if len({len(value) for value in effect.scales.values() if isinstance(value, tuple)}) > 1:
        raise BeamstiffError("scales: found lists of different lengths, expected equally long ones")


def _known(what: str, name: str, known: Collection[str]) -> None:
    if name not in known:
        names = [repr(one) if "," in one else one for one in known]
        hint = suggest(name, known) or (f"; known: {listed(names, 20)}" if known else "; there is none here")
        raise BeamstiffError(f"unknown {what} {name!r}{hint}")


def _unknown_component(effect: AddedEffect, components: Collection[str | None]) -> None:
    names = list(dict.fromkeys(name for name in components if name is not None))
    if effect.component is not None and names:
        _known("component", effect.component, names)
    if names:
        raise BeamstiffError(f"component: is missing, expected one of {listed(names)}")
    found = "component" if effect.component is None else f"component {effect.component!r}"
    whole = "it is of the machine as a whole" if None in components else "this robot has no place for it"
    raise BeamstiffError(f"{found}: {whole}")


def _stiffness(diagnosis: Diagnosis) -> dict[str, float]:
    """Return the fitted stiffness as it is beside the effects; no compliance falls to nothing."""
    fit = diagnosis.linear
    compliance = np.array([1.0 / fit.robot.parameter(name) for name in fit.fitted])
    change = sum(one.weight * one.compliance for one in diagnosis.fits)
    least = (1.0 / KNOWN_FACTOR - 1.0) * compliance
    if (change < least).any():
        change = _bounded(diagnosis, least)
    return dict(zip(fit.fitted, (1.0 / (compliance + change)).tolist(), strict=True))


def _bounded(diagnosis: Diagnosis, least: Array) -> Array:
    """Return the changes of the compliances (t,), none below `least`, that fit best beside the effects."""
    fit, used = diagnosis.linear, _used(diagnosis)
    gap = fit.gap.copy()
    for one in diagnosis.fits:
        sizes = np.concatenate([each.hypothesis.sizes for each in one.shapes])
        columns = np.concatenate([each.hypothesis.shape.columns for each in one.shapes], axis=-1)
        gap -= one.weight * (columns @ (one.theta * sizes))
    white = whitening(fit.sigma, used, fit.sharing)
    tangent = white @ fit.tangent[used] * -least
    solved = lsq_linear(tangent, white @ gap[used], (-1.0, np.inf))
    result: Array = -least * solved.x
    return result


def _used(diagnosis: Diagnosis) -> NDArray[np.bool_]:
    """Return which components of the rows, (N, 6), were fitted: those of outliers were not."""
    rows = diagnosis.linear.rows
    outlying = np.isin([rows.place(row) for row in range(len(rows))], list(diagnosis.outliers))
    used: NDArray[np.bool_] = diagnosis.linear.used & ~outlying[:, None]
    return used
