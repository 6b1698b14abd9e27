"""What really happens in a campaign, and effects: the forms in which they change it."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.components import Places
from beamstiff.exam.laws import Curved, Law, Situation, curved, posed, winding
from beamstiff.exam.machine import Machine, joints_of, own_stiffness
from beamstiff.exam.parameters import Draw, DrawRequest, Parameters
from beamstiff.exam.placing import Placed
from beamstiff.robot.description import Robot

# from the campaign, the machine placed at its rows, and (N, 6): wrenches as read, or values as they are
RowChange = Callable[[SimulatedCampaign, Placed, Array], Array]
EncoderChange = Callable[[Array], Array]  # where the drives are, (P, A), from what their encoders read


@dataclass(frozen=True, eq=False)
class Reality:
    """A machine and a campaign on it as they really are; places beside nodes in the frames of these."""

    machine: Machine
    geometry: Mapping[str, float] = field(default_factory=dict)  # rad or m: errors by name: ``f3.d``, ``q2``
    loads: tuple[RowChange, ...] = ()
    readings: tuple[RowChange, ...] = ()
    encoders: tuple[EncoderChange, ...] = ()  # errors of encoders that change with the angle
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: from the load's node to where it acts
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: from the node read to the true reflector
    marked: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: the same where absolute positions are read

    def with_machine(self, machine: Machine) -> Self:
        """Return the same with another machine."""
        return dataclasses.replace(self, machine=machine)

    def with_errors(self, errors: Mapping[str, float]) -> Self:
        """Return the same with errors added to the geometry."""
        more = {name: self.geometry.get(name, 0.0) + error for name, error in errors.items()}
        return dataclasses.replace(self, geometry={**self.geometry, **more})

    def with_encoder(self, variable: str, error: Callable[[Array], Array]) -> Self:
        """Return the same with one more error of an encoder, from what it reads (P,)."""
        at = [v.name for v in self.machine.robot.actuated].index(variable)

        def change(q: Array) -> Array:
            moved = q.copy()
            moved[:, at] += error(q[:, at])
            return moved

        return dataclasses.replace(self, encoders=(*self.encoders, change))


def places_of(machine: Machine, nodes: NDArray[np.str_], placed: Placed) -> Array:
    """Return where the node of every row is, (N, 3), m, on the placed machine."""
    places = np.empty((len(nodes), 3))
    for name in np.unique(nodes):
        rows = nodes == name
        places[rows] = placed.node(machine.node(str(name)))[rows]
    return places


def axes_of(machine: Machine, nodes: NDArray[np.str_], placed: Placed) -> Array:
    """Return the axes of the frame of every row's node, (N, 3, 3), on the placed machine."""
    frames = [machine.node(str(name)).frame for name in nodes]
    return np.stack([placed.rotations[frame][row] for row, frame in enumerate(frames)])


Impose = Callable[[Truth, Reality], Reality]  # a reality with the effect


@dataclass(frozen=True)
class Form:
    """A constitutive form of an effect."""

    effect: str
    name: str
    draw: Callable[[DrawRequest], dict[str, float]]  # parameters; a joint's own stiffness is the machine's
    impose: Impose


def form(effect: str, name: str, impose: Impose, *draws: Draw, **by_name: Draw) -> Form:
    """Return a form whose parameters are drawn in this order."""
    return Form(effect, name, lambda request: request.drawn(*draws, **by_name), impose)


def at_joints(truth: Truth, reality: Reality, law_of: Callable[[float], Law]) -> Reality:
    """Return the reality with a law, made from the joint's stiffness, in the component's own direction."""
    machine = reality.machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        machine = machine.with_law(name, own, law_of(own_stiffness(machine.robot, name, own)))
    return reality.with_machine(machine)


LawOf = Callable[[Parameters, float, str], Law]  # from parameters, the joint's stiffness and the component


def law(effect: str, name: str, of: LawOf, *draws: Draw, **by_name: Draw) -> Form:
    """Return a form that is a law in a component's own direction."""

    def impose(truth: Truth, reality: Reality) -> Reality:
        return at_joints(truth, reality, lambda k: of(truth.parameters, k, str(truth.component)))

    return form(effect, name, impose, *draws, **by_name)


Spring = Callable[[Parameters, float, Array], Curved]  # from parameters, the joint's stiffness and (P,)


def curve(effect: str, name: str, of: Spring, *draws: Draw, **by_name: Draw) -> Form:
    """Return a form that is a spring's force and slope at a strain."""
    return law(effect, name, lambda p, k, _: curved(partial(of, p, k)), *draws, **by_name)


def wind_up(effect: str, name: str, of: Spring, *draws: Draw, **by_name: Draw) -> Form:
    """Return a form that is a strain and compliance at a force, `hard`, or 1 + `gain`, of k at most."""

    def law_of(p: Parameters, k: float, _: str) -> Law:
        return winding(partial(of, p, k), k * p.get("hard", 1.0 + p.get("gain", 0.0)))

    return law(effect, name, law_of, *draws, **by_name)


@dataclass(frozen=True, eq=False)
class Drive:
    """A joint in its own direction: the robot, the component and its stiffness, SI."""

    robot: Robot
    component: str
    k: float


PosedSpring = Callable[[Parameters, Drive, Array, Situation], Curved]


def in_pose(effect: str, name: str, of: PosedSpring, *draws: Draw, **by_name: Draw) -> Form:
    """Return a form that is a drive's force and slope at a strain in a situation."""

    def impose(truth: Truth, reality: Reality) -> Reality:
        robot, component = reality.machine.robot, str(truth.component)
        return at_joints(
            truth, reality, lambda k: posed(partial(of, truth.parameters, Drive(robot, component, k)))
        )

    return form(effect, name, impose, *draws, **by_name)


MachineOf = Callable[..., Machine]  # from parameters, the machine, and where the effect sits


def built(effect: str, name: str, of: MachineOf, *draws: Draw, **by_name: Draw) -> Form:
    """Return a form that changes the machine's parts, from parameters, machine and component."""

    def impose(truth: Truth, reality: Reality) -> Reality:
        return reality.with_machine(of(truth.parameters, reality.machine, str(truth.component)))

    return form(effect, name, impose, *draws, **by_name)


def built_at_joints(effect: str, name: str, of: MachineOf, *draws: Draw, **by_name: Draw) -> Form:
    """Return the same, from parameters, machine, each joint of the component and its own direction."""

    def change(p: Parameters, machine: Machine, component: str) -> Machine:
        for joint, own in joints_of(machine.robot, component):
            machine = of(p, machine, joint, own)
        return machine

    return built(effect, name, change, *draws, **by_name)


@dataclass(frozen=True, eq=False)
class Seen:
    """A campaign, and the machine placed at its rows, as loads and readings find them."""

    machine: Machine
    campaign: SimulatedCampaign
    placed: Placed
    component: str | None

    @property
    def absolute(self) -> bool:
        """Whether absolute positions are read."""
        return self.campaign.kind == "absolute"

    @property
    def places(self) -> Array:
        """Where the measured node of every row is, (N, 3), m."""
        return places_of(self.machine, self.campaign.point, self.placed)

    @property
    def load_axes(self) -> Array:
        """The axes of the loaded node of every row, (N, 3, 3)."""
        return axes_of(self.machine, self.campaign.load_point, self.placed)

    @property
    def tool_axes(self) -> Array:
        """The tool's axes in every row, (N, 3, 3)."""
        return self.placed.rotations[self.machine.node(self.machine.tcp).frame]

    def with_arm(self, wrench: Array, arm: Array) -> Array:
        """Return wrenches of which those on the TCP act beside it, by an arm (N, 3)."""
        at_tcp = (self.campaign.load_point == self.machine.tcp)[:, None]
        moment = np.where(at_tcp, np.cross(arm, wrench[:, :3]), 0.0)
        return np.concatenate([wrench[:, :3], wrench[:, 3:] + moment], axis=1)


Change = Callable[[Parameters, Seen, Array], Array]  # of values or wrenches (N, 6)


def _changing(what: str, effect: str, name: str, change: Change, *draws: Draw, **by_name: Draw) -> Form:
    def impose(truth: Truth, reality: Reality) -> Reality:
        def changed(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
            return change(truth.parameters, Seen(reality.machine, campaign, placed, truth.component), values)

        changes: dict[str, Any] = {what: (*getattr(reality, what), changed)}
        return dataclasses.replace(reality, **changes)

    return form(effect, name, impose, *draws, **by_name)


reading = partial(_changing, "readings")  # a form that changes the values read
load = partial(_changing, "loads")  # a form that changes the wrenches, from what they are read as


@dataclass(frozen=True)
class Effect:
    """An effect that a simulated machine can have."""

    name: str
    places: Places  # components that the effect can sit at on a robot; none where it cannot
    authors: tuple[tuple[Form, ...], ...]  # the forms of each author, the first one's first

    @property
    def forms(self) -> dict[str, Form]:
        """The forms by name."""
        return {form.name: form for forms in self.authors for form in forms}

    def draw_form(self, rng: np.random.Generator, authors: Sequence[int] = ()) -> str:
        """Return a form: of every author as often, or of these alone where one of them wrote any."""
        mine = [some for k, some in enumerate(self.authors, start=1) if some and k in authors]
        every = mine or [some for some in self.authors if some]
        some = every[int(rng.integers(len(every)))]
        return some[int(rng.integers(len(some)))].name

    def author_of(self, form: str) -> int:
        """Return who wrote a form: 1 for the first author."""
        return next(k for k, some in enumerate(self.authors, start=1) if form in [one.name for one in some])
