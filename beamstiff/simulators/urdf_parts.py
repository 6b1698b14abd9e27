"""Moments of inertia and shapes of the URDF that a robot was read from, for which a robot has no words."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from beamstiff.robot.description import Robot
from beamstiff.robot.sdf_writer import DRAWN, INERTIA
from beamstiff.robot.urdf.reader import origin_of
from beamstiff.robot.xml_text import Element, parse_xml
from beamstiff.se3 import Array
from beamstiff.simulators.bodies import BodyTree, Shape

SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ("scale",)}


@dataclass(frozen=True)
class Files:
    """Where the meshes of a URDF are looked for, and from where a file names them."""

    source: Path  # the URDF
    out: Path  # the file that is written

    def found(self, uri: str) -> str:
        """Return the path of a mesh as seen from the file that is written; empty where there is none."""
        scheme, _, rest = uri.rpartition("://")
        places = [Path(rest)] if scheme == "file" else [self.source.parent / rest]
        if scheme in ("package", "model"):  # folders of packages stand in one of those above, by any name
            tails = rest, rest.partition("/")[2]
            places = [folder / part for folder in self.source.resolve().parents for part in tails]
        file = next((place for place in places if place.is_file()), None)
        folder = self.out.resolve().parent
        return "" if file is None else Path(os.path.relpath(file.resolve(), folder)).as_posix()


def with_urdf_parts(tree: BodyTree, robot: Robot, files: Files | None) -> BodyTree:
    """Return a machine with what its robot's URDF says of links besides kinematics and masses."""
    links = [] if robot.urdf is None else parse_xml(robot.urdf, "<urdf>").all("link")
    places = {name: (at, pose) for at, body in enumerate(tree.bodies) for name, pose in body.sites}
    bodies, lost = list(tree.bodies), list(tree.lost)
    for link in links:
        if (name := link.attribute("name")) not in places:
            if any(link.all(part) for part in DRAWN):
                lost.append(f"shapes of link {name} of the URDF: the robot has no node of this name")
            continue
        at, pose = places[name]
        body = bodies[at]
        moments = [*body.moments, *_moments(link, pose)]
        shapes = list(body.shapes)
        for shape in _shapes(link, pose):
            file = files.found(shape.file) if files and shape.file else ""
            if shape.file and not file:
                lost.append(f"mesh {shape.file} of link {name}: no such file")
            else:
                shapes.append(replace(shape, file=file))
        bodies[at] = replace(body, moments=moments, shapes=shapes)
    return replace(tree, bodies=tuple(bodies), lost=tuple(dict.fromkeys(lost)))


def _moments(link: Element, pose: Array) -> Iterator[Array]:
    """Yield the inertia of a link about its centre, (3, 3), in the axes of its body."""
    for inertial in link.all("inertial"):
        for item in inertial.all("inertia"):
            xx, xy, xz, yy, yz, zz = (float(item.attributes.get(name, "0")) for name in INERTIA)
            turned = pose[:3, :3] @ origin_of(inertial)[:3, :3]
            yield turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned.T


def _shapes(link: Element, pose: Array) -> Iterator[Shape]:
    for drawn in (item for name in DRAWN for item in link.all(name)):
        for kind, sizes in SIZES.items():
            for item in drawn.need("geometry").all(kind):
                said = {name: item.attributes.get(name, "1 1 1").split() for name in sizes}
                numbers = {name: np.array([*map(float, values)]) for name, values in said.items()}
                file = item.attributes.get("filename", "")
                yield Shape(kind, pose @ origin_of(drawn), numbers, file, drawn.name == "collision")
