"""What no name of the table covers: a hanger at the elbow, a floor that is loaded, couplings that bed in."""

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.added_parts import free_name
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, at_joints, drives, in_the_middle, nowhere, slender
from beamstiff.exam.forms.author4.by_form import Form, effect_of
from beamstiff.exam.laws import Friction, Memory, Remembering, Situation, fading
from beamstiff.exam.machine import Rod
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality, places_of
from beamstiff.robot.parts import Node


@dataclass(frozen=True)
class Drum(Friction):
    """A hanger's rope: a nearly constant pull, and the friction of its drum, which the rope winds up first.

    `pull`: N.
    `reach`: m of rope over which the friction turns round.
    """

    pull: float
    reach: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state after a way: the rope stretches until the drum turns, by Dahl's law."""
        return fading(state, way, self.reach)

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent, and strain and state after."""
        force, slope, after = super().respond(strain, situation, memory)
        return self.pull + force, slope, after


@dataclass(frozen=True)
class BeddingIn(Remembering):
    """A spring that keeps the softness of the largest strain it had, as filled rubber does (Mullins).

    First loading: ``k x (1 - softer (1 - exp(-|x| / from)))``; back and again: straight through the origin.
    """

    stiffness: float
    softer: float
    from_: float

    def start(self, situation: Situation) -> Memory:
        """Return the largest strain so far: none."""
        return (np.zeros(len(situation.time)),)

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent, and the largest strain."""
        size = np.abs(strain)
        most = np.maximum(memory[0], size)
        left = self.softer * np.exp(-most / self.from_)
        k = self.stiffness * (1.0 - self.softer + left)
        softening = np.where(size >= memory[0], self.stiffness * left * size / self.from_, 0.0)
        return k * strain, k - softening, (most,)


def _hanger(request: DrawRequest) -> dict[str, float]:
    pull = request.sized(30.0, 2500.0) / slender(request.robot)
    return {
        "pull": pull,
        "friction": pull * request.uniform(0.1, 0.3),
        "reach": request.log_uniform(5e-5, 5e-4),
        "arrived": request.uniform(-0.9, 0.9),
        "aside": request.uniform(0.0, 1.0) / np.sqrt(slender(request.robot)),
        "way": request.uniform(0.0, 2.0 * np.pi),
        "above": request.uniform(1.0, 2.5) / np.sqrt(slender(request.robot)),
    }


def _hang(truth: Truth, reality: Reality) -> Reality:
    p, machine = dict(truth.parameters), reality.machine
    elbow = machine.hinges[len(machine.robot.joints) // 2].nodes[0]
    aside, way, above = (p.pop(name) for name in ("aside", "way", "above"))
    at = in_the_middle(machine.robot).node(machine.node(elbow))[0]
    at = at + np.array([aside * np.cos(way), aside * np.sin(way), above])
    crane = Node(name=free_name(machine, "crane"), at=tuple(map(float, at)))  # type: ignore[arg-type]
    law = Drum(stiffness=0.0, **p)
    return reality.with_machine(
        machine.plus(
            nodes=(crane,),
            rigids=((f"to {crane.name}", (machine.fixed[0], crane.name)),),
            rods=(Rod(f"{crane.name} rope", (crane.name, elbow), 0.0, law),),
        )
    )


def _truck(request: DrawRequest) -> dict[str, float]:
    way = request.uniform(0.0, 2.0 * np.pi)
    tilt = request.sized(5e-6, 3e-4)
    return {
        "from": request.uniform(0.1, 0.4),
        "lasts": request.uniform(0.2, 0.4),
        "tilt_x": tilt * float(np.cos(way)),
        "tilt_y": tilt * float(np.sin(way)),
        "sinks": tilt * request.uniform(0.2, 1.0),
    }


def _stand(truth: Truth, reality: Reality) -> Reality:
    """Return the reality whose floor is loaded beside the robot during some of the rows: all of it tilts."""
    p = truth.parameters

    def change(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        part = np.arange(len(campaign)) / len(campaign)
        there = (part >= p["from"]) & (part < p["from"] + p["lasts"])
        here = places_of(reality.machine, campaign.point, placed)
        tilt = np.array([p["tilt_x"], p["tilt_y"], 0.0])
        moved = np.cross(tilt, here) - np.array([0.0, 0.0, p["sinks"]])
        both = np.concatenate([moved, np.tile(tilt, (len(here), 1))], axis=1)
        return values + np.where(there[:, None], both, 0.0)

    return reality.with_reading(change)


def _first(request: DrawRequest) -> dict[str, float]:
    return {"softer": request.sized(0.02, 0.5), "from_": request.log_uniform(3e-5, 2e-4)}


def _bed_in(truth: Truth, reality: Reality) -> Reality:
    return at_joints(truth, reality, lambda k: BeddingIn(k, **truth.parameters))


EFFECTS = (
    effect_of("elbow-hanger", nowhere, {"rope-on-a-drum": Form(_hanger, _hang)}),
    effect_of("loaded-floor", nowhere, {"parked-truck": Form(_truck, _stand)}),
    effect_of("bedding-in", drives, {"filled-rubber": Form(_first, _bed_in)}),
)
