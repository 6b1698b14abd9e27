"""What holds a robot and what it holds: feet, mats, a tool changer, a bracket."""

import numpy as np

from beamstiff.exam.added_parts import behind_flange, free_name, on_pedestal, sprung
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, nowhere, slender
from beamstiff.exam.forms.author4.by_form import (
    Form,
    effect_of,
    main_stiffness,
    round_about,
    rounded_ramp,
    wrist_stiffness,
)
from beamstiff.exam.forms.author4.structure import LEGENDRE, lifting
from beamstiff.exam.laws import Curve
from beamstiff.exam.machine import Machine, Rod
from beamstiff.exam.reality import Reality
from beamstiff.exam.rotations import cross_matrix
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Node

ROUND = 0.2  # of a foot's gap: it comes down slowly
ROUGH = 1.2e-5  # m: of the surfaces that meet there
LEG = 0.1  # m
STUD = 0.1  # of a foot's stiffness: what its bolt alone has
SIDEWAYS = 1.5  # of a foot's stiffness


def _half_foot(robot: Robot) -> float:
    return 0.35 / float(np.sqrt(slender(robot)))


def _feet(request: DrawRequest) -> dict[str, float]:
    k = main_stiffness(request.robot) / request.sized(0.02, 0.5)
    return {
        "foot": k / (4.0 * _half_foot(request.robot) ** 2),
        "gap": request.log_uniform(1e-5, 1.5e-4),
        "short": request.integer(0, 4),
    }


def short_foot(k: float, gap: float) -> Curve:
    """Return the force of a foot that stands off its shim by a gap: its bolt alone, until it is down."""
    width = ROUGH + ROUND * gap

    def part(strain: Array) -> tuple[Array, Array]:
        down, slope = rounded_ramp(-strain - gap, width)
        return k * (STUD * strain - (1.0 - STUD) * down), k * (STUD + (1.0 - STUD) * slope)

    free = part(np.zeros(1))[0]
    return Curve(lambda strain: (part(strain)[0] - free, part(strain)[1]))


def _on_feet(truth: Truth, reality: Reality) -> Reality:
    p, half = truth.parameters, _half_foot(reality.machine.robot)
    k = p["foot"]
    sideways = SIDEWAYS * k
    held = np.array([sideways, sideways, 0.0, 0.0, 0.0, 2.0 * sideways * half**2])
    machine = on_pedestal(reality.machine, held)
    ground, body = machine.hinges[-1].nodes
    middle = np.array(machine.node(ground).at)
    for at, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        top = middle + half * np.array([x, y, 0.0])
        ends = []
        for host, place in ((ground, top - [0.0, 0.0, LEG]), (body, top)):
            node = Node(name=free_name(machine, f"leg {at}"), at=tuple(map(float, place)))  # type: ignore[arg-type]
            machine = machine.plus(nodes=(node,), rigids=((f"{host} {node.name}", (host, node.name)),))
            ends.append(node.name)
        law = short_foot(k, p["gap"]) if at == p["short"] else None
        machine = machine.plus(rods=(Rod(f"leg {at}", (ends[0], ends[1]), k, law),))
    return reality.with_machine(machine)


def rubber(k: float, from_: float, rest: float) -> Curve:
    """Return a filled rubber's force: its stiffness falls from k to a share of it, by Payne's effect."""

    def curve(strain: Array) -> tuple[Array, Array]:
        u = 1.0 + np.abs(strain) / from_
        return k * strain * (rest + (1.0 - rest) / u), k * (rest + (1.0 - rest) / u**2)

    return Curve(curve)


def _mats(request: DrawRequest) -> dict[str, float]:
    return {
        "tilting": main_stiffness(request.robot) / request.sized(0.02, 0.6),
        "from": request.log_uniform(2e-5, 1.5e-4),
        "rest": request.uniform(0.3, 0.6),
        "sideways": request.uniform(0.15, 0.5),
    }


def _on_mats(truth: Truth, reality: Reality) -> Reality:
    p, half = truth.parameters, _half_foot(reality.machine.robot)
    tilting, upright = p["tilting"], p["tilting"] / half**2
    shear = p["sideways"] * upright
    stiffness = np.array([shear, shear, upright, tilting, tilting, 2.0 * shear * half**2])
    soft = {0: half, 1: half, 3: 1.0, 4: 1.0, 5: 1.0}  # strains are larger by the arm than turns
    laws = {at: rubber(float(stiffness[at]), p["from"] * arm, p["rest"]) for at, arm in soft.items()}
    return reality.with_machine(on_pedestal(reality.machine, stiffness, laws))


def _changer(request: DrawRequest) -> dict[str, float]:
    return {
        "bending": wrist_stiffness(request.robot) / request.sized(0.02, 1.0),
        "from": request.log_uniform(3e-5, 3e-4),
        "rest": request.uniform(0.2, 0.5),
        "twist": request.uniform(2.0, 5.0),
        "behind": request.uniform(0.05, 0.2) / np.sqrt(slender(request.robot)),
    }


def _bracket(request: DrawRequest) -> dict[str, float]:
    small = np.sqrt(slender(request.robot))
    return {
        "bending": wrist_stiffness(request.robot) / request.sized(0.02, 1.0),
        "aside": request.uniform(0.08, 0.3) / small,
        "ahead": request.uniform(0.08, 0.35) / small,
        "way": request.uniform(0.0, 2.0 * np.pi),
        "flat": request.uniform(0.15, 0.7),
        "twist": request.uniform(0.3, 0.8),
    }


def bracket(p: dict[str, float]) -> Array:
    """Return an L-bracket's compliance at the tool (6, 6): an arm aside of the flange, and one ahead."""
    aside = np.array([np.cos(p["way"]), np.sin(p["way"]), 0.0])
    ahead = np.array([0.0, 0.0, 1.0])
    long = p["aside"] + p["ahead"]
    rigidity = p["bending"] * long
    # bending of a flat bar: weak about its broad side
    turn = 1.0 / (rigidity * np.array([p["twist"], p["flat"], 1.0]))
    compliance = np.zeros((6, 6))
    corner = -p["ahead"] * ahead
    for along, start, length in (
        (aside, corner - p["aside"] * aside, p["aside"]),
        (ahead, corner, p["ahead"]),
    ):
        axes = np.stack([along, np.cross(ahead, aside), np.cross(along, np.cross(ahead, aside))], axis=-1)
        flexible = axes @ np.diag(turn) @ axes.T
        for x, weight in zip(0.5 * (LEGENDRE[0] + 1.0), 0.5 * LEGENDRE[1], strict=True):
            # moment at the station from the load at the tool
            carried = np.concatenate([cross_matrix(-(start + x * length * along)), np.eye(3)], axis=1)
            compliance += weight * length * carried.T @ flexible @ carried
    small = 1e-3 * np.trace(compliance[:3, :3])  # stretch and shear
    compliance[:3, :3] += small * np.eye(3)
    return compliance


def _hold(truth: Truth, reality: Reality) -> Reality:
    p = dict(truth.parameters)
    cut, flange = behind_flange(reality.machine)
    if truth.form == "side-bracket":
        stiffness = np.linalg.inv(bracket(p))
        return reality.with_machine(sprung(cut, flange, np.zeros(3), 0.5 * (stiffness + stiffness.T)))
    rigid = np.inf
    held = np.array([rigid, rigid, rigid, 0.0, 0.0, p["twist"] * p["bending"]])
    machine: Machine = sprung(cut, flange, np.array([0.0, 0.0, -p["behind"]]), held)
    law = lifting(0.5 * p["bending"], p["from"], p["rest"])
    return reality.with_machine(round_about(machine, machine.hinges[-1], 3, law))


EFFECTS = (
    effect_of(
        "base-compliance", nowhere, {"short-foot": Form(_feet, _on_feet), "mats": Form(_mats, _on_mats)}
    ),
    effect_of(
        "tool-compliance",
        nowhere,
        {"tool-changer": Form(_changer, _hold), "side-bracket": Form(_bracket, _hold)},
    ),
)
