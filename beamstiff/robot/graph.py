"""The robot as a graph: nodes joined by beams, rigids, joints and struts; what hangs where."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import networkx as nx

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


def structure_graph(robot: Robot) -> nx.MultiGraph:
    """Return the structure as a multigraph: an edge an element, with its ``kind`` and ``name``.

    Examples
    --------
    >>> from beamstiff.robot.library import load_library_robot
    >>> sorted(structure_graph(load_library_robot("cantilever")).edges(data="kind"))[0][2]
    'beam'
    """
    graph = nx.MultiGraph(name=robot.name)
    for node in robot.nodes:
        graph.add_node(
            node.name, frame=node.frame, fixed=node.name in robot.fixed, tcp=node.name == robot.tcp
        )
    for kind in ("beam", "rigid", "joint", "strut"):
        for item in getattr(robot, f"{kind}s"):
            graph.add_edge(*item.nodes, key=item.name, name=item.name, kind=kind)
    return graph


def parts_without_support(graph: nx.MultiGraph, fixed: Collection[str]) -> list[set[str]]:
    """Return the connected parts that hold no fixed node, the largest first."""
    parts = [set(part) for part in nx.connected_components(graph)]
    return sorted((part for part in parts if not part & set(fixed)), key=len, reverse=True)


def structural_loops(graph: nx.MultiGraph) -> list[list[str]]:
    """Return a cycle basis as lists of nodes, two-node cycles (elements side by side) included."""
    simple = nx.Graph(graph)
    parallel = [sorted(pair) for pair in simple.edges if graph.number_of_edges(*pair) > 1]
    return [*nx.cycle_basis(simple), *parallel]


def support_tree(graph: nx.MultiGraph, fixed: Collection[str]) -> nx.DiGraph:
    """Return the spanning tree of shortest paths from the fixed nodes: what hangs on what."""
    tree = nx.DiGraph()
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
