"""Every effect at every component of a robot in all its shapes, as columns; and what the data cannot show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.effects import EFFECTS, Shape
from beamstiff.diagnosis.effects.torque_laws import component_of, drives
from beamstiff.diagnosis.prior import DEFAULT, Prior, key_of
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.se3 import Array

ABSORBED = 0.02  # share of a signature's size that the fitted parameters leave
OF_DRIVES = ("actuator-lever", "gravity-compensator")
NO_CAMERA = "no camera read these rows"
FAINT = 0.1  # sigma a value, at the largest realistic size
# weighed by `decomposition` alone; the last two are all drives at once
REVERSED = "approach-direction"
DECOMPOSED = ("angle-curve", REVERSED, "target-slip")
ALL_DRIVES, ALL_REVERSED = "joint-compliance:null", f"{REVERSED}:null"


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One shape of an effect at a component.

    `prior`: its share of all effects' prior probability.
    `columns`: (n, c) array; whitened, in realistic sizes.
    `places`: where the machine is compliant if this is true; none for what is outside it.
    """

    effect: str
    component: str | None
    shape: Shape
    prior: float
    columns: Array
    places: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """``effect:component``."""
        return key_of(self.effect, self.component)

    @property
    def sizes(self) -> Array:
        """Realistic sizes of the parameters, (c,)."""
        return np.array([quantity.size for quantity in self.shape.parameters])


@dataclass(frozen=True)
class Untestable:
    """A candidate that the data cannot show, and why."""

    effect: str
    component: str | None
    why: str


@dataclass(frozen=True)
class Library:
    """All hypotheses, and the candidates among them that the data cannot show."""

    hypotheses: tuple[Hypothesis, ...]
    untestable: tuple[Untestable, ...]


def build_library(baseline: Baseline, white: Whitened, prior: Prior = DEFAULT) -> Library:
    """Return what the data could be explained by.

    Raises BeamstiffError when `prior` names no effect, or a component that it cannot have on this robot.
    """
    check_names(baseline, prior)
    without = prior.without
    hypotheses: list[Hypothesis] = []
    untestable = []
    left_out = (*without, *DECOMPOSED)
    known = [one for one in EFFECTS.values() if not one.outside and one.name not in left_out]
    joints = {joint.name: component_of(baseline.nominal, joint) for joint in baseline.nominal.joints}
    held = {joints.get(name, name): why for name, why in baseline.places.held.items()}
    standing: tuple[str, ...] = ()
    if not {"base-compliance", key_of("base-compliance", None)} & set(without):
        standing = baseline.places.standing
    others = {*without, ALL_DRIVES, *(key_of("link-bending", name) for name in standing)}
    for effect in known:
        components = [c for c in effect.components(baseline) if key_of(effect.name, c) not in others]
        if not components:
            untestable.append(Untestable(effect.name, None, nowhere(effect.name, baseline)))
        for component in components:
            shapes = effect.shapes(baseline, component)
            if why := next((held[place] for place in effect.places(component) if place in held), ""):
                shapes = [shape for shape in shapes if shape.columns.any()]
                untestable += [] if shapes else [Untestable(effect.name, component, why)]
            elif not shapes and effect.name != "outliers":  # found by their rows, not by a shape
                untestable.append(Untestable(effect.name, component, "nothing of it is left to vary here"))
            total = sum(shape.weight for shape in shapes) * len(components) * len(known)
            hypotheses += [
                Hypothesis(
                    effect=effect.name,
                    component=component,
                    shape=shape,
                    prior=prior.ratio(effect.name, component) * shape.weight / total,
                    columns=np.zeros((0, len(shape.parameters))),
                    places=effect.places(component),
                )
                for shape in shapes
            ]
    if "link-bending" not in without:
        stands = "it stands on the ground: its compliance counts as base-compliance here"
        untestable += [Untestable("link-bending", name, stands) for name in standing]
    return seen_by(Library(tuple(hypotheses), tuple(untestable)), white)


def by_candidate(hypotheses: Sequence[Hypothesis]) -> dict[str, list[int]]:
    """Return where the shapes of each candidate stand among hypotheses, in their order."""
    result: dict[str, list[int]] = {}
    for at, one in enumerate(hypotheses):
        result.setdefault(one.key, []).append(at)
    return result


def seen_by(library: Library, white: Whitened) -> Library:
    """Return a library whitened anew, and what these data cannot show of it."""
    hypotheses = whitened(library.hypotheses, white)
    by_key = by_candidate(hypotheses)
    shapes = [[hypotheses[at] for at in places] for places in by_key.values()]
    hidden = [
        Untestable(some[0].effect, some[0].component, why) for some in shapes if (why := _hidden(some, white))
    ]
    never = [one for one in library.untestable if key_of(one.effect, one.component) not in by_key]
    return Library(hypotheses, (*never, *hidden))


def check_names(baseline: Baseline, prior: Prior) -> None:
    """Refuse a prior that names no effect, or a component that it cannot have under these rows."""
    for option, names in (("without", prior.without), ("prior", prior.given)):
        for name in names:
            effect, _, component = name.partition(":")
            if effect not in EFFECTS:
                hint = suggest(effect, EFFECTS) or f"; known: {listed(EFFECTS, len(EFFECTS))}"
                raise BeamstiffError(f"{option}: unknown effect {effect!r}{hint}")
            known = [key_of(effect, one).partition(":")[2] for one in EFFECTS[effect].components(baseline)]
            if component and component not in known:
                hint = suggest(component, known) or f"; it can be at {listed(known) or 'none'}"
                raise BeamstiffError(f"{option}: {effect} has no component {component!r} on this robot{hint}")


def whitened(hypotheses: Sequence[Hypothesis], white: Whitened) -> tuple[Hypothesis, ...]:
    """Return hypotheses with their columns whitened."""
    return tuple(replace(one, columns=white.whiten(one.shape.columns * one.sizes)) for one in hypotheses)


def _hidden(hypotheses: Sequence[Hypothesis], white: Whitened) -> str:
    """Return why none of the shapes of a candidate would show; empty when one would."""
    if not hypotheses:
        return ""
    size = np.array([np.sqrt((one.columns**2).sum()) for one in hypotheses])
    left = np.array([np.sqrt((white.project_out(one.columns) ** 2).sum()) for one in hypotheses])
    most = left * np.array([one.shape.prior_factor for one in hypotheses]) / np.sqrt(max(white.freedom, 1))
    if not size.any():
        return "these loads and postures do not excite it: choose others (beamstiff plan)"
    if (left < ABSORBED * size).all():
        return "the fitted stiffness absorbs it, so the fitted model already has it"
    if (most < FAINT).all():
        return f"too small to show: it moves no reading by more than {FAINT:g} of its noise"
    return ""


def nowhere(effect: str, baseline: Baseline) -> str:
    """Return why an effect has no component under these rows."""
    if effect in ("payload-error", *DECOMPOSED) and not baseline.absolute:
        return "displacements do not depend on it: measure absolute positions"
    if effect in ("camera-scale", "hand-eye"):
        return NO_CAMERA
    if effect == "angle-curve":
        return "no joint was at enough different angles or positions: measure more postures"
    if effect == "thermal-drift":
        timed, warm = (np.isfinite(one).any() for one in (baseline.rows.time, baseline.rows.temperature))
        if timed:
            return "time and temperature are the same in all rows: measure for longer"
        if warm:
            return "the temperature is the same in all rows, and there is no column t [s]: add it"
        return "the rows say neither when nor how warm: add a column t [s] or temperature [degC]"
    if effect == "joint-compliance":
        return (
            "the stiffness of every drive that a load turns is fitted already; to fit another joint, "
            "list it under `identify` in the robot file, or of a URDF: beamstiff convert IN "
            "--joint-stiffness NAME='1e6 N*m/rad' --out OUT"
        )
    if effect == "joint-coupling":
        return "fewer than two joints have a stiffness about their axes: add it to the robot file"
    if effect in OF_DRIVES and not drives(baseline):
        return "all joints are rigid about their axes: add a stiffness to the robot file"
    if not np.abs(baseline.rows.wrench).any():
        return "no row carries a load: measure with one"
    return "this robot has no such part"
