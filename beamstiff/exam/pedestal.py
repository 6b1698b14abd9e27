"""Machines with something between them and the ground, or between the last link and the tool."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from itertools import count

import numpy as np

from beamstiff.exam.campaign import Array
from beamstiff.exam.effect import in_the_middle
from beamstiff.exam.laws import Law
from beamstiff.exam.machine import Hinge, Machine
from beamstiff.robot.parts import Node

UP = np.array([0.0, 0.0, 1.0])


def on_pedestal(machine: Machine, stiffness: Array, laws: Mapping[int, Law] | None = None) -> Machine:
    """Return the machine with all its fixed nodes on one body that springs hold, in base axes.

    The springs (6,) or (6, 6) act at the middle of the fixed nodes.
    """
    placed = in_the_middle(machine.robot)
    foot = np.mean([placed.node(machine.node(name))[0] for name in machine.fixed], axis=0)
    ground, body = (free_name(machine, name) for name in ("ground", "foot"))
    at = tuple(map(float, foot))
    nodes = (*machine.nodes, *(Node(name=name, at=at) for name in (ground, body)))  # type: ignore[arg-type]
    ties = tuple((f"{body} {name}", (body, name)) for name in machine.fixed)
    hinge = Hinge(body, (ground, body), "base", np.eye(3), stiffness, laws or {})
    return dataclasses.replace(
        machine,
        nodes=nodes,
        rigids=(*machine.rigids, *ties),
        hinges=(*machine.hinges, hinge),
        fixed=(ground,),
    )


def behind_flange(machine: Machine) -> tuple[Machine, str]:
    """Return the machine cut open in front of its TCP, and the node on the machine's side, at the same place.

    What hangs on the TCP alone stays on the tool's side.
    """
    flange = free_name(machine, "flange")
    tcp = machine.tcp
    ties = machine.ties
    held = set(machine.fixed)
    for _ in machine.nodes:
        held |= {n for tie in ties if tcp not in tie and held & set(tie) for n in tie}

    def moved(nodes: tuple[str, str]) -> tuple[str, str]:
        if tcp in nodes and held & set(nodes):
            return flange if nodes[0] == tcp else nodes[0], flange if nodes[1] == tcp else nodes[1]
        return nodes

    node = machine.node(tcp).model_copy(update={"name": flange})
    cut = dataclasses.replace(
        machine,
        nodes=(*machine.nodes, node),
        rigids=tuple((name, moved(nodes)) for name, nodes in machine.rigids),
        hinges=tuple(dataclasses.replace(h, nodes=moved(h.nodes)) for h in machine.hinges),
        bars=tuple(dataclasses.replace(b, nodes=moved(b.nodes)) for b in machine.bars),
        rods=tuple(dataclasses.replace(r, nodes=moved(r.nodes)) for r in machine.rods),
    )
    return cut, flange


def sprung(
    machine: Machine, flange: str, at: Array, stiffness: Array, laws: Mapping[int, Law] | None = None
) -> Machine:
    """Return the machine with springs between flange and tool, at a place seen from the TCP in its frame."""
    tcp = machine.node(machine.tcp)
    place = tuple(map(float, np.array(tcp.at) + at))
    names: list[str] = []
    for _ in range(2):
        names.append(free_name(machine, "held"))
        machine = machine.plus(nodes=(Node(name=names[-1], frame=tcp.frame, at=place),))  # type: ignore[arg-type]
    first, second = names
    ties = ((f"to {first}", (flange, first)), (f"from {second}", (second, tcp.name)))
    hinge = Hinge(first, (first, second), tcp.frame, np.eye(3), stiffness, laws or {})
    return machine.plus(rigids=ties, hinges=(hinge,))


def free_name(machine: Machine, wanted: str) -> str:
    """Return a node's name that the machine does not have yet."""
    taken = {node.name for node in machine.nodes} | {hinge.name for hinge in machine.hinges}
    return next(name for name in (f"{wanted}{i or ''}" for i in count()) if name not in taken)
