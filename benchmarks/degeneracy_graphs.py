"""Random graphs of links and springs in which springs in series and in parallel are planted.

A tree of links from the ground, some of which end in an elastic joint, with beams across it, so that there
are loops, and struts from the ground to the tool. Which springs only act together is known by construction:
those that were planted, since all points and axes are drawn at random and the tool is loaded and read in all
six directions. What lies on no way from the tool to the ground is never loaded; the graph alone tells that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import networkx as nx
import numpy as np

from beamstiff.identification.degeneracy import Degeneracy
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Beam, Joint, Material, Node, Rigid, Strut
from beamstiff.robot.sections import Section

KINDS = ("axial", "radial", "torsional", "tilting")
STEEL = Material(E=210e9, G=80e9, density=7850.0)
BOX = Section(A=6e-3, Iy=5e-5, Iz=4e-5, J=6e-5)

Groups = frozenset[frozenset[str]]
Edge = tuple[int, int]


@dataclass(frozen=True)
class Case:
    """A random graph, its tests, and what is known of it.

    Attributes
    ----------
    robot : Robot
    tests : Measurements
    silent : frozenset of str
        Parameters that are never loaded.
    series, parallel : frozenset of frozenset of str
        Parameters planted to act together, without those that are never loaded.
    """

    robot: Robot
    tests: Measurements
    silent: frozenset[str]
    series: Groups
    parallel: Groups


@dataclass
class _Parts:
    """A robot under construction."""

    random: np.random.Generator
    nodes: list[Node] = field(default_factory=list)
    beams: list[Beam] = field(default_factory=list)
    rigids: list[Rigid] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    struts: list[Strut] = field(default_factory=list)
    series: list[frozenset[str]] = field(default_factory=list)
    parallel: list[frozenset[str]] = field(default_factory=list)
    edge: dict[str, Edge] = field(default_factory=dict)  # of the graph, by parameter

    def node(self, at: Iterable[float]) -> Node:
        self.nodes.append(Node(name=f"n{len(self.nodes)}", at=tuple(map(float, at))))
        return self.nodes[-1]

    def beam(self, a: Node, b: Node) -> None:
        up = tuple(self.random.normal(size=3).tolist())
        name = f"b{len(self.beams)}"
        self.beams.append(Beam(name=name, nodes=(a.name, b.name), section="box", material="steel", up=up))

    def rigid(self, a: Node, b: Node) -> None:
        self.rigids.append(Rigid(name=f"r{len(self.rigids)}", nodes=(a.name, b.name)))

    def joint(self, a: Node, b: Node, axis: Iterable[float], kinds: Iterable[str], rest: str) -> str:
        """Add a joint that is open in some kinds, with the others rigid or free; return its name."""
        name = f"j{len(self.joints)}"
        values = dict.fromkeys(KINDS, rest) | {kind: self.stiffness(kind) for kind in kinds}
        ends, along = (a.name, b.name), tuple(map(float, axis))
        self.joints.append(Joint(name=name, nodes=ends, frame="base", axis=along, stiffness=values))
        return name

    def strut(self, a: Node, b: Node) -> str:
        name = f"s{len(self.struts)}"
        self.struts.append(Strut(name=name, nodes=(a.name, b.name), stiffness=self.stiffness("axial")))
        return name

    def stiffness(self, kind: str) -> float:
        size = 1e6 if kind in ("torsional", "tilting") else 1e7
        return float(size * 10 ** self.random.uniform(-1, 1))


def random_case(seed: int, planted: bool) -> Case:
    """Return a random graph with some planted groups, or with none.

    Parameters
    ----------
    seed : int
    planted : bool
    """
    random = np.random.default_rng([seed, planted])
    parts, graph = _Parts(random), nx.Graph()
    bodies = int(random.integers(3, 7))
    count = int(random.integers(2, min(bodies, 5)))
    elastic = random.choice(np.arange(1, bodies), count, replace=False).tolist()
    chosen = elastic[: int(random.integers(1, count + 1))] if planted else []
    at = [parts.node(np.zeros(3))]  # of each vertex of the graph
    for vertex in range(1, bodies):
        below = int(random.integers(max(0, vertex - 2), vertex))
        end = parts.node(random.uniform(-1, 1, 3))
        hub = parts.node(end.at) if vertex in elastic else end
        # a joint sits at the end of a beam: between rigid links a loop would move in its few directions only
        rigid = vertex not in elastic and random.random() < 0.5
        (parts.rigid if rigid else parts.beam)(at[below], hub)
        if vertex in elastic:
            _joints(parts, hub, end, (below, vertex), vertex in chosen)
        graph.add_edge(below, vertex, rigid=rigid)
        at.append(end)
    tool = int(random.integers(1, bodies))
    for _ in range(int(random.integers(0, 3))):
        a, b = random.choice(bodies, 2, replace=False).tolist()
        if not graph.has_edge(a, b):
            parts.beam(at[a], at[b])
            graph.add_edge(a, b)
    if random.random() < 0.5 and not graph.has_edge(0, tool):
        # at the far end of a beam of its own, so that it is not parallel to all that rigid parts let move
        free = parts.node(random.uniform(-1, 1, 3))
        parts.beam(at[tool], free)
        _struts(parts, at[0], free, (0, tool), planted and random.random() < 0.7)
        graph.add_edge(0, tool)
    robot = Robot(
        name=f"graph {seed}",
        materials={"steel": STEEL},
        sections={"box": BOX},
        nodes=parts.nodes,
        beams=parts.beams,
        rigids=parts.rigids,
        joints=parts.joints,
        struts=parts.struts,
        fixed=[at[0].name],
        tcp=at[tool].name,
        identify=list(parts.edge),
    )
    silent = _never_loaded(graph, tool, parts.edge)
    series, parallel = (
        frozenset(group for group in groups if not group & silent)
        for groups in (parts.series, parts.parallel)
    )
    return Case(robot, _tests(robot), silent, series, parallel)


def _joints(parts: _Parts, a: Node, b: Node, edge: Edge, planted: bool) -> None:
    """Add a joint between two nodes of one place, or several in series or in parallel."""
    random = parts.random
    axis = random.normal(size=3)
    # one radial pair a graph: two in a row add up in every direction, so that only their sum would be known
    left = [kind for kind in KINDS if kind != "radial" or not any(".radial" in name for name in parts.edge)]
    kinds = random.choice(left, int(random.integers(1, 3)), replace=False).tolist()
    count = int(random.integers(2, 4)) if planted else 1
    in_series = random.random() < 0.5
    names = []
    for number in range(count):
        if in_series:
            to = b if number == count - 1 else parts.node(b.at)
            names.append(parts.joint(a, to, axis, kinds, "rigid"))
            a = to
        else:
            names.append(parts.joint(a, b, axis, kinds, "free" if number else "rigid"))
    for kind in kinds:
        members = [f"{name}.{kind}" for name in names]
        parts.edge |= dict.fromkeys(members, edge)
        if planted:
            (parts.series if in_series else parts.parallel).append(frozenset(members))


def _struts(parts: _Parts, a: Node, b: Node, edge: Edge, planted: bool) -> None:
    """Add a strut between two nodes, or two in parallel."""
    names = [parts.strut(a, b) for _ in range(2 if planted else 1)]
    parts.edge |= dict.fromkeys(names, edge)
    if planted:
        parts.parallel.append(frozenset(names))


def _never_loaded(graph: nx.Graph, tool: int, edges: dict[str, Edge]) -> frozenset[str]:
    """Return the parameters on no way from the tool to the ground."""
    rigid = nx.Graph((a, b) for a, b, data in graph.edges(data=True) if data.get("rigid"))
    body = {vertex: vertex for vertex in graph}
    for group in nx.connected_components(rigid):
        body |= dict.fromkeys(group, min(group))
    closed = nx.Graph((body[a], body[b]) for a, b in graph.edges if body[a] != body[b])
    nx.add_path(closed, [body[tool], "load", body[0]])  # a ring: what shares a block with it carries load
    blocks = [{frozenset(edge) for edge in block} for block in nx.biconnected_component_edges(closed)]
    loaded = next(block for block in blocks if frozenset(("load", body[0])) in block)
    return frozenset(name for name, (a, b) in edges.items() if frozenset((body[a], body[b])) not in loaded)


def _tests(robot: Robot) -> Measurements:
    """Return six loads on the tool, whose displacement and rotation are read."""
    return make_measurements(
        [],
        np.zeros((6, 0)),
        tcp=robot.tcp,
        wrench=np.diag([1000.0, 1000, 1000, 300, 300, 300]),
        displacement=np.zeros((6, 6)),
        sigma_position=3e-5,
        sigma_rotation=3e-5,
    )


def faults(case: Case, found: Degeneracy) -> list[str]:
    """Return in words where what was found is not what is known; nothing when it is the same."""
    result = []
    silent = frozenset(item.name for item in found.silent)
    if silent != case.silent:
        result.append(f"never loaded: found {sorted(silent)}, known {sorted(case.silent)}")
    for kind, known in (("series", case.series), ("parallel", case.parallel)):
        groups = frozenset(frozenset(group.members) for group in found.joined if group.kind == kind)
        if groups != known:
            result.append(f"{kind}: found {_sorted(groups)}, known {_sorted(known)}")
    return result + [f"mixed: {group.members}" for group in found.mixed]


def _sorted(groups: Groups) -> list[list[str]]:
    return sorted(sorted(group) for group in groups)
