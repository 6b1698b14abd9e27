"""Causes that are one mechanics, whatever their forms say: no measurement of the tool tells them apart."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import networkx as nx

from beamstiff.diagnosis.effects.torque_laws import component_of
from beamstiff.diagnosis.prior import key_of
from beamstiff.robot.description import Robot
from beamstiff.robot.graph import joined

GROUND = "base"  # frame


def same_mechanics(robot: Robot) -> Mapping[str, tuple[str, ...]]:
    """Return for each such cause all of its group, that with the usual name first.

    Behind the last joint everything turns with the tool: the last bearing, a link or stalk behind it and the
    tool bend alike for every point behind them, and only a reflector on either side distinguishes them.
    Adapters, force sensors and grippers are more compliant than the last bearing and link usually. What
    stands on the ground in front of the first joint is the pedestal, and the first joint's bearing, whose
    seat is the ground, tilts as it does where nothing else carries the machine.
    """
    groups = []
    if robot.joints:
        last = robot.joints[-1]
        bent = [link for node in last.nodes[::-1] for link in _links(robot, joined(robot, node))]
        bearing = key_of("bearing-tilt", last.variable or last.name)
        groups.append((key_of("tool-compliance", None), bearing, *bent))
    feet = {*robot.fixed, *(node.name for node in robot.nodes if node.frame == GROUND)}
    ground = {node: far for foot in feet for node, far in joined(robot, foot).items()}
    standing = [joint for joint in robot.joints if ground.keys() & joint.nodes]
    alone = len(standing) == 1 and not robot.struts
    bearings = [key_of("bearing-tilt", component_of(robot, joint)) for joint in standing if alone]
    carrying = {*feet, robot.tcp, *(node for joint in robot.joints for node in joint.nodes)}
    carrying |= {node for strut in robot.struts for node in strut.nodes}
    groups.append((key_of("base-compliance", None), *bearings, *_links(robot, ground, carrying)))
    return {key: group for group in groups for key in group}


def other_mechanics(groups: Mapping[str, tuple[str, ...]]) -> Mapping[str, bool]:
    """Return the bearings whose forms that turn with the joint (True), or do not (False), stand apart.

    What turns with the first joint is told from the ground by the postures, and what does not turn with the
    last one from the tool.
    """
    ends = {"base-compliance": True, "tool-compliance": False}
    return {
        key: turns
        for effect, turns in ends.items()
        for key in groups.get(key_of(effect, None), ())
        if key.startswith("bearing-tilt:")
    }


def _links(robot: Robot, reached: Mapping[str, int], carrying: Collection[str] = ()) -> list[str]:
    """Return the bending of the links between nodes that are reached, the nearest first.

    `carrying`: nodes that a link has to lead to, from both of its ends, to move the tool; default any.
    """
    parts = [(part.nodes, part.name) for part in robot.rigids]
    parts += [(part.nodes, part.name) for part in robot.beams]
    parts = [(ends, name) for ends, name in parts if reached.keys() >= {*ends}]
    graph: nx.Graph[str] = nx.Graph(ends for ends, _ in parts)
    while carrying and (dead := [node for node in {*graph} - {*carrying} if graph.degree(node) < 2]):
        graph.remove_nodes_from(dead)
    links = [(min(reached[node] for node in ends), name) for ends, name in parts if graph.has_edge(*ends)]
    return [key_of("link-bending", name) for _, name in sorted(links, key=lambda link: link[0])]
