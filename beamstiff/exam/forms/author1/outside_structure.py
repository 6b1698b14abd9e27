"""Effects outside the table that sit in the structure: loose bolts, play in bearings, and stops."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.forms.author1 import bearing_tilt
from beamstiff.exam.laws import Curve, WindUp
from beamstiff.exam.machine import axes_from, joints_of
from beamstiff.exam.pedestal import on_pedestal, tied_to_ground
from beamstiff.exam.reality import Reality

Curved = tuple[Array, Array]


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


EFFECTS = (
    Effect("loose-bolt", ("gaping",), nowhere, _draw_bolt, _bolt),
    Effect("bearing-play", ("tilting",), bearing_tilt.places, _draw_play, _play),
    Effect("tool-contact", ("one-sided",), nowhere, _draw_contact, _contact),
)
