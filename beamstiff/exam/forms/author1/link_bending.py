"""Links that bend: rigid in the model, or stiffer there than they are."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, between, in_the_middle, slender
from beamstiff.exam.machine import Bar, Machine, Profile, bodies_of, machine_of, tapered
from beamstiff.exam.pedestal import node_at
from beamstiff.exam.placing import skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

SHORTEST = 0.02  # m
SOFTEST, STIFFEST = 3e6, 6e7  # N m^2, of a large robot


def places(robot: Robot) -> list[str | None]:
    """Return the beams, and the rigids that have a length and carry load.

    Not those that stand on the ground: they are the base by another name.
    """
    machine, placed = machine_of(robot), in_the_middle(robot)
    ground = {"base"}
    for name, parent, parameters in skeleton_of(robot).frames:  # parents first
        if parent in ground and not any(expression.coefficients for expression in parameters.values()):
            ground.add(name)
    standing = {node.name for node in machine.nodes if node.frame in ground}
    found: list[str | None] = [bar.name for bar in machine.bars if not standing.issuperset(bar.nodes)]
    for name, nodes in machine.rigids:
        if standing.issuperset(nodes):
            continue
        a, b = (placed.node(machine.node(n))[0] for n in nodes)
        if np.linalg.norm(b - a) > SHORTEST and _carries(machine, name, nodes):
            found.append(name)
    return found


def _carries(machine: Machine, name: str, nodes: tuple[str, str]) -> bool:
    """Return whether load passes a rigid: it parts its body, and what it parts holds the tool or a loop."""
    rest = machine.without(name)
    body = bodies_of(rest)
    if body[nodes[0]] == body[nodes[1]]:
        return False
    ties = rest.ties
    held = set(rest.fixed)
    for _ in machine.nodes:
        held |= {n for tie in ties if held & set(tie) for n in tie}
    return machine.tcp not in held or set(nodes) <= held


def draw(request: DrawRequest) -> dict[str, float]:
    """Return E I at the thick end, N m^2 (or by what factor a beam is softer), and the link's shape."""
    shape = {"flat": request.uniform(0.5, 1.0), "twist": request.uniform(0.4, 0.9)}
    if any(beam.name == request.component for beam in request.robot.beams):
        return {"softer": request.sized(1.1, 4.0), "taper": request.uniform(0.2, 0.5)}
    shape["EI"] = between(1.0 - request.size, SOFTEST, STIFFEST) / slender(request.robot)
    if request.form == "tapered":
        return shape | {"taper": request.uniform(0.2, 0.5)}
    if request.form == "hinged":
        return shape | {"first": request.uniform(0.0, 0.3), "second": request.uniform(0.5, 0.9)}
    return shape | {"offset": request.uniform(0.05, 0.2), "side": request.uniform(0.0, 2 * np.pi)}


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the link bending."""
    machine, p = reality.machine, truth.parameters
    if "softer" in p:
        bars = tuple(_softer(bar, p) if bar.name == truth.component else bar for bar in machine.bars)
        return reality.with_machine(dataclasses.replace(machine, bars=bars))
    nodes = next(nodes for name, nodes in machine.rigids if name == truth.component)
    rigidity = p["EI"] * np.array([1 / 0.12**2, np.inf, np.inf, p["twist"], p["flat"], 1.0])
    machine = machine.without(str(truth.component))
    up = up_of(machine, nodes)
    if truth.form == "elbow":
        halves = _elbow(machine, str(truth.component), nodes, rigidity, p["offset"], p["side"])
        return reality.with_machine(halves)
    profile = (
        tapered(rigidity, lambda x: 1.0 - p["taper"] * x)
        if truth.form == "tapered"
        else _hinged(rigidity, p["first"], p["second"])
    )
    return reality.with_machine(machine.plus(bars=(Bar(str(truth.component), nodes, profile, up),)))


def up_of(machine: Machine, nodes: tuple[str, str]) -> Array:
    """Return a direction across the link in the frame of its first node: its section turns with it."""
    placed = in_the_middle(machine.robot)
    a, b = (placed.node(machine.node(n))[0] for n in nodes)
    up = np.eye(3)[np.argmin(np.abs(b - a))]
    fixed: Array = placed.rotations[machine.node(nodes[0]).frame][0].T @ up
    return fixed


def _softer(bar: Bar, p: Mapping[str, float]) -> Bar:
    swell = (1.0 - p["taper"] * bar.profile.stations) ** -3
    swell = swell * p["softer"] / np.average(swell, weights=bar.profile.compliance[:, 0])
    profile = Profile(bar.profile.stations, bar.profile.compliance * swell[:, None])
    return dataclasses.replace(bar, profile=profile)


def _hinged(rigidity: Array, first: float, second: float) -> Profile:
    """Two places that bend, in a link that is stiff elsewhere (a hollow casting with flanges)."""
    with np.errstate(divide="ignore"):
        compliance = 1.0 / rigidity
    return Profile(np.array([first, second]), np.array([0.6, 0.4])[:, None] * compliance)


def _elbow(
    machine: Machine, name: str, nodes: tuple[str, str], rigidity: Array, offset: float, side: float
) -> Machine:
    """Return the machine with a link whose neutral line runs round a corner beside the straight one."""
    placed = in_the_middle(machine.robot)
    a, b = (placed.node(machine.node(n))[0] for n in nodes)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across = across / np.linalg.norm(across)
    corner = 0.5 * (a + b) + offset * np.linalg.norm(b - a) * (
        np.cos(side) * across + np.sin(side) * np.cross(along, across)
    )
    node = node_at(machine, placed, machine.node(nodes[0]).frame, corner, "elbow")
    up = up_of(machine, nodes)
    halves = (
        Bar(f"{name} before", (nodes[0], node.name), tapered(rigidity, lambda x: 1.1 - 0.2 * x), up),
        Bar(f"{name} behind", (node.name, nodes[1]), tapered(rigidity, lambda x: 0.9 - 0.2 * x), up),
    )
    return machine.plus(nodes=(node,), bars=halves)


EFFECT = Effect("link-bending", ("tapered", "hinged", "elbow"), places, draw, impose)
