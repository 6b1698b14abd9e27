"""What the parts of a robot description say of each other: names that exist, trees, parts that hang together.

Each check yields problems as (path, message); `Robot` refuses a description that has any.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import TYPE_CHECKING

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.robot.coupling import coupling, variable_kinds
from beamstiff.robot.expression import parse_expression
from beamstiff.robot.fields import FREE, RIGID, DescriptionError, Problem
from beamstiff.robot.graph import parts_without_support, structure_graph
from beamstiff.robot.parts import FRAME_PARAMETERS, STIFFNESS_KINDS, Node
from beamstiff.robot.sections import section_properties
from beamstiff.robot.stiffness_parameters import stiffness_parameters

ELEMENTS = ("beams", "rigids", "joints", "struts")
# columns of a table of measurements, which no variable may be called; `measure.columns` has the same ones
_WRENCH, _MOVED = ("fx", "fy", "fz", "mx", "my", "mz"), ("dx", "dy", "dz", "rx", "ry", "rz")
_PLACED = ("x", "y", "z", "a", "b", "c")
_LABELS = (
    *("t", "temperature", "pose", "step", "point", "load_point", "remark"),
    *("instrument", "target", "direction"),
)
_READ = ("reading", "dreading", "sigma_reading", "length", "target_x", "target_y", "target_z")
TABLE_COLUMNS = frozenset(
    (*_WRENCH, *_MOVED, *_PLACED, *(f"sigma_{name}" for name in _MOVED + _PLACED), *_READ, *_LABELS)
)
_MOST_PROBLEMS = 100
_ZERO_LENGTH = 1e-9  # m
_COINCIDENT = 1e-6  # m: the nodes of a joint; wider, for coordinates are rounded

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


def find_problems(robot: Robot) -> Iterator[Problem]:
    """Yield the problems found, a hundred at most; later checks run only when the names are sound."""
    for checks in (
        (_duplicates, _names),
        (_variables,),
        (_assembly, _frames, _elements, _identify, _ranges, _model, _calibrated),
        (_support,),
    ):
        problems = list(islice(chain.from_iterable(check(robot) for check in checks), _MOST_PROBLEMS))
        if problems:
            yield from problems
            return


def _assembly(robot: Robot) -> Iterator[Problem]:
    if robot.assembly is not None and not robot.loops:
        yield ("assembly",), f"found {shown(robot.assembly)}, but the robot has no closed loops"


def _calibrated(robot: Robot) -> Iterator[Problem]:
    for at, item in enumerate(robot.calibrated):
        if len(item.correlation) > at:
            found = f"found {len(item.correlation)} values"
            yield ("calibrated", at, "correlation"), f"{found}, expected one for each of the {at} before it"


def _duplicates(robot: Robot) -> Iterator[Problem]:
    for field in ("variables", "frames", "loops", "nodes", "calibrated"):
        seen: set[str] = set()
        for at, item in enumerate(getattr(robot, field)):
            if item.name in seen:
                yield (field, at, "name"), f"duplicate name {item.name!r}"
            seen.add(item.name)
    elements: dict[str, str] = {}
    for field in ELEMENTS:
        for at, item in enumerate(getattr(robot, field)):
            if item.name in elements:
                used = elements[item.name]
                yield (field, at, "name"), f"duplicate name {item.name!r}, already used in {used}"
            elements[item.name] = field
    for at, variable in enumerate(robot.variables):
        if variable.name in TABLE_COLUMNS:
            yield (
                ("variables", at, "name"),
                f"{variable.name!r} is a column of its own in a table of measurements: rename the variable",
            )
    for at, frame in enumerate(robot.frames):
        if frame.name == "base":
            yield ("frames", at, "name"), "the name 'base' is the fixed frame's own"
    # a strut's stiffness goes by the strut's name alone
    others = {f"{joint.name}.{kind}" for joint in robot.joints for kind in STIFFNESS_KINDS}
    others |= {f"{beam.name}.E" for beam in robot.beams}
    for at, strut in enumerate(robot.struts):
        if strut.name in others:
            yield ("struts", at, "name"), f"{strut.name!r} is also the name of another stiffness: rename it"


def _names(robot: Robot) -> Iterator[Problem]:
    nodes = dict.fromkeys(node.name for node in robot.nodes)
    frames = dict.fromkeys(["base", *(frame.name for frame in robot.frames)])
    variables = dict.fromkeys(variable.name for variable in robot.variables)

    known: dict[str, Collection[str]] = {
        **{"frame": frames, "node": nodes, "variable": variables, "frame or node": frames | nodes},
        **{"section": robot.sections, "material": robot.materials},
    }

    def unknown(path: tuple[str | int, ...], name: str | None, what: str) -> Iterator[Problem]:
        if name is not None and name not in known[what]:
            hint = suggest(name, known[what]) or f", expected one of {listed(known[what], 20)}"
            yield path, f"unknown {what} {name!r}{hint}"

    def named(field: str, **keys: str) -> Iterator[Problem]:
        """Yield what keys of the items of a field name without there being such a part."""
        for at, item in enumerate(getattr(robot, field)):
            for key, what in keys.items():
                yield from unknown((field, at, key), getattr(item, key), what)

    yield from named("frames", parent="frame")
    yield from named("nodes", frame="frame")
    for field in ELEMENTS:
        for at, item in enumerate(getattr(robot, field)):
            for end in (0, 1):
                yield from unknown((field, at, "nodes", end), item.nodes[end], "node")
    yield from named("beams", section="section", material="material")
    yield from named("joints", frame="frame", variable="variable")
    yield from named("masses", node="node")
    for at, name in enumerate(robot.fixed):
        yield from unknown(("fixed", at), name, "node")
    yield from unknown(("tcp",), robot.tcp, "node")
    for at, loop in enumerate(robot.loops):
        for key, place in (("a", loop.a), ("b", loop.b)):
            yield from unknown(("loops", at, key), place, "frame or node")
            if place in frames and place in nodes:
                yield ("loops", at, key), f"{place!r} is both a frame and a node: rename one"
        if loop.a == loop.b:
            yield ("loops", at, "b"), f"found {loop.b!r} at both ends, expected two different frames or nodes"


def _variables(robot: Robot) -> Iterator[Problem]:
    passive = [variable.name for variable in robot.variables if variable.passive]
    if passive and not robot.loops:
        yield ("loops",), f"is missing: the passive variables {listed(passive)} are solved by loop closure"
    try:
        kinds = variable_kinds(robot)
    except DescriptionError as error:
        yield from error.problems
        return
    for at, variable in enumerate(robot.variables):
        try:
            if variable.equals is not None:
                parse_expression(variable.equals, kinds[variable.name], kinds)
        except BeamstiffError as error:
            yield ("variables", at, "equals"), str(error)
            return
    try:
        coupling(robot)
    except BeamstiffError as error:
        yield ("variables",), str(error)


def _frames(robot: Robot) -> Iterator[Problem]:
    parents = {frame.name: frame.parent for frame in robot.frames}
    places = {frame.name: at for at, frame in enumerate(robot.frames)}
    rooted = {"base"}
    for frame in robot.frames:
        walked: dict[str, None] = {}
        name = frame.name
        while name not in rooted and name not in walked:
            walked[name] = None
            name = parents[name]
        if name in walked:
            cycle = [*walked][[*walked].index(name) :]
            path = " -> ".join([*cycle[:8], *(["..."] if len(cycle) > 8 else []), name])
            yield ("frames", places[name], "parent"), f"cycle of frames: {path}"
            return
        rooted.update(walked)
    kinds = variable_kinds(robot)
    for at, frame in enumerate(robot.frames):
        for parameter, kind in FRAME_PARAMETERS.items():
            try:
                parse_expression(getattr(frame, parameter), kind, kinds)
            except BeamstiffError as error:
                yield ("frames", at, parameter), str(error)


def _elements(robot: Robot) -> Iterator[Problem]:
    nodes = {node.name: node for node in robot.nodes}
    for field in ELEMENTS:
        for at, item in enumerate(getattr(robot, field)):
            a, b = (nodes[name] for name in item.nodes)
            if a.name == b.name:
                yield (
                    (field, at, "nodes"),
                    f"found {a.name!r} at both ends of {item.name!r}, expected two nodes",
                )
                continue
            if a.frame != b.frame or field == "rigids":  # a rigid may have any length
                continue
            length = math.dist(a.at, b.at)
            if field == "joints" and length > _COINCIDENT:
                yield (
                    (field, at, "nodes"),
                    f"the nodes {a.name!r} and {b.name!r} of the joint {item.name!r} are {length:g} m apart, "
                    "expected two coincident ones",
                )
            if field in ("beams", "struts") and length < _ZERO_LENGTH:
                yield (
                    (field, at, "nodes"),
                    f"the {field[:-1]} {item.name!r} has zero length: its nodes {a.name!r} and {b.name!r} "
                    "coincide (those of a rigid may)",
                )
    yield from _beam_directions(robot, nodes)
    yield from _passive_joints(robot)
    seen: set[str] = set()
    for at, name in enumerate(robot.fixed):
        if name in seen:
            yield ("fixed", at), f"{name!r} is named twice"
        seen.add(name)


def _beam_directions(robot: Robot, nodes: Mapping[str, Node]) -> Iterator[Problem]:
    round_sections = set()
    for name, section in robot.sections.items():
        properties = section_properties(section)
        if math.isclose(properties.Iy, properties.Iz, rel_tol=1e-9) and properties.Ay == properties.Az:
            round_sections.add(name)
    for at, beam in enumerate(robot.beams):
        if beam.up is None and beam.section not in round_sections:
            yield (
                ("beams", at, "up"),
                f"is missing: the section {beam.section!r} of {beam.name!r} is not alike in all directions",
            )
        a, b = (nodes[name] for name in beam.nodes)
        axis = [end - start for start, end in zip(a.at, b.at, strict=True)]
        if beam.up is not None and a.frame == b.frame and _parallel(axis, beam.up):
            yield (
                ("beams", at, "up"),
                f"found {shown(list(beam.up))}, which is parallel to the beam {beam.name!r}, "
                "expected a direction across it",
            )


def _parallel(one: Sequence[float], other: Sequence[float]) -> bool:
    """Tell whether two vectors are parallel to some 1e-9; lengths cancel first, so that nothing overflows."""
    length, other_length = math.hypot(*one), math.hypot(*other)
    if not 0.0 < length < math.inf:
        return False
    (a, b, c), (x, y, z) = (
        [value / size for value in v] for v, size in ((one, length), (other, other_length))
    )
    return math.hypot(b * z - c * y, c * x - a * z, a * y - b * x) < 1e-9


def _passive_joints(robot: Robot) -> Iterator[Problem]:
    kinds = variable_kinds(robot)
    passive = {variable.name for variable in robot.variables if variable.passive}
    for at, joint in enumerate(robot.joints):
        if joint.variable not in passive:
            continue
        along = "axial" if kinds[joint.variable] == "length" else "torsional"
        # a passive joint that is rigid about its own axis is said, never a default
        if along not in joint.stiffness.model_fields_set and getattr(joint.stiffness, along) == RIGID:
            yield (
                ("joints", at, "stiffness", along),
                f"is missing: {joint.variable!r} is passive, say free, a stiffness or rigid",
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
    for at, name in enumerate(robot.unmeasured):
        if name not in parameters:
            yield ("unmeasured", at), f"unknown stiffness parameter {name!r}{suggest(name, parameters)}"


def _ranges(robot: Robot) -> Iterator[Problem]:
    names = [variable.name for variable in robot.actuated]
    of_model = () if robot.model is None else robot.model.ranges
    for path, ranges in ((("fitted_ranges",), robot.fitted_ranges), (("model", "ranges"), of_model)):
        for at, one in enumerate(ranges):
            if one.variable not in names:
                yield (
                    (*path, at, "variable"),
                    f"unknown actuated variable {one.variable!r}{suggest(one.variable, names)}",
                )


def _model(robot: Robot) -> Iterator[Problem]:
    if robot.model is None:
        return
    parameters = stiffness_parameters(robot)
    for at, name in enumerate(robot.model.springs):
        if name not in parameters:
            yield ("model", "springs", at), f"unknown stiffness parameter {name!r}{suggest(name, parameters)}"
        elif parameters[name] in (FREE, RIGID):
            yield ("model", "springs", at), f"{name!r} is rigid or free: give the robot's spring a number"
    names = [variable.name for variable in robot.actuated]
    process = robot.model.process
    if process is not None and len(process.lengths) != len(names):
        found = f"found {len(process.lengths)}, expected {len(names)}: one an actuated variable"
        yield ("model", "process", "lengths"), found


def _support(robot: Robot) -> Iterator[Problem]:
    graph = structure_graph(robot)
    unsupported: Sequence[set[str]] = parts_without_support(graph, robot.fixed)
    if unsupported:
        part = sorted(unsupported[0])
        first = next(at for at, node in enumerate(robot.nodes) if node.name in part)
        own = robot.nodes[first]
        near = [node for node in robot.nodes if node.frame == own.frame and node.name not in unsupported[0]]
        # a rigid to a node that moves otherwise would hold what is to move
        end = min(near, key=lambda node: math.dist(node.at, own.at)).name if near else "..."
        yield (
            ("nodes", first),
            f"disconnected part: nodes {listed(part)} are connected to no fixed node; join them to what "
            "carries them with a beam, a joint or a rigid, such as "
            f"{{name: mount, nodes: [{end}, {own.name}]}} under `rigids`",
        )
