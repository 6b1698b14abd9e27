"""What no name of the table covers: a hanger at the elbow, a floor that is loaded, couplings that bed in."""

import dataclasses
from functools import partial

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.components import nowhere, slender
from beamstiff.exam.draws import PHASE, around, by_ratio, by_reach, evenly, product, sized
from beamstiff.exam.effect import Seen, built, law, reading
from beamstiff.exam.laws import Law, Memory, Situation, fading, rubbing
from beamstiff.exam.machine import Machine, Rod, drives_of
from beamstiff.exam.parameters import DrawRequest, Parameters


def drum(pull: float, friction: float, arrived: float, reach: float) -> Law:
    """Return a hanger's rope: a nearly constant pull, N, and its drum's friction.

    The rope stretches until the drum turns, by Dahl's law: over a `reach`, m.
    """
    rope = rubbing(0.0, friction, arrived, partial(fading, reach=reach))

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        force, slope, after = rope.respond(strain, situation, memory)
        return pull + force, slope, after

    return dataclasses.replace(rope, respond=respond)


def bedding_in(p: Parameters, stiffness: float, _: str) -> Law:
    """Return a spring that keeps the softness of the largest strain it had, as filled rubber does (Mullins).

    First loading: ``k x (1 - softer (1 - exp(-|x| / from)))``; back and again: straight through the origin.
    """

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        size = np.abs(strain)
        most = np.maximum(memory[0], size)
        left = p["softer"] * np.exp(-most / p["from_"])
        k = stiffness * (1.0 - p["softer"] + left)
        softening = np.where(size >= memory[0], stiffness * left * size / p["from_"], 0.0)
        return k * strain, k - softening, (most,)

    return Law(respond, lambda poses: (np.zeros(poses),))


def _hang(p: Parameters, machine: Machine, _: str) -> Machine:
    elbow = machine.hinges[len(machine.robot.joints) // 2].nodes[0]
    (at,) = machine.places(elbow)
    at = at + np.array([p["aside"] * np.cos(p["way"]), p["aside"] * np.sin(p["way"]), p["above"]])
    machine, crane = machine.with_node("crane", "base", at, machine.fixed[0])
    law = drum(p["pull"], p["friction"], p["arrived"], p["reach"])
    return machine.plus(rods=(Rod(f"{crane} rope", (crane, elbow), 0.0, law),))


def _pull(request: DrawRequest) -> float:
    return request.sized(30.0, 2500.0) / slender(request.robot)


def _truck(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values on a floor that is loaded beside the robot during some of the rows: all of it tilts."""
    part = np.arange(len(values)) / len(values)
    there = (part >= p["from"]) & (part < p["from"] + p["lasts"])
    tilt = np.array([p["x"], p["y"], 0.0])
    moved = np.cross(tilt, seen.places) - np.array([0.0, 0.0, p["sinks"]])
    both = np.concatenate([moved, np.tile(tilt, (len(values), 1))], axis=1)
    return values + np.where(there[:, None], both, 0.0)


_TILT = sized(5e-6, 3e-4)
PLACES = {"elbow-hanger": nowhere, "loaded-floor": nowhere, "bedding-in": drives_of}
FORMS = (
    built("elbow-hanger", "rope-on-a-drum", _hang, pull=_pull,
          friction=product(_pull, evenly(0.1, 0.3)), reach=by_ratio(5e-5, 5e-4), arrived=evenly(-0.9, 0.9),
          aside=by_reach(evenly(0.0, 1.0)), way=PHASE, above=by_reach(evenly(1.0, 2.5))),
    reading("loaded-floor", "parked-truck", _truck, around(_TILT, "xy"),
            **{"from": evenly(0.1, 0.4), "lasts": evenly(0.2, 0.4)}, sinks=product(_TILT, evenly(0.2, 1.0))),
    law("bedding-in", "filled-rubber", bedding_in, softer=sized(0.02, 0.5), from_=by_ratio(3e-5, 2e-4)),
)  # fmt: skip
