import itertools

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import Joint, JointStiffness, Node, Rigid, Robot, Strut
from beamstiff.robot.graph import (
    joined,
    parts_without_support,
    structural_loops,
    structure_graph,
    support_tree,
)
from beamstiff.robot.reader import load_robot, parse_robot


def links(edges: list[tuple[int, int]], nodes: int, fixed: list[int]) -> nx.MultiGraph:
    robot = Robot(
        name="links",
        nodes=[Node(name=f"n{at}") for at in range(nodes)],
        # joined to the ground where the edges leave it, so that the description is accepted
        rigids=[
            Rigid(name=f"r{at}", nodes=(f"n{one}", f"n{other}")) for at, (one, other) in enumerate(edges)
        ],
        fixed=[f"n{at}" for at in fixed],
        tcp="n0",
    )
    return structure_graph(robot)


def test_every_node_and_element_is_in_the_graph_with_what_it_is(everything: str) -> None:
    robot = parse_robot(everything)
    graph = structure_graph(robot)
    assert graph.graph["name"] == "everything"
    assert set(graph) == {node.name for node in robot.nodes}
    kinds = {name: kind for *_, name, kind in graph.edges(keys=True, data="kind")}
    assert kinds == {
        **dict.fromkeys(("column", "swing", "arm"), "beam"),
        **dict.fromkeys(("crank", "socket"), "rigid"),
        **dict.fromkeys(("J1", "J2", "J33"), "joint"),
        **dict.fromkeys(("screw", "rod"), "strut"),
    }
    assert graph.nodes["n0"] == {"frame": "base", "fixed": True, "tcp": False}
    assert graph.nodes["tip"] == {"frame": "f6", "fixed": False, "tcp": True}
    assert set(graph["n1"]["n2"]) == {"J2"}


def test_elements_side_by_side_are_all_kept() -> None:
    stiffness = JointStiffness(torsional=1.0)
    robot = Robot(
        name="two",
        frames=[{"name": "f"}],
        nodes=[Node(name="a"), Node(name="b", frame="f")],
        joints=[
            Joint(name=name, nodes=("a", "b"), frame="f", stiffness=stiffness) for name in ("left", "right")
        ],
        struts=[Strut(name="middle", nodes=("b", "a"), stiffness=1.0)],
        fixed=["a"],
        tcp="b",
    )
    graph = structure_graph(robot)
    assert set(graph["a"]["b"]) == {"left", "right", "middle"}
    assert structural_loops(graph) == [["a", "b"]]


def test_a_loop_over_the_ground_runs_from_one_fixed_node_to_another() -> None:
    robot = load_robot("tripod")
    graph = structure_graph(robot)
    assert structural_loops(graph) == []
    loops = structural_loops(graph, robot.fixed)
    assert len(loops) == len(robot.fixed) - 1
    for loop in loops:
        assert {loop[0], loop[-1]} <= set(robot.fixed)
        assert loop[0] != loop[-1]
        assert all(graph.has_edge(*edge) for edge in itertools.pairwise(loop))
    one_foot = load_robot("ir663")
    graph = structure_graph(one_foot)
    [loop], [same] = structural_loops(graph), structural_loops(graph, one_foot.fixed)
    assert set(loop) == set(same)


def test_loops_of_the_four_bar_are_found(everything: str) -> None:
    graph = structure_graph(parse_robot(everything))
    loops = structural_loops(graph)
    for loop in loops:
        assert len(set(loop)) == len(loop) > 2
        assert all(graph.has_edge(*edge) for edge in zip(loop, loop[1:] + loop[:1], strict=True))
    assert len(loops) == graph.number_of_edges() - graph.number_of_nodes() + 1


connected = st.integers(2, 12).flatmap(
    lambda nodes: st.tuples(
        st.just(nodes),
        st.tuples(*[st.integers(0, at - 1) for at in range(1, nodes)]),
        st.lists(
            st.tuples(st.integers(0, nodes - 1), st.integers(0, nodes - 1)).filter(lambda e: e[0] != e[1]),
            max_size=5,
        ),
        st.sets(st.integers(0, nodes - 1), min_size=1, max_size=3),
    )
)


@given(connected)
def test_the_support_tree_reaches_every_node_by_a_shortest_path(drawn: tuple) -> None:
    nodes, parents, extra, fixed = drawn
    edges = [(parent, at) for at, parent in enumerate(parents, start=1)] + extra
    graph = links(edges, nodes, sorted(fixed))
    ground = [f"n{at}" for at in sorted(fixed)]
    tree = support_tree(graph, ground)
    assert set(tree) == set(graph)
    assert tree.number_of_edges() == nodes - len(fixed)
    distances = nx.multi_source_dijkstra_path_length(graph, set(ground))
    for node in tree:
        above = list(tree.predecessors(node))
        assert len(above) == (0 if node in ground else 1)
        if above:
            assert distances[node] == distances[above[0]] + 1
    assert parts_without_support(graph, ground) == []


@given(connected)
def test_the_number_of_loops_is_eulers(drawn: tuple) -> None:
    nodes, parents, extra, fixed = drawn
    edges = [(parent, at) for at, parent in enumerate(parents, start=1)] + extra
    graph = links(edges, nodes, sorted(fixed))
    pairs = {frozenset(edge) for edge in edges}
    side_by_side = sum(1 for pair in pairs if sum(frozenset(edge) == pair for edge in edges) > 1)
    assert len(structural_loops(graph)) == len(pairs) - nodes + 1 + side_by_side


@pytest.mark.parametrize("fixed", [["a"], ["a", "e"], []])
def test_parts_without_support_are_told_the_largest_first(fixed: list[str]) -> None:
    graph = nx.MultiGraph([("a", "b"), ("c", "d"), ("d", "e"), ("f", "f2"), ("f2", "f3"), ("f3", "f4")])
    graph.add_node("g")
    expected = [{"f", "f2", "f3", "f4"}, {"c", "d", "e"}, {"a", "b"}, {"g"}]
    hanging = [part for part in expected if not part & set(fixed)]
    assert parts_without_support(graph, fixed) == hanging


def test_what_hangs_together_ends_at_joints_and_struts() -> None:
    """A foot with a rod on it, a joint, two rods behind each other, and a strut from the last to the foot."""
    robot = Robot(
        name="mast",
        nodes=[Node(name=name) for name in ("foot", "seat", "hub", "middle")]
        + [Node(name="tip", at=(0, 0, 1))],
        rigids=[
            Rigid(name="far", nodes=("middle", "tip")),
            Rigid(name="near", nodes=("hub", "middle")),
            Rigid(name="post", nodes=("foot", "seat")),
        ],
        joints=[Joint(name="J", nodes=("seat", "hub"), frame="base", stiffness=JointStiffness())],
        struts=[Strut(name="stay", nodes=("tip", "foot"), stiffness=1e6)],
        fixed=["foot"],
        tcp="tip",
    )
    assert joined(robot, "foot") == {"foot": 0, "seat": 1}
    assert list(joined(robot, "hub").items()) == [("hub", 0), ("middle", 1), ("tip", 2)]
