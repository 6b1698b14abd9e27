"""A robot compiled for the stiffness path: element tables, unknowns and sparse pattern, once per graph."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamstiff.fem.beam_element import beam_axes
from beamstiff.fem.unknowns import Unknowns, joint_unknowns, joint_values, number_unknowns
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import Kinematics, compile_kinematics
from beamstiff.robot.planar_loops import bearings_in_plane
from beamstiff.robot.reader import RobotLike, as_robot
from beamstiff.robot.sections import section_properties
from beamstiff.se3 import Array

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Pattern:
    """Where the contributions of the elements go in the reduced global stiffness, found once per graph."""

    # element, end_i, end_j, term_i, term_j, (M,): one 6x6 product each: block (end_i, end_j) of an element
    # between two terms
    element: Index
    end_i: Index
    end_j: Index
    term_i: Index
    term_j: Index
    # order, starts: sort the kept entries of all products, and where each entry of the matrix begins in that
    # order
    order: Index
    starts: Index
    # rows, columns, (nnz,): position of each entry, by column, then row
    rows: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class Structure:
    """A robot's elements as arrays, and how its unknowns are numbered."""

    robot: Robot
    kinematics: Kinematics
    unknowns: Unknowns
    pattern: Pattern
    # (E, 2): nodes of the elements that carry stiffness between nodes: the beams, then the joints `chords`
    # that close loops (their finite directions), then the `struts`
    elements: Index
    beam_properties: dict[str, Array]
    beam_up: Array
    beam_frame: Index
    beam_density: Array
    chords: Index
    chord_values: Array
    struts: Index
    strut_values: Array  # (S,), N/m: without what their own length adds
    springs: Index  # (S,): unknowns with a spring of their own: finite directions of joints on the tree
    spring_values: Array  # (S,), N/m or N m/rad
    joint_axes: Array  # (J, 3, 3): each joint's frame (first axis along the joint) against its robot frame
    joint_frame: Index
    joint_nodes: Index
    joint_normal: Index  # (J,): frame whose z axis a bearing of a plane loop turns about; -1: its own axis


def compile_structure(robot: RobotLike) -> Structure:
    """Compile a robot: everything that does not depend on the pose.

    Examples
    --------
    >>> from beamstiff import load_robot
    >>> compile_structure(load_robot("ir663")).unknowns.count <= 60
    True
    """
    robot = as_robot(robot)
    kinematics = compile_kinematics(robot)
    unknowns = number_unknowns(robot)
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    frames = kinematics.frame_index

    def ends(items: list[tuple[str, str]]) -> Index:
        return np.array([[index[a], index[b]] for a, b in items], dtype=np.int64).reshape(-1, 2)

    values = np.array([joint_values(joint) for joint in robot.joints]).reshape(-1, 6)
    # rigid directions of loop-closing joints are constraints, not springs
    finite = np.where(values == RIGID, FREE, values)
    chords = np.array([at for at in unknowns.chord_joints if finite[at].any()], dtype=np.int64)
    elastic = [at for at, strut in enumerate(robot.struts) if not strut.rigid and strut.stiffness != FREE]
    struts = np.array(elastic, dtype=np.int64)
    elements = np.concatenate(
        [
            ends([beam.nodes for beam in robot.beams]),
            ends([robot.joints[at].nodes for at in chords]),
            ends([robot.struts[at].nodes for at in struts]),
        ]
    )
    springs = [
        (number, finite[joint, direction])
        for (joint, direction), number in joint_unknowns(unknowns).items()
        if finite[joint, direction] != FREE
    ]
    sections = [section_properties(robot.sections[beam.section]) for beam in robot.beams]
    materials = [robot.materials[beam.material] for beam in robot.beams]
    properties = {
        name: np.array([getattr(section, name) or np.inf for section in sections], dtype=np.float64)
        for name in ("A", "Iy", "Iz", "J", "Ay", "Az")
    }
    properties |= {name: np.array([getattr(material, name) for material in materials]) for name in ("E", "G")}
    axes = np.array([joint.axis for joint in robot.joints], dtype=np.float64).reshape(-1, 3)
    joint_frame = np.array([frames[joint.frame] for joint in robot.joints], dtype=np.int64)
    joint_axes = beam_axes(axes, np.full((len(robot.joints), 3), np.nan))
    spring_index = np.array([spring[0] for spring in springs], dtype=np.int64)
    return Structure(
        robot=robot,
        kinematics=kinematics,
        unknowns=unknowns,
        pattern=_find_pattern(elements, unknowns, spring_index),
        elements=elements,
        beam_properties=properties,
        beam_up=np.array([beam.up or (np.nan,) * 3 for beam in robot.beams], dtype=np.float64).reshape(-1, 3),
        beam_frame=kinematics.node_frame[elements[: len(robot.beams), 0]],
        beam_density=np.array([material.density for material in materials], dtype=np.float64),
        chords=chords,
        chord_values=finite[chords],
        struts=struts,
        strut_values=np.array([robot.struts[at].stiffness for at in struts], dtype=np.float64),
        springs=spring_index,
        spring_values=np.array([spring[1] for spring in springs], dtype=np.float64),
        joint_axes=joint_axes,
        joint_frame=joint_frame,
        joint_nodes=ends([joint.nodes for joint in robot.joints]),
        joint_normal=bearings_in_plane(kinematics, joint_frame, joint_axes[:, :, 0]),
    )


def _find_pattern(elements: Index, unknowns: Unknowns, springs: Index) -> Pattern:
    """Find once which products of element blocks and terms there are, and where their entries go."""
    nodes = 1 + int(max(elements.max(initial=-1), unknowns.term_node.max(initial=-1)))
    terms_of: list[list[int]] = [[] for _ in range(nodes)]
    for term, node in enumerate(unknowns.term_node):
        terms_of[node].append(term)
    products = []
    for at, (a, b) in enumerate(elements.tolist()):
        # what moves both ends moves them as one body: it strains nothing, its sums leave rounding errors
        blocks = [{int(unknowns.term_block[term]) for term in terms_of[node]} for node in (a, b)]
        moving = [
            [term for term in terms_of[node] if unknowns.term_block[term] not in blocks[0] & blocks[1]]
            for node in (a, b)
        ]
        products += [(at, i, j, s, t) for i in (0, 1) for j in (0, 1) for s in moving[i] for t in moving[j]]
    element, end_i, end_j, term_i, term_j = np.array(products, dtype=np.int64).reshape(-1, 5).T
    count = unknowns.count
    term_unknowns = unknowns.blocks[unknowns.term_block]
    row = np.broadcast_to(term_unknowns[term_i][:, :, None], (element.size, 6, 6)).reshape(-1)
    column = np.broadcast_to(term_unknowns[term_j][:, None, :], (element.size, 6, 6)).reshape(-1)
    place = np.where((row >= 0) & (column >= 0), column * count + row, -1)
    # every unknown has a diagonal entry, also one that nothing resists: a mechanism must show as a zero pivot
    place = np.concatenate([place, springs * (count + 1), np.arange(count) * (count + 1)])
    order = np.argsort(place, kind="stable")
    order = order[np.searchsorted(place[order], 0) :]
    sorted_place = place[order]
    starts = np.flatnonzero(np.diff(sorted_place, prepend=-1))
    entries = sorted_place[starts]
    return Pattern(
        element,
        end_i,
        end_j,
        term_i,
        term_j,
        order=order,
        starts=starts,
        rows=entries % max(count, 1),
        columns=entries // max(count, 1),
    )
