"""Third forms of coupling between two drives: a rod between two cranks, and bevel gears."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, stiffness_of, stroke
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.forms.author2.springs import hertzian
from beamstiff.exam.laws import Law, Situation, Stiffness, WindUp
from beamstiff.exam.machine import Mesh, Weight, joints_of
from beamstiff.exam.reality import Reality

SERVED = np.deg2rad(70.0)  # to either side: what a crank can turn before its rod stands across
LINEAR = 0.4  # share of the shafts, which are linear, in what bevel gears give at first


def _draw(request: DrawRequest) -> dict[str, float]:
    found = {
        "share": request.sign() * request.sized(*author1.SHARE),
        "ratio": request.uniform(0.6, 1.6),
    }
    if request.form == "linkage":
        return found | {"start": request.uniform(-0.3, 0.3)}  # rad from the longest lever
    return found | {"preload": request.log_uniform(2e-5, 3e-4)}  # strain


def _impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the two joints linked.

    ``linkage``: a rod from before the first axis, where its motor sits, to a crank on the second, as in
    palletisers; its lever on the second axis swings as the cosine of the crank's angle, and the coupling with
    it. Known from robots with a parallel rod (ABB IRB 6400, KUKA palletisers); sizes are an estimate.

    ``bevel``: bevel gears of a wrist pass torque between the axes, and their teeth grow stiffer with it as
    contacts after Hertz do. Known from hollow wrists with three shafts; sizes are an estimate.
    """
    p, machine = truth.parameters, reality.machine
    names = str(truth.component).split("+")
    first, second = (stiffness_of(machine.robot, name) for name in names)
    one, two = (joints_of(machine.robot, name)[0] for name in names)
    # with equal weights a spring of this over the first drive's stiffness couples by the wanted share
    strong = abs(p["share"]) / (1.0 - abs(p["share"])) * first
    equal = float(-np.sign(p["share"]) * p["ratio"] * np.sqrt(second / first))

    def swinging(situation: Situation) -> Array:
        middle, half = stroke(machine.robot, names[1])
        geared = min(1.0, SERVED / half)
        return np.asarray(equal * np.cos(p["start"] + geared * (situation.values[names[1]] - middle)))

    def teeth(torque: Array) -> tuple[Array, Array]:
        given, slope = hertzian(torque, strong * p["preload"])
        return (LINEAR * torque + (1.0 - LINEAR) * given) / strong, (LINEAR + (1.0 - LINEAR) * slope) / strong

    weight: Weight = swinging if truth.form == "linkage" else equal
    law: Law = WindUp(teeth, strong / LINEAR)
    if truth.form == "linkage":
        law = Stiffness(lambda situation: np.full(len(situation.time), strong))
    mesh = Mesh(one, two, (1.0, weight), law)
    return reality.with_machine(machine.plus(meshes=(mesh,)))


EFFECTS: tuple[Effect, ...] = (
    Effect("joint-coupling", ("linkage", "bevel"), author1.coupled_drives, _draw, _impose),
)
