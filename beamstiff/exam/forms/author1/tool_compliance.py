"""Compliant flange, force sensor or gripper between the last joint and the TCP."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere
from beamstiff.exam.machine import Bar, Hinge, tapered
from beamstiff.exam.pedestal import behind_flange, free_name
from beamstiff.exam.reality import Reality
from beamstiff.robot.parts import Node

TURN = (3e-7, 1.2e-5)  # rad/(N m)


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the tilting compliance, rad/(N m), its distance behind the TCP, m, and the tool's shape."""
    found = {"tilt": request.sized(*TURN), "behind": request.uniform(0.02, 0.12)}
    found["about"] = request.uniform(0.3, 1.5)
    if request.form == "series":
        found |= {"share": request.uniform(0.2, 0.6), "other": request.uniform(0.6, 1.0)}
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a soft tool; its own axis is z of the TCP's frame."""
    machine, flange = behind_flange(reality.machine)
    p, tcp = truth.parameters, machine.node(machine.tcp)

    def node(behind: float) -> Node:
        at = (tcp.at[0], tcp.at[1], tcp.at[2] - behind)
        return Node(name=free_name(machine, "tool"), frame=tcp.frame, at=at)

    if truth.form == "cantilever":
        # two thirds behind the middle of a beam make a lever of half its length
        length = 2.0 * p["behind"]
        root = node(length)
        EI = length / p["tilt"]
        rigidity = EI * np.array([1 / 0.03**2, np.inf, np.inf, 1 / p["about"], 1.0, 1.0])
        bar = Bar("tool", (root.name, tcp.name), tapered(rigidity, lambda x: 1.15 - 0.3 * x), None)
        return reality.with_machine(
            machine.plus(nodes=(root,), rigids=(("tool root", (flange, root.name)),), bars=(bar,))
        )
    compliance = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    axes = np.eye(3)
    previous = flange
    for share, behind in ((p["share"], p["behind"]), (1.0 - p["share"], 0.4 * p["behind"])):
        first = node(behind)
        machine = machine.plus(nodes=(first,))
        second = node(behind)
        about = share * compliance
        k = np.concatenate([1.0 / (about * 0.05**2), 1.0 / about])
        machine = machine.plus(
            nodes=(second,),
            rigids=((f"to {first.name}", (previous, first.name)),),
            hinges=(Hinge(first.name, (first.name, second.name), tcp.frame, axes, k),),
        )
        previous = second.name
    tie = ("to the tip", (previous, tcp.name))
    return reality.with_machine(machine.plus(rigids=(tie,)))


EFFECT = Effect("tool-compliance", ("series", "cantilever"), nowhere, draw, impose)
