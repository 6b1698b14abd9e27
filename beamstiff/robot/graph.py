"""The robot as a graph: nodes joined by beams, rigids, joints and struts; loops and support."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any, TypeAlias

import networkx as nx

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot

    # networkx' classes take their type of node in the stubs only
    Structure: TypeAlias = nx.MultiGraph[str]
    Tree: TypeAlias = nx.DiGraph[str]

GROUND = ""  # no node is called so


def structure_graph(robot: Robot) -> Structure:
    """Return the structure as a multigraph: an edge an element, with its ``kind`` and ``name``."""
    graph: Structure = nx.MultiGraph(name=robot.name)
    fixed = set(robot.fixed)
    for node in robot.nodes:
        graph.add_node(node.name, frame=node.frame, fixed=node.name in fixed, tcp=node.name == robot.tcp)
    for kind in ("beam", "rigid", "joint", "strut"):
        for item in getattr(robot, f"{kind}s"):
            one, other = item.nodes
            graph.add_edge(one, other, key=item.name, name=item.name, kind=kind)
    return graph


def carrying_parts(robot: Robot) -> set[str]:
    """Return the elements that lie on a way from the support to the TCP, loops included."""
    graph = structure_graph(robot)
    simple: nx.Graph[str] = nx.Graph(graph)
    simple.add_edges_from((GROUND, node) for node in robot.fixed)
    simple.add_edge(GROUND, robot.tcp)  # whatever lies on a way is on a loop with this edge
    components: Any = nx.biconnected_components(simple)  # sets, which the stubs take for lists
    for component in components:
        if {GROUND, robot.tcp} <= component:
            inside = graph.subgraph(component)
            return {str(name) for _, _, name in inside.edges(keys=True)}
    return set()


def joined(robot: Robot, node: str) -> dict[str, int]:
    """Return the nodes that rigids and beams join to a node, itself first, and how many lie between."""
    graph: nx.Graph[str] = nx.Graph()
    graph.add_node(node)
    graph.add_edges_from(part.nodes for part in robot.rigids)
    graph.add_edges_from(part.nodes for part in robot.beams)
    return dict(nx.single_source_shortest_path_length(graph, node))


def parts_without_support(graph: Structure, fixed: Collection[str]) -> list[set[str]]:
    """Return the connected parts that hold no fixed node, the largest first."""
    supported = set(fixed)
    parts = [set(part) for part in nx.connected_components(graph)]
    return sorted((part for part in parts if not part & supported), key=len, reverse=True)


def structural_loops(graph: Structure, fixed: Collection[str] = ()) -> list[list[str]]:
    """Return a cycle basis as lists of nodes, two-node cycles (elements side by side) included.

    Loops close over the ground too: such a one starts and ends with a node of `fixed`.
    """
    simple: nx.Graph[str] = nx.Graph(graph)
    parallel = [sorted(pair) for pair in simple.edges if graph.number_of_edges(*pair) > 1]
    simple.add_edges_from((GROUND, node) for node in fixed)
    loops = []
    for loop in nx.cycle_basis(simple):
        at = loop.index(GROUND) if GROUND in loop else -1
        loops.append(loop[at + 1 :] + loop[: max(at, 0)])
    return [*loops, *parallel]


def support_tree(graph: Structure, fixed: Collection[str]) -> Tree:
    """Return the spanning tree of shortest paths from the fixed nodes."""
    tree: Tree = nx.DiGraph()
    tree.add_nodes_from(graph.nodes(data=True))
    reached, front = set(fixed), list(fixed)
    while front:
        following = []
        for node in front:
            for neighbour in graph.neighbors(node):
                if neighbour not in reached:
                    reached.add(neighbour)
                    tree.add_edge(node, neighbour)
                    following.append(neighbour)
        front = following
    return tree
