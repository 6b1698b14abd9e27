"""Where a machine could be compliant: the wrench through every place, and what a slip there moves.

Every joint, link, the base and the flange is a place. A row's load passes a wrench q through it, linear in
the load; a relative displacement e there moves the measured point by ``T^T e``, T the wrench at the place per
unit wrench at the point (Betti's reciprocity; the structure stays in series with the slip). An effect is then
a law ``e(q)``, whatever the machine: serial or with closed loops.

All places are opened as ports at once (`fem.condensation`): with F the springs and R the rigid directions::

    e_F = (S_FF + k_F)^-1 (B_F w + g_F)       q_F = k_F e_F       q_R = B_R w + g_R - S_RF e_F

In a loop whose rigid parts let the directions of a place move only together, or not at all, those that are
independent stand for all (`self_stress`). What statics does not determine of q_R counts as zero,
and is named.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.residual.place import Place, nothing_of
from beamstiff.diagnosis.residual.self_stress import Reach, everywhere, reach_of, self_stresses
from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.beam_element import beam_axes, beam_stiffness
from beamstiff.fem.condensation import Condensed, Port, condense, without_ports
from beamstiff.fem.loads import gravity_wrenches, mass_wrenches
from beamstiff.fem.placed_structure import SHORTEST, Geometry, place
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.fem.unknowns import joint_values
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import opened
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import Posture, compile_kinematics, posture
from beamstiff.robot.parts import STIFFNESS_KINDS, Joint, JointStiffness
from beamstiff.se3 import Array, displacement_transport, rotate_screw

ASIDE = 0.65  # of a unit vector: at least one of its three components is smaller
SAME = 1e-7  # share of the largest entry within which changes of axes are the same
NAME = re.compile(r"[A-Za-z_]\w*")  # in an expression
MOST_NAMED = 12  # of what a self-stress needs
CUT = " cut"  # what is added to the name of a link's end to name its other side; no name of a file ends so


@dataclass(frozen=True)
class Places:
    """All places of a machine under the rows of a table.

    `joints`: by name of the joint; first axis along the joint's axis.
    `links`: by name of the beam or rigid, at its second end; first axis along the link.
    `base`: the whole machine against the floor, about the base frame's origin.
    `flange`: what the TCP carries against what holds it, axes of the TCP's frame.
    `held`: joints and links that pass wrenches which are not determined, and which self-stress leaves them
        open.
    `standing`: links that stand on the ground and that all passes which passes the floor: what they give is
        the base's by another name.
    """

    joints: dict[str, Place]
    links: dict[str, Place]
    base: Place
    flange: Place
    held: dict[str, str]
    standing: tuple[str, ...] = ()

    def beside(self, other: Self) -> Self:
        """Return the places under their loads and those of others, of the same machine in the same rows."""
        joints = {name: there.beside(other.joints[name]) for name, there in self.joints.items()}
        links = {name: there.beside(other.links[name]) for name, there in self.links.items()}
        base, flange = self.base.beside(other.base), self.flange.beside(other.flange)
        return replace(self, joints=joints, links=links, base=base, flange=flange)


def find_places(robot: Robot, rows: Measurements) -> Places:
    """Return every place of a robot under the rows of a table.

    `robot`: with the stiffness that it has.
    `rows`: N rows: posture, wrench, point of the load and measured point.
    Raises BeamstiffError when a pose cannot close its loops or the structure is a mechanism.
    """
    cut, links = _with_cuts(robot, rows.q[:1])
    index = {node.name: at for at, node in enumerate(cut.nodes)}
    poses, number = np.unique(rows.q, axis=0, return_inverse=True)
    pose = number.reshape(-1)
    where = posture(compile_kinematics(cut), poses)
    names = [*(joint.name for joint in cut.joints), *(beam.name for beam in cut.beams)]
    # in a loop the slips of its places depend on one another: there, one place at a time
    together = [[name] for name in names] if has_loops(cut) else [names]
    found: dict[str, Place] = {}
    links_found: dict[str, Place] = {}
    refused: dict[str, str] = {}
    for group in together:
        try:
            opened_places = _open(cut, group, rows, poses, pose, alone=len(together) > 1)
        except BeamstiffError as error:
            if len(together) == 1:
                raise
            opened_places = {group[0]: nothing_of(len(rows))}
            refused[group[0].removesuffix(CUT)] = str(error)
        for name, there in opened_places.items():
            if name in links:
                a, b = (index[node] for node in links[name])
                along = (where.node_positions[:, b] - where.node_positions[:, a])[pose]
                links_found[name.removesuffix(CUT)] = _turned(there, along).determined()
            elif name in {beam.name for beam in cut.beams}:
                links_found[name] = there
            else:
                found[name] = there.determined()
    tcp_frame = compile_kinematics(cut).node_frame[index[robot.tcp]]
    points = [index[name] for name in rows.point.tolist()]
    structure = compile_structure(cut)
    geometry = place(structure, where)
    weight, hung = gravity_wrenches(structure, geometry), mass_wrenches(structure, geometry)
    base = _base(rows, where, weight, index, pose)
    return Places(
        joints=found,
        links=links_found,
        base=base,
        flange=_flange(
            robot,
            rows,
            where.transforms[:, tcp_frame, :3, :3][pose],
            hung[pose, index[robot.tcp]],
            (where.node_positions - where.node_positions[:, [index[robot.tcp]]])[pose, points],
        ),
        held=_held(cut, where, found, links_found, refused),
        standing=tuple(
            name
            for name in _on_the_ground(robot)
            if name in links_found and _is_base(links_found[name], base)
        ),
    )


def _body(robot: Robot) -> list[str]:
    """Return the nodes that rigids join to the TCP."""
    graph = nx.Graph(part.nodes for part in robot.rigids)
    graph.add_node(robot.tcp)
    return list(nx.node_connected_component(graph, robot.tcp))


def _on_the_ground(robot: Robot) -> set[str]:
    """Return the beams and rigids whose ends do not move with any joint."""
    moving = {variable.name for variable in robot.variables}
    ground = {"base"}
    for _ in robot.frames:
        ground |= {
            frame.name
            for frame in robot.frames
            if frame.parent in ground
            and not any(
                isinstance(value, str) and not moving.isdisjoint(NAME.findall(value))
                for value in frame.model_dump(exclude={"name", "parent"}).values()
            )
        }
    at = {node.name: node.frame for node in robot.nodes}
    found = {beam.name for beam in robot.beams if {at[node] for node in beam.nodes} <= ground}
    return found | {rigid.name for rigid in robot.rigids if {at[node] for node in rigid.nodes} <= ground}


def _is_base(there: Place, base: Place) -> bool:
    """Return whether one change of axes, the same in all rows, makes the floor of a place."""
    change = np.linalg.solve(base.shift, there.shift)  # (N, 6, 6)
    moved, passed = np.abs(change - change[0]).max(), np.abs(there.load - base.load @ change[0]).max()
    least = SAME * np.abs(change[0]).max()
    return bool(moved < least and passed < least * np.abs(base.load).max(initial=1.0))


def has_loops(robot: Robot) -> bool:
    """Return whether the structure closes loops (the floor counts as one node)."""
    floor = robot.fixed[0]
    graph: nx.MultiGraph[str] = nx.MultiGraph()
    pairs = [beam.nodes for beam in robot.beams] + [rigid.nodes for rigid in robot.rigids]
    pairs += [joint.nodes for joint in robot.joints] + [strut.nodes for strut in robot.struts]
    for pair in pairs:
        a, b = (floor if name in robot.fixed else name for name in pair)
        graph.add_edge(a, b)
    count = nx.number_connected_components(graph)
    return int(graph.number_of_edges() - graph.number_of_nodes() + count) > 0


def _open(
    cut: Robot, names: Sequence[str], rows: Measurements, poses: Array, pose: NDArray[np.intp], alone: bool
) -> dict[str, Place]:
    """Return some joints and beams as places, opened as ports at once; `alone`: one that a loop may hold."""
    chosen = [joint for joint in cut.joints if joint.name in names]
    structure = compile_structure(
        opened(cut, [f"{joint.name}.{kind}" for joint in chosen for kind in STIFFNESS_KINDS])
    )
    where = posture(structure.kinematics, poses)
    geometry = place(structure, where)
    joints = [at for at, joint in enumerate(cut.joints) if joint.name in names]
    beams = [at for at, beam in enumerate(cut.beams) if beam.name in names]
    ports = [Port(cut.joints[at].name, "joint", at, side) for at in joints for side in range(6)]
    ports += [Port(cut.beams[at].name, "beam", at, side) for at in beams for side in range(6)]
    observed = list(dict.fromkeys([*rows.point.tolist(), *rows.load_point.tolist()]))
    springs, rigid = _springs(cut, structure, geometry, ports)
    reach = reach_of(structure, geometry, ports, rigid) if alone else everywhere(rigid)
    free = without_ports(structure, ports)
    condensed = condense(free, where, observed, [ports[at] for at in (*reach.held, *reach.loose)])
    wrench, dead = _passed(condensed, springs, rigid, reach)
    columns = {name: 6 * at + np.arange(6) for at, name in enumerate(observed)}
    seen = np.array([columns[name] for name in rows.point])
    loaded = np.array([columns[name] for name in rows.load_point])
    each = np.arange(len(pose))[:, None]
    by_point = wrench[pose][each, seen]  # (N, 6, p)
    passed = np.einsum("nap,na->np", wrench[pose][each, loaded], rows.wrench)
    turns = [geometry.joint_rotation[:, at] for at in joints] + [
        geometry.beam_rotation[:, at] for at in beams
    ]
    lengths = [np.zeros(len(poses))] * len(joints) + [geometry.beam_length[:, at] for at in beams]
    items = [cut.joints[at].name for at in joints] + [cut.beams[at].name for at in beams]
    stressed = None if reach.stressed is None else reach.stressed[pose]
    result = {}
    for at, (name, turn, length) in enumerate(zip(items, turns, lengths, strict=True)):
        some = slice(6 * at, 6 * at + 6)
        load, weight, shift = passed[:, some], dead[pose, some], by_point[:, :, some]
        result[name] = Place(load, weight, shift, turn[pose], length[pose], stressed)
    return result


def _held(
    cut: Robot,
    where: Posture,
    joints: Mapping[str, Place],
    links: Mapping[str, Place],
    refused: Mapping[str, str],
) -> dict[str, str]:
    """Return the places with undetermined wrenches, and which self-stress, or what else, leaves them so."""
    places = {**joints, **{name + CUT: there for name, there in links.items()}}
    open_ended = {
        # a link's axes are not those of its cut: all of its directions
        name: [(name, side) for side in range(6) if there.undetermined[side] or name.endswith(CUT)]
        for name, there in places.items()
        if there.undetermined.any() and name.removesuffix(CUT) not in refused
    }
    found = dict(refused)
    for name, needed in (self_stresses(cut, where, open_ended) if open_ended else {}).items():
        of_joints = [one for one in needed if CUT not in one]
        cuts = dict.fromkeys(one.partition(CUT)[0] for one in needed)
        found[name.removesuffix(CUT)] = (
            "rigid parts of its loop leave its forces undetermined: a self-stress of "
            f"{listed(of_joints or cuts, MOST_NAMED)}"
        )
    return found


def _with_cuts(robot: Robot, pose: Array) -> tuple[Robot, dict[str, tuple[str, str]]]:
    """Return the robot with a rigid joint in every rigid of some length at a pose (1, A), and their ends."""
    nodes, rigids, joints = list(robot.nodes), [], list(robot.joints)
    by_name = {node.name: node for node in robot.nodes}
    where = posture(compile_kinematics(robot), pose)
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    links = {}
    for rigid in robot.rigids:
        a, b = (where.node_positions[0, index[name]] for name in rigid.nodes)
        if np.linalg.norm(b - a) < SHORTEST:
            rigids.append(rigid)
            continue
        end = by_name[rigid.nodes[1]]
        other = end.model_copy(update={"name": end.name + CUT + rigid.name})
        nodes.append(other)
        rigids.append(rigid.model_copy(update={"nodes": (rigid.nodes[0], other.name)}))
        joint = Joint.model_construct(
            name=rigid.name + CUT,
            nodes=(other.name, end.name),
            frame=end.frame,
            axis=(0.0, 0.0, 1.0),
            variable=None,
            stiffness=JointStiffness(),
        )
        joints.append(joint)
        links[joint.name] = rigid.nodes
    update = {"nodes": tuple(nodes), "rigids": tuple(rigids), "joints": tuple(joints)}
    return robot.model_copy(update=update), links


def _passed(
    condensed: Condensed, springs: Array, rigid: NDArray[np.bool_], reach: Reach
) -> tuple[Array, Array]:
    """Return wrenches at the ports per unit wrench at observed nodes (P, o, p), and the dead one (P, p).

    Condensed to the directions that move independently. Of rigid ones it is the least that is in balance.
    """
    right = np.concatenate([condensed.port_map, condensed.port_dead[..., None]], axis=2)
    held, share = len(reach.held), reach.share[:, ~rigid]
    own = share.swapaxes(-1, -2) @ springs[:, ~rigid][:, :, ~rigid] @ share
    matrix = condensed.port_stiffness + own
    slip = np.linalg.solve(matrix[:, held:, held:], right[:, held:])
    result = np.zeros((len(right), len(rigid), right.shape[2]))
    result[:, ~rigid] = springs[:, ~rigid][:, :, ~rigid] @ share[:, :, held:] @ slip
    balance = right[:, :held] - matrix[:, :held, held:] @ slip
    result[:, rigid] = reach.reactions @ balance
    return result[:, :, :-1].swapaxes(1, 2), result[:, :, -1]


def _springs(
    robot: Robot, structure: Structure, geometry: Geometry, ports: Sequence[Port]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the stiffness that the ports have in the robot (P, p, p), and which of them are rigid (p,)."""
    joints = [port for port in ports if port.kind == "joint"]
    values = np.array([joint_values(robot.joints[port.index])[port.direction] for port in joints])
    rigid = np.zeros(len(ports), dtype=np.bool_)
    rigid[: len(joints)] = values == RIGID
    result = np.zeros((len(geometry.beam_length), len(ports), len(ports)))
    for at, port in enumerate(ports):
        if (
            port.kind == "beam" and port.direction == 0
        ):  # as long as it is in each pose: some grow with a slide
            own = {name: value[[port.index]] for name, value in structure.beam_properties.items()}
            lengths = geometry.beam_length[:, [port.index]]
            result[:, at : at + 6, at : at + 6] = beam_stiffness(lengths, **own)[:, 0, 6:, 6:]
    diagonal = np.arange(len(joints))
    result[:, diagonal, diagonal] = np.where(rigid[: len(joints)], 0.0, values)
    return result, rigid


def _turned(there: Place, along: Array) -> Place:
    """Return a place in axes whose first is along a vector (N, 3), the others held in its own frame."""
    length = np.linalg.norm(along, axis=1)
    own = (there.turn.swapaxes(-1, -2) @ along[..., None])[..., 0]
    turn = there.turn @ beam_axes(own, across(own[0] / length[0]))
    return replace(there.along(turn), length=length)


def across(direction: Array) -> Array:
    """Return the coordinate axis (3,) that fixes the turn of axes about a direction (3,) of length 1.

    Not the axis farthest from it: of a direction along one axis, the least change would swap the two others.

    >>> across(np.array([0.6, 0.8, 0.0])), across(np.array([0.8, 0.6, 0.0]))
    (array([1., 0., 0.]), array([0., 1., 0.]))
    """
    return np.asarray(np.eye(3)[np.argmax(np.abs(direction) < ASIDE)])


def _base(
    rows: Measurements, where: Posture, weight: Array, index: Mapping[str, int], pose: NDArray[np.intp]
) -> Place:
    """Return the floor under the whole machine, about the origin of the base frame."""
    points, loads = ([index[name] for name in names.tolist()] for names in (rows.point, rows.load_point))
    carry = displacement_transport(where.node_positions)  # (P, nodes, 6, 6)
    dead = np.einsum("pnba,pnb->pa", carry, weight)
    passed = np.einsum("nba,nb->na", carry[pose, loads], rows.wrench)
    axes = np.broadcast_to(np.eye(3), (len(pose), 3, 3))
    return Place(passed, dead[pose], carry[pose, points], axes, np.zeros(len(pose)))


def _flange(robot: Robot, rows: Measurements, turn: Array, weight: Array, offset: Array) -> Place:
    """Return the flange: what loads, hangs or is seen at the TCP passes through it, the rest does not.

    Where nothing is read at the TCP, the reflectors of its body are on the tool: they move with it.

    `turn`: (N, 3, 3) array; axes of the TCP's frame.
    `weight`: (N, 6) array; of masses at the TCP: a beam that ends there carries its own by itself.
    `offset`: (N, 3) array; from the TCP to the measured point.
    """
    behind = [robot.tcp] if (rows.point == robot.tcp).any() else _body(robot)
    axes = displacement_transport(offset) @ rotate_screw(turn)
    loaded = (rows.load_point == robot.tcp).astype(np.float64)
    seen = np.isin(rows.point, behind).astype(np.float64)
    inside = rotate_screw(turn).swapaxes(-1, -2)
    passed = (inside @ rows.wrench[..., None])[..., 0] * loaded[:, None]
    dead = (inside @ weight[..., None])[..., 0]
    return Place(passed, dead, axes * seen[:, None, None], turn, np.zeros(len(dead)))
