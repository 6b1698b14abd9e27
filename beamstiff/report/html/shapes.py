"""What is drawn about a robot in space: beams as solids, each as its section, and a load as arrows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.report.html.parts import css, label, numbers, places
from beamstiff.report.tables import number
from beamstiff.report.vtk import beam_shape
from beamstiff.robot.description import Robot
from beamstiff.robot.sections import Section, section_properties
from beamstiff.se3 import Array

RINGS = 7  # outlines along a beam
ROUND = 12  # corners of a circle
MOST_SOLIDS = 200  # beams that are drawn so
HEAD = 0.28  # of an arrow
MOMENT = 0.7  # of a force's arrow


def outline(section: Section) -> Array:
    """Return the corners (n, 2) of a section in its local y and z, m.

    Of a section given by its properties: of the rectangle with the same A, Iy and Iz.

    >>> outline(Section(shape="box", width=0.2, height=0.4, wall=0.01)).max(axis=0).tolist()
    [0.1, 0.2]
    """
    if section.outer is not None:
        angle = 2 * np.pi * np.arange(ROUND) / ROUND
        return 0.5 * section.outer * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if section.width is not None and section.height is not None:
        width, height = section.width, section.height
    else:
        known = section_properties(section)
        width, height = (float(np.sqrt(12 * second / known.A)) for second in (known.Iz, known.Iy))
    corners: Array = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [width, height]
    return corners


def beam_solids(
    robot: Robot,
    axes: Array,
    positions: Array,
    moved: Array,
    shares: Mapping[str, float],
    told: Mapping[str, str],
) -> dict[str, Any]:
    """Return the trace of all beams in a posture, of a robot that has some.

    `axes` (B, 3, 3): base frame from local beam axes. `positions` (N, 3), m. `moved` (N, 6), m and rad.
    `shares`, `told`: by beam, what colours it and what the pointer says of it.
    """
    index = {node.name: at for at, node in enumerate(robot.nodes)}
    points, ways, faces, share, text = list[Array](), list[Array](), list[Array](), [], []
    count, s = 0, np.linspace(0.0, 1.0, RINGS)
    for beam, local in zip(robot.beams[:MOST_SOLIDS], axes, strict=False):
        first, last = (index[name] for name in beam.nodes)
        corners = outline(robot.sections[beam.section])
        around = corners @ local[:, 1:].T  # (n, 3), from the axis
        middle = np.outer(1 - s, positions[first]) + np.outer(s, positions[last])
        bent = beam_shape(positions[first], positions[last], moved[first], moved[last], s)
        points.append((middle[:, None] + around).reshape(-1, 3))
        ways.append((bent[:, None, :3] + np.cross(bent[:, None, 3:], around)).reshape(-1, 3))
        n = len(corners)
        a = np.add.outer(n * np.arange(RINGS - 1), np.arange(n)).ravel()
        b = np.add.outer(n * np.arange(RINGS - 1), (np.arange(n) + 1) % n).ravel()
        faces.append(count + np.concatenate([np.stack([a, b, b + n], 1), np.stack([a, b + n, a + n], 1)]))
        count += n * RINGS
        share += [float(f"{shares.get(beam.name, 0.0):.4g}")] * (n * RINGS)
        text += [told.get(beam.name, label(beam.name))] * (n * RINGS)
    at, way, corner = (np.concatenate(some) for some in (points, ways, faces))
    return {
        **places(at, way),
        **{name: corner[:, k].tolist() for k, name in enumerate("ijk")},
        "shares": share,
        "hovertext": text,
    }


def solids_style(**coloured: Any) -> dict[str, Any]:
    """Return the look of beams as solids: their lines show through."""
    return {
        "type": "mesh3d",
        "name": "sections",
        "opacity": 0.55,
        "flatshading": True,
        "showscale": False,
        "hoverinfo": "text",
        "color": css("part"),
        **coloured,
    }


@dataclass(frozen=True)
class Arrows:
    """Arrows from a point: their vectors (n, 3), and what each is."""

    origin: Array
    vectors: Array
    texts: tuple[str, ...]

    def lines(self, moved: Array) -> dict[str, Any]:
        """Return the shafts, with a gap after each, as a trace that moves along."""
        points = [[self.origin, self.origin + 0.9 * one, np.full(3, np.nan)] for one in self.vectors]
        texts = [text for text in self.texts for _ in range(3)]
        return places(np.array(points).reshape(-1, 3), moved) | {"hovertext": texts}

    def heads(self, moved: Array) -> dict[str, Any]:
        """Return the heads as cones that move along."""
        along = {name: numbers(HEAD * self.vectors[:, k]) for k, name in enumerate("uvw")}
        return places(self.origin + self.vectors, moved) | along


def force_and_moment(wrench: Array, origin: Array, length: float) -> Arrows:
    """Return the arrows of a wrench (6,) at a point: as long as told, whatever its size.

    The moment's is shorter; what does not act has no arrow.
    """
    vectors, texts = [], []
    for part, what, unit, long in (
        (wrench[:3], "force", "N", length),
        (wrench[3:], "moment", "N m", MOMENT * length),
    ):
        size = float(np.linalg.norm(part))
        if size > 0.0:
            vectors.append(long * part / size)
            texts.append(f"{what} {number(size)} {unit}")
    return Arrows(origin, np.array(vectors).reshape(-1, 3), tuple(texts))
