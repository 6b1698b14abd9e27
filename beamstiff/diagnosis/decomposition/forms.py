"""The forms of the causes as columns of the least squares problem: few parameters, hardly data-selected."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.effects import EFFECTS, Shape
from beamstiff.diagnosis.effects.frame_misalignment import ONCE
from beamstiff.diagnosis.effects.torque_laws import axis_at, component_of, turning_drives
from beamstiff.diagnosis.prior import DEFAULT, TEMPERING, Prior, key_of
from beamstiff.fem.placed_structure import SHORTEST
from beamstiff.measure.arrays import Integers
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

MOST_PARAMETERS = 20  # of a form: freer ones explain whatever is left
SERIES, SLIP = "angle-curve", "target-slip"
# whose forms may stand beside one another: orders of a curve, moments of a slip. An instrument that moved
# again and again would stand in for whatever changes with time
REPEATED = (SERIES, SLIP)
# whose period is chosen by the data, once for all: the weight of the form pays for the one parameter more
PERIODIC = ("thermal-drift",)
LEFT_OUT = 1e-9  # of a realistic size, to which a parameter that was left out is known
COMPLIANCE_UNITS = ("rad/(N*m)", "rad/N", "m/N", "1/N", "1/(N*m^2)")
# of compliances, where no drive says how stiff the machine is: a service robot's are many times a heavy one's
UNKNOWN_SCALE = 1e3
# N m, that drives of heavy robots carry, which wind up by a mrad: what is made for less is softer by as much
HEAVY_TORQUE = 1e4
# what a geometry as described may be off by; a calibration takes it up, but for a frame that is bent or moved
OF_GEOMETRY = ("geometry-error", "frame-misalignment", "tool-offset")
FITTED = ("geometry-error", "tool-offset")
UNMODELLED = "unknown"  # effect of laws without a name; their component says which place does what

Shapes = Mapping[str, Sequence[Shape]]  # by ``effect:component``


@dataclass(frozen=True, eq=False)
class Form:
    """A form of a cause.

    Attributes
    ----------
    effect : str
    component : str or None
    shape : Shape
    columns : (n, c) array
        In units of the noise, of realistic sizes.
    log_prior : float
        Of this form among those of its cause.
    likely : float
        How many of its cause are expected before the data.
    compliance_scale : float
        By which compliances may be larger than realistic ones.
    softness : float
        By which compliances are larger than a heavy robot's, so far as rows can say it.
    used : (c,) bool array or None
        Parameters that a fit has not left out, once there was one.
    """

    effect: str
    component: str | None
    shape: Shape
    columns: Array
    log_prior: float
    likely: float
    compliance_scale: float = 1.0
    softness: float = 1.0
    used: NDArray[np.bool_] | None = None

    @cached_property
    def key(self) -> str:
        """``effect:component``."""
        return key_of(self.effect, self.component)

    @property
    def outside_library(self) -> bool:
        """Whether it is of a law that no effect of the formats has."""
        return is_outside(self.effect)

    @property
    def past(self) -> bool:
        """Whether it says nothing of other postures than those at hand."""
        return all(item.posture_specific for item in self.shape.parameters)

    @cached_property
    def cause_log_prior(self) -> float:
        """Return what its cause adds to the log likelihood; evidence is tempered, what is known is not."""
        return TEMPERING * float(np.log(self.likely))

    @cached_property
    def sizes(self) -> Array:
        """Realistic sizes of the parameters, (c,)."""
        return np.array([quantity.size for quantity in self.shape.parameters])

    @cached_property
    def realistic(self) -> tuple[Array, Array]:
        """Smallest and largest realistic size of each parameter, (c,) each, SI."""
        middle = self._of_compliances(self.softness) * self.sizes
        factor = self.shape.realistic or self.shape.prior_factor
        return middle / factor, middle * factor

    @cached_property
    def prior_std(self) -> Array:
        """Standard deviation of each parameter before the data, in realistic sizes, (c,)."""
        std = self._of_compliances(self.compliance_scale) * self.shape.prior_factor
        return std if self.used is None else std * self.used

    def _of_compliances(self, factor: float) -> Array:
        compliant = np.array([quantity.unit in COMPLIANCE_UNITS for quantity in self.shape.parameters])
        return np.where(compliant, factor, 1.0)

    @cached_property
    def couplings(self) -> Integers:
        """Numbers of the parameters that couple two others, and of these, (k, 3).

        Of a machine that gives back no more work than was done on it ``c_ab^2 <= c_aa c_bb``.
        """
        names = [quantity.name for quantity in self.shape.parameters]
        pairs = [(at, item.within) for at, item in enumerate(self.shape.parameters) if item.within]
        found = [(at, names.index(a), names.index(b)) for at, (a, b) in pairs if a in names and b in names]
        return np.array(found, dtype=np.intp).reshape(-1, 3)

    @cached_property
    def positive(self) -> Array:
        """Which parameters cannot be negative, (c,)."""
        return np.array([quantity.positive for quantity in self.shape.parameters])


def is_outside(effect: str) -> bool:
    """Return whether what has this name is no effect of the formats."""
    return effect not in EFFECTS or EFFECTS[effect].outside


def forms_of(
    model: OpenModel,
    prior: Prior = DEFAULT,
    wanted: Collection[str] = EFFECTS,
    known: Shapes | None = None,
) -> list[Form]:
    """Return the forms of effects at every component that the open model does not hold already.

    `wanted`: effects, of all components or each as ``effect:component``.

    Shapes that are known already, by ``effect:component``, are not computed anew.
    """
    baseline = model.baseline
    skipped = {*prior.without, *_open_already(model), "outliers"}
    found: list[Form] = []
    absent = _no_links(model)
    scales = _scales(model)
    for effect in EFFECTS.values():
        if effect.name in skipped:
            continue
        for component in effect.components(baseline):
            key = key_of(effect.name, component)
            if effect.name not in wanted and key not in wanted:
                continue
            # a calibration that moves an axis puts brackets between its parts, which no machine has
            if key in skipped or component in absent:
                continue
            every = (known or {}).get(key) or effect.shapes(baseline, component)
            shapes = [shape for shape in every if _fits(effect.name, shape)]
            total = sum(shape.weight for shape in shapes)
            likely = prior.expected(effect.name, component)
            found += _weighed(model, effect.name, component, shapes, total, likely, scales)
    return found


def _scales(model: OpenModel) -> tuple[float, float]:
    """Return `compliance_scale` and `softness`: where no drive says them, what carries less is softer."""
    if turning_drives(model.given):
        return 1.0, 1.0
    baseline, robot = model.baseline, model.baseline.nominal
    driven = [joint for joint in robot.joints if joint.variable is not None]
    axes = [axis_at(baseline, component_of(robot, joint)) for joint in driven]
    carried = max((axis.typical for axis in axes if axis.turns), default=HEAVY_TORQUE)
    return UNKNOWN_SCALE, float(np.clip(HEAVY_TORQUE / carried, 1.0, UNKNOWN_SCALE))


def _open_already(model: OpenModel) -> Iterable[str]:
    """Return the effects that a calibration beside the causes takes up.

    An instrument with several stations is set up anew at each: its axes turn with it, and in each it stands.
    """
    if model.problem is None:
        return ()
    whole = any(item.group == "frame" for item in model.problem.parameters)
    found = OF_GEOMETRY if model.problem.geometry.stations > 1 else FITTED
    return [effect for effect in found if whole or effect != "geometry-error"]


def _no_links(model: OpenModel) -> set[str]:
    """Return the rigids of the calibrated robot that are no links of the described one, or had no length."""
    given = model.given
    kinematics = compile_kinematics(given)
    at = posture(kinematics, model.baseline.rows.q[:1]).node_positions[0]
    ends = {
        part.name: at[kinematics.node_index[part.nodes[1]]] - at[kinematics.node_index[part.nodes[0]]]
        for part in given.rigids
    }
    links = {name for name, along in ends.items() if np.linalg.norm(along) > SHORTEST}
    return {part.name for part in model.baseline.nominal.rigids} - links


def _fits(effect: str, shape: Shape) -> bool:
    """Return whether a form is one of a few parameters that hold for other postures as well."""
    if effect == SLIP or shape.name.startswith(ONCE):
        return True
    # a matrix of compliances gives back no more work than is done on it, however many it has
    linear = all(item.unit in COMPLIANCE_UNITS for item in shape.parameters)
    few = linear or len(shape.parameters) <= MOST_PARAMETERS
    chosen = shape.data_selected and effect not in PERIODIC
    return few and not chosen and not any(item.posture_specific for item in shape.parameters)


def _weighed(
    model: OpenModel,
    effect: str,
    component: str | None,
    shapes: Sequence[Shape],
    total: float,
    likely: float,
    scales: tuple[float, float],
) -> Iterable[Form]:
    if not shapes:
        return []
    sizes = [np.array([item.size for item in shape.parameters]) for shape in shapes]
    every = model.weighed(
        np.concatenate([s.columns * z for s, z in zip(shapes, sizes, strict=True)], axis=-1)
    )
    parts = np.split(every, np.cumsum([z.size for z in sizes])[:-1], axis=1)
    return [
        Form(effect, component, shape, part, float(np.log(shape.weight / total)), likely, *scales)
        for shape, part in zip(shapes, parts, strict=True)
        if np.abs(part).max(initial=0.0) > 0
    ]


def by_form(chosen: Sequence[Form], values: Array) -> list[Array]:
    """Return parameters of several forms, one after another, as an array (c,) for each."""
    return np.split(values, np.cumsum([form.sizes.size for form in chosen], dtype=int))[:-1]


def shift_of(chosen: Sequence[Form], theta: Sequence[Array], rows: int) -> Array:
    """Return what forms with their parameters add to all rows, (N, 6), m and rad."""
    moved = np.zeros((rows, 6))
    for form, part in zip(chosen, theta, strict=True):
        moved += form.shape.columns @ (part * form.sizes)
    return moved


def stacked(model: OpenModel, chosen: Sequence[Form]) -> tuple[Array, Array]:
    """Return matrix (m, t + c) and right side (m,) of a fit of what is open with some forms.

    The n measured values come first, then what is known of the parameters beforehand.
    """
    columns = np.concatenate([model.tangent, *(form.columns for form in chosen)], axis=1)
    spread = np.concatenate([np.zeros(0), *(form.prior_std for form in chosen)])
    known = np.zeros((spread.size, columns.shape[1]))
    known[:, columns.shape[1] - spread.size :] = np.diag(1.0 / np.maximum(spread, LEFT_OUT))
    return np.concatenate([columns, known]), np.concatenate([model.residual, np.zeros(spread.size)])
