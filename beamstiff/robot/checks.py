"""What the parts of a robot description say of each other: names that exist, trees, parts that hang together.

Each check yields problems as (path, message); `Robot` refuses a description that has any.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.robot.coupling import coupling, variable_kinds
from beamstiff.robot.expression import parse_expression
from beamstiff.robot.fields import FREE, RIGID, Problem
from beamstiff.robot.graph import parts_without_support, structure_graph
from beamstiff.robot.parts import FRAME_PARAMETERS
from beamstiff.robot.sections import section_properties
from beamstiff.robot.stiffness import stiffness_parameters

ELEMENTS = ("beams", "rigids", "joints", "struts")

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


def find_problems(robot: Robot) -> Iterator[Problem]:
    """Yield every problem found; later checks run only when the names are sound."""
    problems = [*_duplicates(robot), *_names(robot)]
    if not problems:
        problems = [*_variables(robot), *_frames(robot), *_elements(robot), *_identify(robot)]
    if not problems:
        problems = [*_support(robot)]
    yield from problems


def _duplicates(robot: Robot) -> Iterator[Problem]:
    for field in ("variables", "frames", "loops", "nodes"):
        seen: set[str] = set()
        for at, item in enumerate(getattr(robot, field)):
            if item.name in seen:
                yield (field, at, "name"), f"duplicate name {item.name!r}"
            seen.add(item.name)
    elements: dict[str, str] = {}
    for field in ELEMENTS:
        for at, item in enumerate(getattr(robot, field)):
            if item.name in elements:
                yield (
                    (field, at, "name"),
                    f"duplicate name {item.name!r}, already used in {elements[item.name]}",
                )
            elements[item.name] = field
    for at, frame in enumerate(robot.frames):
        if frame.name == "base":
            yield ("frames", at, "name"), "the name 'base' is the fixed frame's own"


def _names(robot: Robot) -> Iterator[Problem]:
    nodes = [node.name for node in robot.nodes]
    frames = ["base", *(frame.name for frame in robot.frames)]
    variables = [variable.name for variable in robot.variables]

    def unknown(
        path: tuple[str | int, ...], name: str, what: str, known: Collection[str]
    ) -> Iterator[Problem]:
        if name not in known:
            yield path, f"unknown {what} {name!r}{suggest(name, known)}"

    for at, frame in enumerate(robot.frames):
        yield from unknown(("frames", at, "parent"), frame.parent, "frame", frames)
    for at, node in enumerate(robot.nodes):
        yield from unknown(("nodes", at, "frame"), node.frame, "frame", frames)
    for field in ELEMENTS:
        for at, item in enumerate(getattr(robot, field)):
            for end in (0, 1):
                yield from unknown((field, at, "nodes", end), item.nodes[end], "node", nodes)
    for at, beam in enumerate(robot.beams):
        yield from unknown(("beams", at, "section"), beam.section, "section", robot.sections)
        yield from unknown(("beams", at, "material"), beam.material, "material", robot.materials)
    for at, joint in enumerate(robot.joints):
        yield from unknown(("joints", at, "frame"), joint.frame, "frame", frames)
        if joint.variable is not None:
            yield from unknown(("joints", at, "variable"), joint.variable, "variable", variables)
    for at, mass in enumerate(robot.masses):
        yield from unknown(("masses", at, "node"), mass.node, "node", nodes)
    for at, name in enumerate(robot.fixed):
        yield from unknown(("fixed", at), name, "node", nodes)
    yield from unknown(("tcp",), robot.tcp, "node", nodes)
    for at, loop in enumerate(robot.loops):
        for end in ("a", "b"):
            name = getattr(loop, end)
            yield from unknown(("loops", at, end), name, "frame or node", [*frames, *nodes])
            if name in frames and name in nodes:
                yield ("loops", at, end), f"{name!r} is both a frame and a node: rename one"
        if loop.a == loop.b:
            yield ("loops", at, "b"), f"found {loop.b!r} at both ends, expected two different frames or nodes"


def _variables(robot: Robot) -> Iterator[Problem]:
    try:
        variable_kinds(robot)
        coupling(robot)
    except BeamstiffError as error:
        yield ("variables",), str(error)
    passive = [variable.name for variable in robot.variables if variable.passive]
    if passive and not robot.loops:
        yield ("loops",), f"is missing: the passive variables {listed(passive)} are solved by loop closure"


def _frames(robot: Robot) -> Iterator[Problem]:
    parents = {frame.name: frame.parent for frame in robot.frames}
    for at, frame in enumerate(robot.frames):
        chain, name = [frame.name], frame.parent
        while name != "base" and name not in chain:
            chain.append(name)
            name = parents[name]
        if name == frame.name:
            yield ("frames", at, "parent"), f"cycle of frames: {' -> '.join([*reversed(chain), name])[:120]}"
            return
    try:
        kinds = variable_kinds(robot)
    except BeamstiffError:
        return  # told by the check of the variables
    for at, frame in enumerate(robot.frames):
        for parameter, kind in FRAME_PARAMETERS.items():
            try:
                parse_expression(getattr(frame, parameter), kind, kinds)
            except BeamstiffError as error:
                yield ("frames", at, parameter), str(error)


def _elements(robot: Robot) -> Iterator[Problem]:
    frames = {node.name: node.frame for node in robot.nodes}
    places = {node.name: node.at for node in robot.nodes}
    for field in ELEMENTS:
        for at, item in enumerate(getattr(robot, field)):
            if item.nodes[0] == item.nodes[1]:
                yield (
                    (field, at, "nodes"),
                    f"found {item.nodes[0]!r} at both ends of {item.name!r}, expected two nodes",
                )
    for at, beam in enumerate(robot.beams):
        a, b = beam.nodes
        if frames[a] == frames[b] and a != b and math.dist(places[a], places[b]) < 1e-9:
            yield (
                ("beams", at),
                f"beam {beam.name!r} has zero length: its nodes {a!r} and {b!r} coincide (a rigid may)",
            )
        if beam.up is None:
            section = robot.sections[beam.section]
            properties = section_properties(section)
            if not math.isclose(properties.Iy, properties.Iz, rel_tol=1e-9) or properties.Ay != properties.Az:
                yield (
                    ("beams", at, "up"),
                    f"is missing: the section {beam.section!r} of {beam.name!r} is not the same in all directions",
                )
    for at, joint in enumerate(robot.joints):
        if joint.variable is not None and (
            variable := next(v for v in robot.variables if v.name == joint.variable)
        ):
            along = "axial" if variable_kinds(robot)[joint.variable] == "length" else "torsional"
            if (
                variable.passive
                and getattr(joint.stiffness, along) == RIGID
                and along not in joint.stiffness.model_fields_set
            ):
                yield (
                    ("joints", at, "stiffness", along),
                    f"is missing: {joint.variable!r} is passive, say free or a stiffness",
                )


def _identify(robot: Robot) -> Iterator[Problem]:
    parameters = stiffness_parameters(robot)
    seen: set[str] = set()
    for at, name in enumerate(robot.identify):
        if name not in parameters:
            yield ("identify", at), f"unknown stiffness parameter {name!r}{suggest(name, parameters)}"
        elif parameters[name] in (FREE, RIGID):
            word = "free" if parameters[name] == FREE else "rigid"
            yield ("identify", at), f"{name!r} is {word}: give it a number to start from"
        elif name in seen:
            yield ("identify", at), f"{name!r} is named twice"
        seen.add(name)


def _support(robot: Robot) -> Iterator[Problem]:
    graph = structure_graph(robot)
    loose: Sequence[set[str]] = parts_without_support(graph, robot.fixed)
    if loose:
        yield (
            ("fixed",),
            f"disconnected part: nodes {listed(sorted(loose[0]))} are connected to no fixed node",
        )
