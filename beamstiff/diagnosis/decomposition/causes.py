"""A cause among others, and a gap as an ordered list of them with what remains."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from beamstiff.diagnosis.decomposition.behind_gears import Behind
from beamstiff.diagnosis.decomposition.forms import SLIP, UNMODELLED, Form
from beamstiff.diagnosis.decomposition.mounting import Mounting
from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.diagnosis.decomposition.outlier_influence import Apart
from beamstiff.diagnosis.decomposition.remainder import Remainder
from beamstiff.diagnosis.decomposition.unmodelled import lifted_side
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.effect import LARGEST
from beamstiff.diagnosis.effects.target_slip import slip_row
from beamstiff.se3 import Array

PRESENT = 0.95  # probability that there is a cause, this one or a look-alike, from which it counts
NAMED = 0.5  # probability that it is this one, from which it is named
MINOR = 0.03  # share of the gap; forms are right to some 15 %, and what that leaves may look like a cause
NOISE = 1.5  # times the stated noise, from which there is a gap: stated noise is seldom known better
BY_NOUN = ("base ", "tool ")  # places that are no names
HALF, QUARTER = 0.5, 0.25  # shares of the gap from which a cause is the verdict: FORMATS, `verdict`


@dataclass(frozen=True)
class RunnerUp:
    """What explains the rows best where a cause is excluded.

    Attributes
    ----------
    cause : str
        That is excluded, ``effect:component``.
    keys : tuple of str
        What is selected in its place, beside the other causes; empty where nothing is.
    odds : float
        How many times less likely that is.
    rms, rms_with : float, m
        Position gap on held-out data with all causes: with these in its place, and with it.
    """

    cause: str
    keys: tuple[str, ...]
    odds: float
    rms: float
    rms_with: float


@dataclass(frozen=True)
class Cause:
    """A cause, and what it closes of the gap after those before it.

    Attributes
    ----------
    forms : tuple of Form
        One or two; of a curve one for each order, of a target that slipped one for each row.
    theta : tuple of (c,) array
        Parameters of each form, in realistic sizes.
    std : tuple of (c,) array
    probability : float
        That this effect at this component is really there.
    present : float
        That there is a cause in its place, and not a little of everything else.
    closes : float
        Share of the explainable gap on held-out postures.
    shown : float
        Share of it by which fits differ that are free to make up for the cause: with those before it alone,
        or with all others, whichever tells more.
    closes_interval : (float, float)
        90 %, over the postures.
    rms_after : float, m
    indistinguishable : tuple of str
    rivals : tuple of Form
        The best of each of these.
    runner_up : RunnerUp or None
        What would be selected in its place, where it is named and has no look-alike.
    found_again : float
        Share of the folds of postures without which it, or what looks like it, is selected.
    astray : bool
        Whether it may make postures worse that were held out, after those before it and beside all others.
    least : float
        Share of the gap from which it is named: of what slips of reflectors leave, whose form is exact.
    """

    forms: tuple[Form, ...]
    theta: tuple[Array, ...]
    std: tuple[Array, ...]
    probability: float
    present: float
    closes: float
    shown: float
    closes_interval: tuple[float, float]
    rms_after: float
    indistinguishable: tuple[str, ...]
    rivals: tuple[Form, ...]
    runner_up: RunnerUp | None = None
    found_again: float = 1.0
    astray: bool = False
    least: float = MINOR

    @property
    def key(self) -> str:
        """``effect:component``."""
        return self.forms[0].key

    @property
    def shape(self) -> str:
        """Its forms, in words."""
        return " and ".join(form.shape.name for form in self.forms)

    @property
    def moved(self) -> Array:
        """What it moves, (n + p,), in units of the noise."""
        parts = [form.columns @ theta for form, theta in zip(self.forms, self.theta, strict=True)]
        return np.asarray(np.sum(parts, axis=0))

    @property
    def outside_library(self) -> bool:
        """Whether it is a law that no effect of the library has."""
        return self.forms[0].outside_library

    @property
    def nameless(self) -> bool:
        """Whether it is a law that no effect of a robot can be: the robot is written without it."""
        return self.forms[0].effect == UNMODELLED

    @property
    def looks_like(self) -> str:
        """What a law outside the library does, in words."""
        if not self.nameless:
            meaning = EFFECTS[self.forms[0].effect].meaning
            return f"{meaning[0].lower()}{meaning[1:].rstrip('.')}"
        does = str(self.forms[0].component)
        if self.past:
            return f"{does} {self.shape}"
        return f"the {does}" if does.startswith(BY_NOUN) else does

    @property
    def past(self) -> bool:
        """Whether it says nothing of other postures than those at hand."""
        return all(form.past for form in self.forms)

    @property
    def lifted_side(self) -> float | None:
        """Of a base that opens: the direction in which it lifts most, rad from its x axis about z."""
        return lifted_side(self.forms[0], self.theta[0])

    @property
    def named(self) -> bool:
        """Whether it is likely this cause, and more than what the form of another may leave.

        What closes much, or leaves most where it alone is missing, is named as the likeliest of what looks
        like it: without it neither the rest of the list nor what remains would be that of the robot as
        written. Of two that cancel one another each closes much, and no fit shows it.
        """
        if self.outside_library:
            return False
        likely = self.probability >= NAMED or self.closes >= QUARTER or self.shown >= HALF
        return self.present >= PRESENT and likely and min(self.closes, self.shown) >= self.least

    @property
    def impossible(self) -> bool:
        """Whether it came out larger than any machine's: no robot can be written with it."""
        return any(
            abs(value) > LARGEST.get(item.unit, np.inf)
            for form, theta in zip(self.forms, self.theta, strict=True)
            for item, value in zip(form.shape.parameters, (theta * form.sizes).tolist(), strict=True)
        )

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows (from 0) at which a target slips; empty for other causes."""
        return tuple(slip_row(form.shape.name) for form in self.forms if form.effect == SLIP)


@dataclass(frozen=True)
class Decomposition:
    """The causes of a gap, those that close most first, and what remains.

    Attributes
    ----------
    model : OpenModel
    causes, unclear : tuple of Cause
        Those that are named, and those that are there but could as well be another.
    unmodelled : tuple of Cause
        Laws that no effect of the library has, `unmodelled_forms`: a part of the remainder.
    remainder : Remainder
        What those that are named leave.
    unexplained : float
        Share of the explainable gap that those that are unclear leave as well.
    rms, noise : float, m
        Held-out position gap of the open model without a cause, and the noise floor.
    change : (t,) array
        Of the open parameters, beside the causes.
    scatter : float
        What is left over the stated noise.
    bic : float
        Of the open model with the causes.
    largest : float
        Probability that the first cause closes more than the second, over the postures.
    hanging : tuple of Cause
        Those that were left out as they hang on a few postures.
    behind : tuple of Behind
        What encoders behind the gears say.
    apart : Apart
        Rows that stand apart from all others.
    first : tuple of str
        Rows that were left out as nobody knows from which side joints came that stop short, ``file:line``.
    mounting : Mounting or None
        Gravity that fits better than that of the robot file, where the causes leave more than noise.
    carrying : OpenModel or None
        The model with drives that carry errors of loads, where there are any.
    """

    model: OpenModel
    causes: tuple[Cause, ...]
    unclear: tuple[Cause, ...]
    unmodelled: tuple[Cause, ...]
    remainder: Remainder
    unexplained: float
    rms: float
    noise: float
    change: Array
    scatter: float
    bic: float
    largest: float
    hanging: tuple[Cause, ...] = ()
    behind: tuple[Behind, ...] = ()
    apart: Apart = field(default_factory=Apart)
    first: tuple[str, ...] = ()
    mounting: Mounting | None = None
    carrying: OpenModel | None = None

    @property
    def calibrated(self) -> OpenModel:
        """The model as it was calibrated beside the causes, errors of loads on its drives."""
        return self.carrying or self.model

    @property
    def every(self) -> tuple[Cause, ...]:
        """The causes that are named, and after them those that are unclear."""
        return (*self.causes, *self.unclear)

    @property
    def written(self) -> tuple[Cause, ...]:
        """Those that are written into the robot: `every`, and laws outside the library that have a name."""
        return (*self.every, *(law for law in self.unmodelled if not law.nameless))

    @property
    def closes(self) -> float:
        """Share of the explainable gap that all causes close together."""
        return sum(cause.closes for cause in self.causes)

    @property
    def left2(self) -> float:
        """Square of the held-out position gap that is left beside all causes, m^2."""
        return self.left2_by((*self.every, *self.unmodelled))

    def left2_by(self, causes: Iterable[Cause]) -> float:
        """Return the square of the held-out position gap that some causes leave, m^2."""
        return self.rms**2 - sum(cause.closes for cause in causes) * (self.rms**2 - self.noise**2)

    @property
    def law(self) -> Cause | None:
        """The law outside the library that explains a quarter or more, and more than any cause, if likely."""
        first = max(self.unmodelled, key=lambda one: one.closes, default=None)
        if first is None or first.probability < NAMED or first.closes < QUARTER:
            return None
        return first if all(one.closes <= first.closes for one in self.every) else None

    @property
    def gap_shows(self) -> bool:
        """Whether more is left without a cause than noise makes."""
        return self.scatter > NOISE or bool(self.every or self.unmodelled)

    @property
    def verdict(self) -> Cause | None:
        """The first cause, where it closes most of what can be closed."""
        if not self.causes:
            return None
        first, *others = (*self.every, *self.unmodelled)
        alone = first.closes >= QUARTER and all(cause.closes < MINOR for cause in others)
        return first if first.named and (first.closes >= HALF or alone) else None
