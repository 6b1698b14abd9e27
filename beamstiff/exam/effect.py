"""What an effect of the simulated machines is, and how its places and sizes are drawn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.laws import Law
from beamstiff.exam.machine import drives_of, joints_of, own_stiffness
from beamstiff.exam.placing import Placed, place, skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

WIDE = np.deg2rad(60.0)  # stroke to either side where a variable has no limits
LONG = 0.4  # m, likewise of a prismatic one
LARGE = 6.6e6  # N m/rad, axis 2 of a robot with 2.7 m reach (KUKA KR240-2)
SMALL = 6.0


@dataclass(frozen=True)
class DrawRequest:
    """What is to be drawn: the parameters of a form at a component, of a size in [0, 1]."""

    rng: np.random.Generator
    robot: Robot
    component: str | None
    form: str
    size: float

    def sized(self, low: float, high: float) -> float:
        """Return the value at the wanted size from low to high, evenly by ratio."""
        return between(self.size, low, high)

    def uniform(self, low: float, high: float) -> float:
        """Return a number drawn evenly between two."""
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """Return a number drawn evenly by ratio between two."""
        return between(float(self.rng.uniform()), low, high)

    def integer(self, low: int, high: int) -> float:
        """Return a whole number drawn from low to below high."""
        return float(self.rng.integers(low, high))

    def sign(self) -> float:
        """Return 1 or -1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def direction(self, length: float = 1.0, names: str = "xyz") -> dict[str, float]:
        """Return a vector of that length in a direction drawn evenly, by the names of its components."""
        v = self.rng.standard_normal(3)
        return named(length * (v / np.linalg.norm(v)), names)


@dataclass(frozen=True)
class Effect:
    """An effect that a simulated machine can have.

    `forms`: constitutive forms.
    `places`: components that the effect can sit at on a robot; none where it cannot.
    `draw`: parameters, none of which is a joint's own stiffness: that is the machine's.
    `impose`: A reality with the effect.
    `authors`: the forms by who wrote them, the first author's first; empty where all are the first author's.
    """

    name: str
    forms: tuple[str, ...]
    places: Callable[[Robot], Sequence[str | None]]
    draw: Callable[[DrawRequest], dict[str, float]]
    impose: Callable[[Truth, Reality], Reality]
    authors: tuple[tuple[str, ...], ...] = ()

    def draw_form(self, rng: np.random.Generator, authors: Sequence[int] = ()) -> str:
        """Return a form: of every author as often, or of these alone where one of them wrote any."""
        mine = [some for k, some in enumerate(self.authors, start=1) if some and k in authors]
        every = mine or [some for some in self.authors if some] or [self.forms]
        some = every[int(rng.integers(len(every)))]
        return some[int(rng.integers(len(some)))]

    def author_of(self, form: str) -> int:
        """Return who wrote a form: 1 for the first author."""
        return next((k for k, some in enumerate(self.authors, start=1) if form in some), 1)


def joined(first: Effect, *later: Effect | None) -> Effect:
    """Return an effect with the forms of several authors (None: that one wrote none)."""
    found = [first, *(effect for effect in later if effect is not None)]

    def of(form: str) -> Effect:
        return next(effect for effect in found if form in effect.forms)

    return Effect(
        first.name,
        tuple(form for effect in found for form in effect.forms),
        first.places,
        lambda request: of(request.form).draw(request),
        lambda truth, reality: of(truth.form).impose(truth, reality),
        tuple(() if effect is None else effect.forms for effect in (first, *later)),
    )


def between(size: float, low: float, high: float) -> float:
    """Return the value at `size` in [0, 1] of the way from low to high, evenly by ratio."""
    return float(low * (high / low) ** size)


def named(vector: Array, names: str = "xyz") -> dict[str, float]:
    """Return a vector (3,) as parameters."""
    return dict(zip(names, map(float, vector), strict=True))


def vector(parameters: Mapping[str, float], names: str = "xyz") -> Array:
    """Return the vector (3,) of parameters by these names."""
    return np.array([parameters[name] for name in names])


def nowhere(robot: Robot) -> list[str | None]:
    """Return the one place of effects that have no component."""
    return [None]


def drives(robot: Robot) -> list[str | None]:
    """Return the joints whose own direction is a spring."""
    return list(drives_of(robot))


def turning_drives(robot: Robot) -> list[str | None]:
    """Return the revolute drives that are actuated variables."""
    turning = {v.name for v in robot.actuated if v.type == "revolute"}
    return [name for name in drives_of(robot) if name in turning]


def stiffness_of(robot: Robot, component: str | None) -> float:
    """Return the stiffness of a component's (first) joint in its own direction, SI."""
    return own_stiffness(robot, *joints_of(robot, str(component))[0])


def turns(robot: Robot, component: str | None) -> bool:
    """Return whether a component's own direction is a rotation."""
    return joints_of(robot, str(component))[0][1] == 3


def stroke(robot: Robot, variable: str | None) -> tuple[float, float]:
    """Return the middle and half the width of a variable's range, rad or m."""
    found = next((v for v in robot.variables if v.name == variable), None)
    if found is None:
        return 0.0, float(WIDE)
    if found.limits is None:
        return found.guess, LONG if found.type == "prismatic" else float(WIDE)
    low, high = found.limits
    return 0.5 * (low + high), 0.5 * (high - low)


def drive_of(robot: Robot, component: str) -> str | None:
    """Return the actuated variable that a component is, or that turns its frame (``f3.d``)."""
    driven = [variable.name for variable in robot.actuated]
    if component in driven:
        return component
    frames = {name: parameters for name, _, parameters in skeleton_of(robot).frames}
    found = [c for e in frames.get(component.rsplit(".", 1)[0], {}).values() for c in e.coefficients]
    return next((name for name in found if name in driven), None)


def slender(robot: Robot) -> float:
    """Return by how much a robot's structure is softer than a large one's, from 1 for those to `SMALL`.

    Structure grows with the drives, less than they do: by the square root of the main axis' stiffness.
    """
    turning = [stiffness_of(robot, name) for name in drives_of(robot) if turns(robot, name)]
    return float(np.clip(np.sqrt(LARGE / max(turning)), 1.0, SMALL)) if turning else 1.0


def at_joints(truth: Truth, reality: Reality, law_of: Callable[[float], Law]) -> Reality:
    """Return the reality with a law, made from the joint's stiffness, in the component's own direction."""
    machine = reality.machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        machine = machine.with_law(name, own, law_of(own_stiffness(machine.robot, name, own)))
    return reality.with_machine(machine)


def in_the_middle(robot: Robot, **moved: float) -> Placed:
    """Return the robot in the middle of its range, one pose, with some variables moved from there."""
    q = np.array([[stroke(robot, v.name)[0] + moved.get(v.name, 0.0) for v in robot.actuated]])
    return place(skeleton_of(robot), q)
