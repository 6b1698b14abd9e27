"""Mass or centre of gravity of tool or payload that differ from the model's."""

from __future__ import annotations

import dataclasses

import numpy as np

from beamstiff.exam.campaign import Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.reality import Reality
from beamstiff.robot.parts import Mass

MASS = (1.5, 60.0)  # kg
AWAY = (8e-3, 0.25)  # m


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the mass that the model lacks, kg, and how far its centre is off, m, in the TCP's frame."""
    payload = sum(mass.mass for mass in request.robot.masses if mass.node == request.robot.tcp)
    more = request.sized(*MASS) * request.sign() if request.form != "centre" else 0.0
    if more < -0.8 * payload:
        more = -more
    away = request.sized(*AWAY) if request.form == "centre" and payload else 0.0
    if request.form == "centre" and not payload:
        more = request.sized(*MASS)
    if request.form == "both" or (request.form == "centre" and not payload):
        away = request.uniform(0.03, 0.15)
    return {"mass": more} | request.direction(away)


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with another payload."""
    p, machine = truth.parameters, reality.machine
    away = vector(p)
    carried = [mass for mass in machine.masses if mass.node == machine.tcp]
    rest = [mass for mass in machine.masses if mass.node != machine.tcp]
    kilograms = sum(mass.mass for mass in carried)
    centre = sum((mass.mass * np.array(mass.at) for mass in carried), np.zeros(3)) / (kilograms or 1.0)
    at = tuple(map(float, centre + away))
    payload = Mass(node=machine.tcp, mass=kilograms + p["mass"], at=at)  # type: ignore[arg-type]
    return reality.with_machine(dataclasses.replace(machine, masses=(*rest, payload)))


EFFECT = Effect("payload-error", ("mass", "centre", "both"), nowhere, draw, impose)
