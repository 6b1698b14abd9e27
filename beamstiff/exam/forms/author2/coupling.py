"""Further forms of coupling between two drives: a belt, eccentric gears, a bracket that both hang on."""

from __future__ import annotations

import dataclasses

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, stiffness_of
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.forms.author2.springs import slackening
from beamstiff.exam.laws import Curve, Law, Situation, Stiffness
from beamstiff.exam.machine import Cross, Mesh, joints_of
from beamstiff.exam.reality import Reality


def _draw(request: DrawRequest) -> dict[str, float]:
    found = {
        "share": request.sign() * request.sized(*author1.SHARE),
        "ratio": request.uniform(0.6, 1.6),
    }
    if request.form == "belt":
        found["slack"] = request.log_uniform(1e-4, 1e-3)  # strain where a strand is slack
    if request.form == "eccentric":
        found |= {"depth": request.uniform(0.3, 0.8), "phase": request.uniform(0.0, 2.0 * np.pi)}
    return found


def _impose(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    names = str(truth.component).split("+")
    first, second = (stiffness_of(machine.robot, name) for name in names)
    one, two = (joints_of(machine.robot, name)[0] for name in names)
    # with equal weights a spring of this over the first drive's stiffness couples by the wanted share
    strong = abs(p["share"]) / (1.0 - abs(p["share"]))
    if truth.form == "bracket":
        gives = np.array([1.0, np.sign(p["share"]) * p["ratio"] * np.sqrt(first / second)])
        soft = np.diag([1.0 / first, 1.0 / second]) + strong / first * np.outer(gives, gives)
        added = np.asarray(np.linalg.inv(soft) - np.diag([first, second]), dtype=np.float64)
        crosses = (*machine.crosses, Cross(one, two, added))
        return reality.with_machine(dataclasses.replace(machine, crosses=crosses))
    weights = (1.0, float(-np.sign(p["share"]) * p["ratio"] * np.sqrt(second / first)))

    def meshing(situation: Situation) -> Array:
        wave = np.sin(situation.values[names[0]] + p["phase"])
        return np.asarray(strong * first * (1.0 + p["depth"] * wave))

    law: Law = (
        Curve(lambda e: slackening(e, strong * first, 0.5, p["slack"]))
        if truth.form == "belt"
        else Stiffness(meshing)
    )
    mesh = Mesh(one, two, weights, law)
    return reality.with_machine(machine.plus(meshes=(mesh,)))


EFFECTS = (
    Effect("joint-coupling", ("belt", "eccentric", "bracket"), author1.coupled_drives, _draw, _impose),
)
