"""What an effect is: its meaning, where it can sit, and its shapes, first order in their parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.se3 import Array

# beyond which no machine is: SI typed for mm, a missing exponent, an instrument that reads half as much again
LARGEST = {"rad": 1.0, "m": 1.0, "rad/(N*m)": 0.1, "m/N": 0.01, "1": 0.5}


@dataclass(frozen=True)
class Quantity:
    """A parameter of a shape: name, unit, and its realistic size.

    `size`: a middling realistic magnitude, in `unit`.
    `positive`: whether it cannot be negative: nothing moves against its load.
    `posture_specific`: whether it is of the postures at hand alone: it says nothing of others, and is not
        told.
    `within`: of a compliance that couples two directions, the names of theirs: their product bounds its
        square.
    `least`: what it cannot be less than, in `unit`: no payload weighs less than nothing.
    """

    name: str
    unit: str
    size: float
    positive: bool = False
    posture_specific: bool = False
    within: tuple[str, str] | None = None
    least: float = -np.inf


Quantities = tuple[Quantity, ...]
Term = tuple[Array, Quantities]  # columns (N, 6, c), or one (N, 6), and their parameters


def named(
    what: str, unit: str, size: float, axes: Sequence[str] = "xyz", *, positive: bool = False
) -> Quantities:
    """Return a parameter along, or about, each axis."""
    return tuple(Quantity(f"{what}_{axis}", unit, size, positive) for axis in axes)


@dataclass(frozen=True, eq=False)
class Shape:
    """A way in which an effect shows: displacement of every row, linear in its parameters.

    `columns`: (N, 6, c) array, m and rad per unit; what each parameter adds to the prediction.
    `parameters`: tuple of Quantity (c).
    `prior_factor`: magnitudes lie between the sizes divided and multiplied by this.
    `weight`: prior weight among the shapes of its effect.
    `realistic`: the same of those that are realistic, where machines differ from the usual; None is
        `prior_factor`.
    `against`: the scales of the effect that its columns count against; by default all of them.
    `data_selected`: whether its columns were chosen by the gap itself: campaigns without an effect, that were
        simulated, cannot be compared under it.
    `turns`: of a bearing: whether its axes turn with the joint, or stay with the part that carries it; None
        is of one that is alike all round its axis.
    `wrench`: (N, 6, c) array, N and N m; of an error of loads, what each parameter adds to the wrench,
        at the TCP where the place of the effect is ``payload``, else where the load acts.
    """

    name: str
    columns: Array
    parameters: tuple[Quantity, ...]
    prior_factor: float = 10.0
    weight: float = 1.0
    realistic: float | None = None
    against: tuple[str, ...] | None = None
    data_selected: bool = False
    turns: bool | None = None
    wrench: Array | None = None

    def displacing(self, response: Array) -> Self:
        """Return the shape of columns that are wrenches, displacing the rows by a response (N, 6, 6)."""
        return replace(self, columns=response @ self.columns, wrench=self.columns)

    @classmethod
    def of(
        cls,
        name: str,
        *terms: Term,
        prior_factor: float = 10.0,
        weight: float = 1.0,
        against: tuple[str, ...] | None = None,
        data_selected: bool = False,
    ) -> Self:
        """Return the shape of several terms side by side."""
        return cls(
            name,
            np.concatenate([np.atleast_3d(columns) for columns, _ in terms], -1),
            tuple(one for _, quantities in terms for one in quantities),
            prior_factor=prior_factor,
            weight=weight,
            against=against,
            data_selected=data_selected,
        )


Normalisation = dict[str, float | tuple[float, ...]]


def stated_scale(baseline: Baseline, name: str) -> float | None:
    """Return a scale that is written beside an effect of the robot; None in a diagnosis."""
    value = None if baseline.stated is None else baseline.stated.get(name)
    return value if isinstance(value, float) else None


def no_normalisation(baseline: Baseline, component: str | None) -> Normalisation:
    """Return nothing: the shapes do not depend on the rows that were fitted."""
    return {}


def itself(component: str) -> tuple[str, ...]:
    """Return the one place that a component is."""
    return (component,)


@dataclass(frozen=True)
class Effect:
    """Something that a model can lack.

    `meaning`: one sentence.
    `components`: components that a baseline's robot has: names, or None for the machine as a whole.
    `shapes`: shapes at a component, under the baseline's rows.
    `separation`: the measurement that distinguishes it from its look-alikes, as an instruction.
    `scales`: what its shapes take from the rows that were fitted, SI, by name: written beside an effect that
        is added to a robot, and found in `Baseline.stated` where such a robot is used.
    `sources`: where the realistic sizes come from.
    `place`: where it sits when it has no component: ``base``, ``tool``, or outside the machine.
    `outside`: whether the formats have no name for it: what it explains is told in the remainder, and the
        verdict is `unknown`. It is written into the robot all the same.
    `places_of`: the places that a component is: a joint pair is two, a frame's parameter is the frame.
    `alike_in_positions`: effects that at the same component move the tool alike, so that no position
        distinguishes them, and what does, as an instruction.
    """

    name: str
    family: str
    meaning: str
    components: Callable[[Baseline], list[str | None]]
    shapes: Callable[[Baseline, str | None], list[Shape]]
    separation: str
    look_alikes: tuple[str, ...] = field(default=())
    sources: str = "engineering estimate"
    scales: Callable[[Baseline, str | None], Normalisation] = no_normalisation
    place: str = ""
    outside: bool = False
    places_of: Callable[[str], tuple[str, ...]] = itself
    alike_in_positions: Mapping[str, str] = field(default_factory=dict)

    def places(self, component: str | None) -> tuple[str, ...]:
        """Return the places that a component is, or where the effect sits when it has none."""
        return (self.place,) if component is None else self.places_of(component)
