"""Effects outside the table: in a drive, and in the structure (loose bolts, play in bearings, stops)."""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.added_parts import on_pedestal, tied_to_ground
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, nowhere, stiffness_of, turns, vector
from beamstiff.exam.forms.author1.structure import bearings
from beamstiff.exam.laws import Curve, Forgetful, Memory, Remembering, Situation, Stiffness, WindUp
from beamstiff.exam.machine import axes_from, joints_of
from beamstiff.exam.reality import Reality

Curved = tuple[Array, Array]


def _draw_ripple(request: DrawRequest) -> dict[str, float]:
    per_metre = 1.0 if turns(request.robot, request.component) else 6.0
    return {
        "depth": request.sized(0.08, 0.75),
        "waves": per_metre * request.uniform(5.0, 12.0),  # a rad or m, over 2 pi of the sine
        "phase": request.uniform(0.0, 2 * np.pi),
    }


def _ripple(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, truth.component
    k = stiffness_of(reality.machine.robot, variable)

    def stiffness(situation: Situation) -> Array:
        wave = np.sin(p["waves"] * situation.value(str(variable)) + p["phase"])
        wave = wave if truth.form == "sine" else np.tanh(3.0 * wave)
        return np.asarray(k * np.exp(p["depth"] * wave))

    return at_joints(truth, reality, lambda _: Stiffness(stiffness))


def _draw_warm_up(request: DrawRequest) -> dict[str, float]:
    return {
        "softer": request.sized(0.1, 3.0),  # compliance gained, over that when cold
        "lag": request.uniform(600.0, 3000.0),
    }


def _warm_up(truth: Truth, reality: Reality) -> Reality:
    p, k = truth.parameters, stiffness_of(reality.machine.robot, truth.component)

    def stiffness(situation: Situation) -> Array:
        time = situation.time
        warm = 1.0 - np.exp(-time / p["lag"]) if truth.form == "lagged" else time / (time + p["lag"])
        return np.asarray(k / (1.0 + p["softer"] * warm))

    return at_joints(truth, reality, lambda _: Stiffness(stiffness, changes=True))


def _draw_transmission(request: DrawRequest) -> dict[str, float]:
    teeth = request.uniform(300.0, 1500.0) * (1.0 if turns(request.robot, request.component) else 10.0)
    return {
        "teeth": teeth,
        "depth": request.sized(0.1, 0.9),  # of the tangent
        "phase": request.uniform(0.0, 2 * np.pi),
    }


@dataclass(frozen=True)
class Toothed(Forgetful):
    """A gear whose error of transmission runs on as it winds up: torque waves over the strain."""

    stiffness: float
    teeth: float
    depth: float
    phase: float
    variable: str

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent and no memory."""
        before = self.teeth * situation.value(self.variable) + self.phase
        wave = self.depth / self.teeth * (np.sin(before + self.teeth * strain) - np.sin(before))
        slope = self.depth * np.cos(before + self.teeth * strain)
        return self.stiffness * (strain + wave), self.stiffness * (1.0 + slope), memory


def _transmission(truth: Truth, reality: Reality) -> Reality:
    p, k = truth.parameters, stiffness_of(reality.machine.robot, truth.component)
    law = Toothed(k, p["teeth"], p["depth"], p["phase"], str(truth.component))
    return at_joints(truth, reality, lambda _: law)


def _draw_creep(request: DrawRequest) -> dict[str, float]:
    return {
        "creep": request.sized(0.08, 1.5),  # slow compliance over the prompt one
        "time": request.uniform(60.0, 400.0),
    }


@dataclass(frozen=True)
class Creeping(Remembering):
    """A spring in series with a spring and damper side by side (Kelvin and Voigt)."""

    stiffness: float
    creep: float
    time: float

    def start(self, situation: Situation) -> Memory:
        """Return the crept strain at rest."""
        return (np.zeros(len(situation.time)),)

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent and the crept strain after the state has lasted."""
        crept = memory[0]
        fade = np.exp(-situation.lasted / self.time)
        # crept' = fade crept + (1 - fade) creep F / k,  F = k (strain - crept')
        share = (1.0 - fade) * self.creep
        force = self.stiffness * (strain - fade * crept) / (1.0 + share)
        return force, self.stiffness / (1.0 + share), (fade * crept + share * force / self.stiffness,)


def _creep(truth: Truth, reality: Reality) -> Reality:
    p, k = truth.parameters, stiffness_of(reality.machine.robot, truth.component)
    return at_joints(truth, reality, lambda _: Creeping(k, p["creep"], p["time"]))


def _draw_bolt(request: DrawRequest) -> dict[str, float]:
    return {
        "tilt": request.sized(1.5e-8, 6e-7),
        "firm": 2e-10,
        "angle": request.uniform(0.0, 2.0 * math.pi),
        "blunt": request.uniform(30.0, 300.0),  # N m over which the gap opens
    }


def _bolt(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    machine = on_pedestal(reality.machine, np.full(6, math.inf))

    def wind_up(moment: Array) -> Curved:
        root = np.sqrt(moment**2 + p["blunt"] ** 2)
        opened, share = 0.5 * (moment + root - p["blunt"]), 0.5 * (1.0 + moment / root)
        return p["firm"] * moment + p["tilt"] * opened, p["firm"] + p["tilt"] * share

    foot = machine.hinges[-1]
    axes = axes_from(np.array([math.cos(p["angle"]), math.sin(p["angle"]), 0.0]))
    foot = dataclasses.replace(foot, axes=axes, laws={3: WindUp(wind_up, 1.0 / p["firm"])})
    return reality.with_machine(machine.with_hinge(foot))


def _draw_play(request: DrawRequest) -> dict[str, float]:
    return {"half": request.sized(3e-5, 5e-4), "crossing": request.log_uniform(20.0, 200.0), "tilt": 1e-8}


def _play(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine

    def wind_up(moment: Array) -> Curved:
        x = moment / p["crossing"]
        root = np.sqrt(1.0 + x**2)
        return p["tilt"] * moment + p["half"] * x / root, p["tilt"] + p["half"] / (p["crossing"] * root**3)

    for name, _ in joints_of(machine.robot, str(truth.component)):
        hinge = machine.hinge(name)
        law = WindUp(wind_up, 1.0 / p["tilt"])
        machine = machine.with_hinge(dataclasses.replace(hinge, laws={**hinge.laws, 4: law, 5: law}))
    return reality.with_machine(machine)


def _draw_contact(request: DrawRequest) -> dict[str, float]:
    found = request.direction()
    return found | {
        "stiffness": request.sized(2e5, 2e7),  # N/m
        "gap": request.uniform(0.0, 2e-4),
        "way": request.sign(),
    }


def _contact(truth: Truth, reality: Reality) -> Reality:
    """Something at the tool that stops it one way."""
    p, blunt = truth.parameters, 2e-5

    def curve(e: Array) -> Curved:
        z = p["way"] * e - p["gap"]
        root = np.sqrt(z**2 + blunt**2)
        rest = 0.5 * (math.hypot(p["gap"], blunt) - p["gap"])
        return (
            p["way"] * p["stiffness"] * (0.5 * (z + root) - rest),
            p["stiffness"] * 0.5 * (1.0 + z / root),
        )

    stopped = tied_to_ground(reality.machine, "stop", vector(p), np.zeros(6), {0: Curve(curve)})
    return reality.with_machine(stopped)


EFFECTS: tuple[Effect, ...] = (
    Effect("stiffness-ripple", ("sine", "steep"), drives, _draw_ripple, _ripple),
    Effect("warm-up", ("lagged", "slow"), drives, _draw_warm_up, _warm_up),
    Effect("transmission-error", ("toothed",), drives, _draw_transmission, _transmission),
    Effect("creep", ("kelvin-voigt",), drives, _draw_creep, _creep),
    Effect("loose-bolt", ("gaping",), nowhere, _draw_bolt, _bolt),
    Effect("bearing-play", ("tilting",), bearings, _draw_play, _play),
    Effect("tool-contact", ("one-sided",), nowhere, _draw_contact, _contact),
)
