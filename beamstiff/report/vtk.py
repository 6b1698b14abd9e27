"""The deformed structure as VTU, for ParaView and whatever else reads VTK's XML (nothing needs installing).

Points stand undeformed; warp by the vector `displacement`. Between its ends a beam is drawn with the cubic
that their displacements and rotations define: exact for a beam without load on its span and stiff in shear.
"""

import math
import os
from collections.abc import Mapping, Sequence
from itertools import pairwise
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, shown
from beamstiff.fem.static_response import Response, nodal_loads, respond
from beamstiff.fem.structure import compile_structure
from beamstiff.files import write_whole
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import posture
from beamstiff.robot.parts import Beam, Joint, Rigid, Strut
from beamstiff.se3 import Array

KINDS = ("beam", "rigid", "joint", "strut")
VERTEX, LINE = 1, 3  # VTK's numbers of cell types
SEGMENTS = 12


def write_vtu(
    robot: Robot,
    q: Mapping[str, ArrayLike] | ArrayLike,
    wrench: ArrayLike,
    path: str | os.PathLike[str],
    *,
    point: str | None = None,
    gravity: bool = False,
) -> None:
    """Write a robot in one posture, deformed by a wrench, to a VTU file.

    Point data: `displacement` (m) and `rotation` (rad, rotation vector); cell data: `kind` (0 beam, 1 rigid,
    2 joint, 3 strut) and `energy_share`, the element's part of the strain energy. Base frame.

    `q`: one value for each actuated variable, rad or m; not named ones are 0. `wrench` (6,), N and N m.
    `point`: node on which it acts; by default the TCP. `gravity`: add the dead weight. Raises BeamstiffError
    when the structure is a mechanism, a node unknown, or the file cannot be written.
    """
    write_whole(os.fspath(path), vtu_text(robot, q, wrench, point=point, gravity=gravity))


def vtu_text(
    robot: Robot,
    q: Mapping[str, ArrayLike] | ArrayLike,
    wrench: ArrayLike,
    *,
    point: str | None = None,
    gravity: bool = False,
) -> str:
    """Return the text that `write_vtu` writes."""
    load = np.asarray(wrench, dtype=np.float64)
    if load.shape != (6,) or not np.isfinite(load).all():
        raise BeamstiffError(f"wrench: found {shown(load.tolist())}, expected six numbers fx fy fz mx my mz")
    structure = compile_structure(robot)
    where = posture(structure.kinematics, q)
    if len(where.values) != 1:
        raise BeamstiffError(f"found {len(where.values)} postures, expected one")
    loads = nodal_loads(structure, 1, {robot.tcp if point is None else point: load})
    response = respond(structure, where, loads, gravity=gravity)
    return _text(robot, where.node_positions[0], response)


def beam_shape(start: Array, end: Array, first: Array, second: Array, at: Array) -> Array:
    """Return ``[d, r]`` (S, 6) at places (S,), 0 to 1, along a beam from those (6,) of its ends (3,)."""
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    s = at[:, None]

    def split(d: Array) -> tuple[Array, Array]:
        axial = (d @ along) * along
        return axial, d - axial

    (axial_1, across_1), (axial_2, across_2) = split(first[:3]), split(second[:3])
    slope_1, slope_2 = (length * np.cross(r, along) for r in (first[3:], second[3:]))
    across = (
        (1 - 3 * s**2 + 2 * s**3) * across_1
        + (s - 2 * s**2 + s**3) * slope_1
        + (3 * s**2 - 2 * s**3) * across_2
        + (s**3 - s**2) * slope_2
    )
    rate = (
        (6 * s**2 - 6 * s) * (across_1 - across_2)
        + (1 - 4 * s + 3 * s**2) * slope_1
        + (3 * s**2 - 2 * s) * slope_2
    ) / length
    twist = (1 - s) * (first[3:] @ along) * along + s * (second[3:] @ along) * along
    displacement = (1 - s) * axial_1 + s * axial_2 + across
    return np.concatenate([displacement, twist + np.cross(along, rate)], axis=1)


def _text(robot: Robot, positions: Array, response: Response) -> str:
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    moved = response.displacement[0]
    shares = {name: float(value[0]) for name, value in response.energy_shares().items()}
    points, motions = [*positions], [*moved]
    cells, kinds, energy = list[list[int]](), list[int](), list[float]()
    groups: list[Sequence[Beam | Rigid | Joint | Strut]]
    groups = [robot.beams, robot.rigids, robot.joints, robot.struts]
    for kind, elements in enumerate(groups):
        for element in elements:
            a, b = (index[name] for name in element.nodes)
            line = [a, b]
            if KINDS[kind] == "beam":
                inner = np.linspace(0.0, 1.0, SEGMENTS + 1)[1:-1]
                line[1:1] = range(len(points), len(points) + len(inner))
                points += [*(positions[a] + inner[:, None] * (positions[b] - positions[a]))]
                motions += [*beam_shape(positions[a], positions[b], moved[a], moved[b], inner)]
            joined = KINDS[kind] == "joint"  # its shares go by direction: J1.torsional
            own = math.fsum(
                share
                for name, share in shares.items()
                if (name.rpartition(".")[0] if joined else name) == element.name
            )
            parts = [[a]] if joined else [list(pair) for pair in pairwise(line)]
            cells += parts
            kinds += [kind] * len(parts)
            energy += [own] * len(parts)
    table, kind_of = np.array(motions), [VERTEX if len(cell) == 1 else LINE for cell in cells]
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">',
            "<UnstructuredGrid>",
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}">',
            f"<Points>\n{_array('position', np.array(points))}\n</Points>",
            "<Cells>",
            _array("connectivity", np.array([node for cell in cells for node in cell], dtype=np.int64)),
            _array("offsets", np.cumsum([len(cell) for cell in cells], dtype=np.int64)),
            _array("types", np.array(kind_of, dtype=np.int64)),
            "</Cells>",
            '<PointData Vectors="displacement">',
            _array("displacement", table[:, :3]),
            _array("rotation", table[:, 3:]),
            "</PointData>",
            "<CellData>",
            _array("kind", np.array(kinds, dtype=np.int64)),
            _array("energy_share", np.array(energy, dtype=np.float64)),
            "</CellData>",
            "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        ]
    )


def _array(name: str, values: Array | NDArray[np.int64]) -> str:
    """Return a `DataArray`, one line a row."""
    kind = "Float64" if values.dtype.kind == "f" else "Int64"
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    rows = values if values.ndim == 2 else values[None]
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    head = f'type="{kind}" Name={quoteattr(name)}{components} format="ascii"'
    return f"<DataArray {head}>\n{text}\n</DataArray>"
