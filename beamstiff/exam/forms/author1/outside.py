"""Effects outside the table: in a drive, and in the structure (loose bolts, play in bearings, stops)."""

import dataclasses
import math
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import on_pedestal, tied_to_ground
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import nowhere, turns
from beamstiff.exam.draws import PHASE, SIGN, always, by_ratio, direction, evenly, sized
from beamstiff.exam.effect import Drive, built, built_at_joints, in_pose, law
from beamstiff.exam.laws import Curved, Law, Memory, Situation, curved, ramp, varying, winding
from beamstiff.exam.machine import Machine, axes_from, components_of, drives_of
from beamstiff.exam.parameters import Draw, Parameters, vector

FIRM, TILT = 2e-10, 1e-8  # rad/(N m): of a bolt that holds, of a bearing beyond its play
BLUNT = 2e-5  # m over which a stop is met


def _waves(low: float, high: float, per_metre: float) -> Draw:
    """Draw how often something waves on a turn, over 2 pi, or on a metre."""
    return lambda r: r.uniform(low, high) * (1.0 if turns(r.robot, r.component) else per_metre)


def _ripple(steep: bool, p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    wave = np.sin(p["waves"] * situation.value(drive.component) + p["phase"])
    wave = np.tanh(3.0 * wave) if steep else wave
    k = drive.k * np.exp(p["depth"] * wave)
    return k * e, k


def _warm_up(lagged: bool, p: Parameters, k: float, variable: str) -> Law:
    """Return a spring that warms up; `softer`: compliance gained, over that when cold."""

    def stiffness(situation: Situation) -> Array:
        time = situation.time
        warm = 1.0 - np.exp(-time / p["lag"]) if lagged else time / (time + p["lag"])
        return np.asarray(k / (1.0 + p["softer"] * warm))

    return varying(stiffness, changes=True)


def _toothed(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return a gear whose error of transmission runs on as it winds up: torque waves over the strain."""
    before = p["teeth"] * situation.value(drive.component) + p["phase"]
    wave = p["depth"] / p["teeth"] * (np.sin(before + p["teeth"] * e) - np.sin(before))
    slope = p["depth"] * np.cos(before + p["teeth"] * e)
    return drive.k * (e + wave), drive.k * (1.0 + slope)


def _creeping(p: Parameters, k: float, variable: str) -> Law:
    """Return a spring in series with Kelvin and Voigt's; `creep`: slow compliance over the prompt one."""

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        crept = memory[0]
        fade = np.exp(-situation.lasted / p["time"])
        # crept' = fade crept + (1 - fade) creep F / k,  F = k (strain - crept')
        share = (1.0 - fade) * p["creep"]
        force = k * (strain - fade * crept) / (1.0 + share)
        return force, k / (1.0 + share), (fade * crept + share * force / k,)

    return Law(respond, lambda poses: (np.zeros(poses),))


def _bolt(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine on a foot that opens about one axis; `blunt`: N m over which the gap opens."""
    machine = on_pedestal(machine, np.full(6, math.inf))

    def wind_up(moment: Array) -> Curved:
        root = np.sqrt(moment**2 + p["blunt"] ** 2)
        opened, share = 0.5 * (moment + root - p["blunt"]), 0.5 * (1.0 + moment / root)
        return p["firm"] * moment + p["tilt"] * opened, p["firm"] + p["tilt"] * share

    axes = axes_from(np.array([math.cos(p["angle"]), math.sin(p["angle"]), 0.0]))
    laws = {3: winding(wind_up, 1.0 / p["firm"])}
    return machine.with_hinge(dataclasses.replace(machine.hinges[-1], axes=axes, laws=laws))


def _play(p: Parameters, machine: Machine, joint: str, _: int) -> Machine:
    def wind_up(moment: Array) -> Curved:
        x = moment / p["crossing"]
        root = np.sqrt(1.0 + x**2)
        return p["tilt"] * moment + p["half"] * x / root, p["tilt"] + p["half"] / (p["crossing"] * root**3)

    law = winding(wind_up, 1.0 / p["tilt"])
    return machine.with_law(joint, 4, law).with_law(joint, 5, law)


def _stop(p: Parameters, machine: Machine, _: str) -> Machine:
    """Something at the tool that stops it one way."""

    def curve(e: Array) -> Curved:
        met, slope = ramp(p["way"] * e - p["gap"], BLUNT)
        rest = 0.5 * (math.hypot(p["gap"], BLUNT) - p["gap"])
        return p["way"] * p["stiffness"] * (met - rest), p["stiffness"] * slope

    return tied_to_ground(machine, "stop", vector(p), np.zeros(6), {0: curved(curve)})


PLACES = {
    **dict.fromkeys(("stiffness-ripple", "warm-up", "transmission-error", "creep"), drives_of),
    "loose-bolt": nowhere, "bearing-play": components_of, "tool-contact": nowhere,
}  # fmt: skip
_RIPPLE: dict[str, Draw] = {"depth": sized(0.08, 0.75), "waves": _waves(5.0, 12.0, 6.0), "phase": PHASE}
_WARMING: dict[str, Draw] = {"softer": sized(0.1, 3.0), "lag": evenly(600.0, 3000.0)}
FORMS = (
    in_pose("stiffness-ripple", "sine", partial(_ripple, False), **_RIPPLE),
    in_pose("stiffness-ripple", "steep", partial(_ripple, True), **_RIPPLE),
    law("warm-up", "lagged", partial(_warm_up, True), **_WARMING),
    law("warm-up", "slow", partial(_warm_up, False), **_WARMING),
    in_pose("transmission-error", "toothed", _toothed,
            teeth=_waves(300.0, 1500.0, 10.0), depth=sized(0.1, 0.9), phase=PHASE),
    law("creep", "kelvin-voigt", _creeping, creep=sized(0.08, 1.5), time=evenly(60.0, 400.0)),
    built("loose-bolt", "gaping", _bolt,
          tilt=sized(1.5e-8, 6e-7), firm=always(FIRM), angle=PHASE, blunt=evenly(30.0, 300.0)),
    built_at_joints("bearing-play", "tilting", _play,
                    half=sized(3e-5, 5e-4), crossing=by_ratio(20.0, 200.0), tilt=always(TILT)),
    built("tool-contact", "one-sided", _stop,
          direction(), stiffness=sized(2e5, 2e7), gap=evenly(0.0, 2e-4), way=SIGN),
)  # fmt: skip
