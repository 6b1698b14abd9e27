"""The reduced stiffness of a structure written down as expressions of the joint variables.

It is the stiffness of `assembly` in coordinates that turn with the machine: a root's displacement is written
in the frame of its node, and each element sees its ends from its own frame. What lies between two joints is
then a constant, and the angles enter only where parts meet that turn against one another.
"""

import itertools
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.expression_graph.expression import Expression, square_root
from beamstiff.fem.beam_element import beam_axes, beam_stiffness
from beamstiff.fem.placed_structure import SHORTEST
from beamstiff.fem.structure import Structure
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.robot.forward import chain_to, place

# m: nodes of a joint that lie nearer than this are one point
TOGETHER = 1e-11
ACROSS = 1e-4  # square of the sine between a beam and what `up` is taken for
ROUNDING = 1e-15  # of a product of rotations by given angles

Entries = NDArray[Any]  # of expressions and numbers
Symmetric = dict[tuple[int, int], "Expression | float"]  # by row and column, row <= column


class Unfit(Exception):  # noqa: N818 - no error of the user's
    """A structure that has to go the general way, at all its poses."""


class RecordedStiffness:
    """A structure as expressions of the values of all variables."""

    def __init__(
        self, structure: Structure, values: NDArray[Any], ports: frozenset[int] = frozenset()
    ) -> None:
        self.structure, self.kinematics = structure, structure.kinematics
        self._values = values[None]
        self.matrix: Symmetric = {}  # stiffness by unknown and unknown, without the springs of the ports
        # each positive where the structure is as it was taken to be: joints together, beams of some length
        self.sound: list[Expression] = []
        self.rotation = cache(self._rotation)
        self._placed = cache(self._place)
        self._join_joints()
        for at, value in zip(structure.springs.tolist(), structure.spring_values, strict=True):
            if at not in ports:
                self._add(at, at, float(value))
        for at in range(len(structure.elements)):
            self._add_element(at)

    def _place(self, top: int, frame: int) -> tuple[Entries, Entries]:
        """Return rotation (3, 3) and origin (3,) of a frame seen from one above it."""
        chain = chain_to(self.kinematics, frame)
        bodies, _ = place(self.kinematics, self._values, chain[chain.index(top) :])
        return _rounded(bodies[-1].axes[:, :, 0].T), _rounded(bodies[-1].origin[:, 0])

    def _top(self, *frames: int) -> int:
        """Return the last frame that all chains share."""
        chains = [chain_to(self.kinematics, frame) for frame in frames]
        shared: set[int] = set.intersection(*map(set, chains))
        return max(shared)  # parents come first

    def _rotation(self, to: int, frame: int) -> Entries:
        """Return the rotation (3, 3) from the coordinates of one frame to those of another."""
        top = self._top(to, frame)
        there, here = self._placed(top, to)[0], self._placed(top, frame)[0]
        return _rounded(_product(there.T, here))

    def arm(self, first: int, second: int, frame: int) -> Entries:
        """Return the way from one node to another (3,), in the coordinates of a frame."""
        if self._joined[first] == self._joined[second]:
            return np.zeros(3)
        # of the nodes that lie at one point, those in one frame
        frames, at = self.kinematics.node_frame, self.kinematics.node_at
        near, far = (self._points[self._joined[node]] for node in (first, second))
        for a, b in itertools.product(near, far):
            if frames[a] == frames[b]:
                return _rounded(_product(self.rotation(frame, int(frames[a])), at[b] - at[a]))
        top = self._top(int(frames[first]), int(frames[second]))
        way = _rounded(self._position(second, top) - self._position(first, top))
        return _rounded(_product(self.rotation(frame, top), way))

    def _position(self, node: int, top: int) -> Entries:
        rotation, origin = self._placed(top, int(self.kinematics.node_frame[node]))
        return _rounded(_product(rotation, self.kinematics.node_at[node]) + origin)

    def _join_joints(self) -> None:
        """Take the nodes of a joint for one point, and note where they have to be."""
        nodes = len(self.structure.robot.nodes)
        self._joined = list(range(nodes))
        for a, b in self.structure.joint_nodes.tolist():
            top = self._top(*(int(self.kinematics.node_frame[node]) for node in (a, b)))
            gap = self._position(b, top) - self._position(a, top)
            square = _dot(gap, gap)
            self.must_be_positive(1.0 - square * TOGETHER**-2)
            old, new = self._joined[b], self._joined[a]
            self._joined = [new if point == old else point for point in self._joined]
        self._points = {
            point: [node for node in range(nodes) if self._joined[node] == point] for point in self._joined
        }

    def map_of(self, node: int, frame: int, without: frozenset[int] = frozenset()) -> dict[int, Entries]:
        """Return how a node moves per unit of each unknown: ``[d, r]`` (6,) in the coordinates of a frame."""
        structure, unknowns = self.structure, self.structure.unknowns
        columns: dict[int, Entries] = {}
        for term in np.flatnonzero(unknowns.term_node == node):
            block, origin = int(unknowns.term_block[term]), int(unknowns.term_origin[term])
            if block in without:
                continue
            joint = int(unknowns.block_joint[block])
            if joint < 0:
                turn = self.rotation(frame, int(self.kinematics.node_frame[origin]))
            else:
                turn = _product(
                    self.rotation(frame, int(structure.joint_frame[joint])), structure.joint_axes[joint]
                )
            turn = _rounded(turn) * int(unknowns.term_sign[term])
            arm = self.arm(origin, node, frame)
            for direction, unknown in enumerate(unknowns.blocks[block].tolist()):
                if unknown < 0:
                    continue
                axis, still = turn[:, direction % 3], np.zeros(3)
                column = [axis, still] if direction < 3 else [_cross(axis, arm), axis]
                columns[unknown] = np.concatenate(column) + columns.get(unknown, np.zeros(6))
        return columns

    def must_be_positive(self, value: Expression | float) -> None:
        """Note a condition of all that follows; a number that is not positive ends it here."""
        if isinstance(value, Expression):
            self.sound.append(value)
        elif not value > 0.0:
            raise Unfit

    def _add(self, row: int, column: int, value: Expression | float) -> None:
        key = (min(row, column), max(row, column))
        total = self.matrix.get(key, 0.0) + value
        self.matrix[key] = total if isinstance(total, Expression) else float(total)

    def _add_element(self, at: int) -> None:
        """Add ``E^T k E``, with E the deformation: second end against the first carried along."""
        structure, unknowns = self.structure, self.structure.unknowns
        a, b = structure.elements[at].tolist()
        beams, chords = len(structure.robot.beams), len(structure.chords)
        frame = int(self.kinematics.node_frame[a])
        blocks = [set(unknowns.term_block[unknowns.term_node == node].tolist()) for node in (a, b)]
        both = frozenset(blocks[0] & blocks[1])  # moves the element as one body
        near, far = (self.map_of(node, frame, both) for node in (a, b))
        arm = self.arm(a, b, frame) if at < beams else np.zeros(3)
        if at < beams:
            stiffness, axes = self._beam(at, arm)
            rows = np.arange(6)
        elif at < beams + chords:
            joint = int(structure.chords[at - beams])
            stiffness = np.diag(structure.chord_values[at - beams])
            axes = _product(
                self.rotation(frame, int(structure.joint_frame[joint])), structure.joint_axes[joint]
            )
            rows = np.flatnonzero(structure.chord_values[at - beams])
        else:
            way = self.arm(a, b, frame)
            length = self._length(way)
            axes = np.array([[part / length, 0.0, 0.0] for part in way], dtype=object)
            stiffness = np.zeros((6, 6), dtype=object)
            stiffness[0, 0] = self._strut(at - beams - chords, length)
            rows = np.arange(1)
        strain: dict[int, Entries] = {}
        for unknown in {*near, *far}:
            move = far.get(unknown, np.zeros(6))
            if unknown in near:
                first = near[unknown]
                carried = np.concatenate([first[:3] + _cross(first[3:], arm), first[3:]])
                move = move - carried
            local = np.concatenate([_product(axes.T, move[:3]), _product(axes.T, move[3:])])
            strain[unknown] = _rounded(local)[rows]
        some = stiffness[np.ix_(rows, rows)]
        forces = {unknown: _product(some, move) for unknown, move in strain.items()}
        order = sorted(strain)
        for number, row in enumerate(order):
            for column in order[number:]:
                value = _dot(strain[row], forces[column])
                if isinstance(value, Expression) or value != 0.0:
                    self._add(row, column, value)

    def dead_loads(self) -> dict[int, Any]:
        """Return the force of the dead weight on each unknown (see `loads.gravity_wrenches`)."""
        structure, robot = self.structure, self.structure.robot
        loads: dict[int, Any] = {}

        def load(node: int, frame: int, force: Entries, moment: Entries) -> None:
            for unknown, column in self.map_of(node, frame).items():
                loads[unknown] = loads.get(unknown, 0.0) + _dot(column[:3], force) + _dot(column[3:], moment)

        per_metre = structure.beam_density * np.nan_to_num(structure.beam_properties["A"], posinf=0.0)
        gravity = np.array(robot.gravity)
        for (a, b), heavy in zip(structure.elements.tolist(), per_metre.tolist(), strict=False):
            frame = int(self.kinematics.node_frame[a])
            arm = self.arm(a, b, frame)
            weight = _product(self.rotation(frame, 0), heavy * gravity)
            length = self._length(arm)
            couple = _cross(arm, weight) * (length * (1 / 12))
            load(a, frame, weight * (length * 0.5), couple)
            load(b, frame, weight * (length * 0.5), -couple)
        turning = turning_nodes(robot)
        for mass in robot.masses:
            if mass.node not in turning and any(mass.at):
                raise Unfit
            node = self.kinematics.node_index[mass.node]
            frame = int(self.kinematics.node_frame[node])
            weight = _product(self.rotation(frame, 0), mass.mass * gravity)
            load(node, frame, weight, _cross(np.array(mass.at), weight))
        return loads

    def _strut(self, number: int, length: Expression | float) -> Expression | float:
        """Return the stiffness of an elastic strut."""
        strut = self.structure.robot.struts[self.structure.struts[number]]
        own = float(self.structure.strut_values[number])
        if strut.EA is None:
            return own
        free = length - strut.fixed_length
        self.must_be_positive(free)
        stiffness: Expression | float = 1.0 / (free * (1.0 / strut.EA) + 1.0 / own)
        return stiffness

    def _length(self, way: Entries) -> Expression | float:
        square = _dot(way, way)
        self.must_be_positive(square * SHORTEST**-2 - 1.0)
        return square_root(square)

    def _beam(self, beam: int, way: Entries) -> tuple[Entries, Entries]:
        """Return the stiffness (6, 6) of a beam's second end in its local axes, and those in the frame."""
        length = self._length(way)
        up = self.structure.beam_up[beam]
        if np.isnan(up).any():  # round: any perpendicular, one that holds for all poses
            fixed = [0.0 if isinstance(part, Expression) else abs(part) for part in way]
            moving = [isinstance(part, Expression) for part in way]
            up = np.eye(3)[min(range(3), key=lambda at: (moving[at], fixed[at]))]
        normal = _cross(way, up)
        across = _dot(normal, normal) - ACROSS * float(up @ up) * _dot(way, way)
        self.must_be_positive(across)
        properties = {name: value[beam] for name, value in self.structure.beam_properties.items()}
        stiffness = beam_stiffness(np.array([length]), **properties)
        return stiffness[0, 6:, 6:], _rounded(beam_axes(way, up))


def _rounded(entries: Entries) -> Entries:
    """Return the same with nothing in place of rounding errors: a right angle has no cosine."""
    if entries.dtype != object:
        return np.where(np.abs(entries) < ROUNDING, 0.0, entries)
    flat = [
        0.0 if not isinstance(item, Expression) and abs(item) < ROUNDING else item for item in entries.flat
    ]
    if not any(isinstance(item, Expression) for item in flat):
        return np.array(flat, dtype=np.float64).reshape(entries.shape)
    result = np.empty(len(flat), dtype=object)
    result[:] = flat
    return result.reshape(entries.shape)


def _dot(a: Entries, b: Entries) -> Any:
    total: Any = 0.0
    for x, y in zip(a, b, strict=True):
        if (isinstance(x, Expression) or x != 0.0) and (isinstance(y, Expression) or y != 0.0):
            total = total + x * y
    return total


def _product(a: Entries, b: Entries) -> Entries:
    """Return the matrix product, passing over zeros."""
    if a.dtype != object and b.dtype != object:
        return np.asarray(a @ b)
    result = np.empty((a.shape[0], *b.shape[1:]), dtype=object)
    for index in np.ndindex(result.shape):
        result[index] = _dot(a[index[0]], b[:, index[1]] if b.ndim == 2 else b)
    return result


def _cross(a: Entries, b: Entries) -> Entries:
    parts = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    return np.array(parts, dtype=object if a.dtype == object or b.dtype == object else np.float64)
