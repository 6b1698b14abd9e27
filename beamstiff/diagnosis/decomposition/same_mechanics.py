"""Causes that are one mechanics, whatever their forms say: no measurement of the tool tells them apart."""

from __future__ import annotations

from collections.abc import Mapping

from beamstiff.diagnosis.effects.torque_laws import component_of
from beamstiff.diagnosis.prior import key_of
from beamstiff.robot.description import Robot

GROUND = "base"  # frame


def same_mechanics(robot: Robot) -> Mapping[str, tuple[str, ...]]:
    """Return for each such cause all of its group, that with the usual name first.

    Behind the last joint everything turns with the tool: the last bearing, a link or stalk behind it and the
    tool bend alike for every point behind them, and only a reflector on either side distinguishes them.
    Adapters, force sensors and grippers are more compliant than the last bearing and link usually. What
    stands on the ground in front of the first joint is the pedestal, and the first joint's bearing, whose
    seat is the ground, tilts as it does where nothing else carries the machine.
    """
    parts = [(part.name, set(part.nodes)) for part in robot.rigids]
    parts += [(part.name, set(part.nodes)) for part in robot.beams]
    groups = []
    if robot.joints:
        last = robot.joints[-1]
        bent = [link for node in last.nodes[::-1] for link in _joined(node, parts)]
        bearing = key_of("bearing-tilt", last.variable or last.name)
        groups.append(
            (key_of("tool-compliance", None), bearing, *(key_of("link-bending", link) for link in bent))
        )
    feet = {*robot.fixed, *(node.name for node in robot.nodes if node.frame == GROUND)}
    pedestal = list(dict.fromkeys(name for foot in sorted(feet) for name in _joined(foot, parts)))
    ground = feet.union(*(ends for name, ends in parts if name in pedestal))
    standing = [joint for joint in robot.joints if set(joint.nodes) & ground]
    alone = len(standing) == 1 and not robot.struts
    bearings = [key_of("bearing-tilt", component_of(robot, joint)) for joint in standing if alone]
    pedestal = [key_of("link-bending", name) for name in pedestal]
    groups.append((key_of("base-compliance", None), *bearings, *pedestal))
    return {key: group for group in groups for key in group}


def _joined(node: str, parts: list[tuple[str, set[str]]]) -> list[str]:
    """Return the parts that hang together with a node, no joint between."""
    nodes, names = {node}, []
    for _ in parts:
        for name, ends in parts:
            if name not in names and ends & nodes:
                names.append(name)
                nodes |= ends
    return names
