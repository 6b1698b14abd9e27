"""Random structures with every kind of part, as a description and as a reference frame at once."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from beamstiff import Material, Robot, Section
from tests.fem.builders import FREE, RIGID, frame
from tests.fem.reference_frame import ReferenceFrame, properties_of

Array = NDArray[np.float64]


@dataclass
class RandomFrame:
    """Lists of parts that grow, over nodes of which some coincide."""

    rng: np.random.Generator
    points: list[Array] = field(default_factory=lambda: [np.zeros(3)])
    beams: list[tuple[int, int]] = field(default_factory=list)
    rigids: list[tuple[int, int]] = field(default_factory=list)
    joints: list[tuple[int, int, Array, Array]] = field(default_factory=list)
    struts: list[tuple[int, int, float]] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    ups: list[Array] = field(default_factory=list)
    fixed: list[int] = field(default_factory=lambda: [0])

    def node(self, at: Array | None = None) -> int:
        self.points.append(self.rng.uniform(-1, 1, 3) if at is None else at)
        return len(self.points) - 1

    def pair(self, i: int, j: int) -> tuple[int, int]:
        return (i, j) if self.rng.random() < 0.5 else (j, i)

    def beam(self, i: int, j: int) -> None:
        rng = self.rng
        A, Iy, Iz, J = 10.0 ** rng.uniform([-3.5, -6.5, -6.5, -6.5], [-2, -5, -5, -5])
        Ay, Az = A * rng.uniform(0.3, 0.9, 2)
        shear = {"Ay": Ay, "Az": Az} if rng.random() < 0.5 else {}
        self.beams.append(self.pair(i, j))
        self.sections.append(Section(A=A, Iy=Iy, Iz=Iz, J=J, **shear))
        self.materials.append(
            Material(E=rng.uniform(0.5, 2) * 1e11, G=rng.uniform(2, 8) * 1e10, density=7850.0)
        )
        axis = self.points[j] - self.points[i]
        across = np.cross(axis, rng.normal(size=3))
        self.ups.append(across / np.linalg.norm(across) + 0.5 * axis)

    def joint(self, i: int, j: int, rigid: float = 0.3, free: float = 0.15) -> None:
        rng = self.rng
        kinds = 10.0 ** rng.uniform(5, 8, 4)
        kinds[rng.random(4) < rigid] = RIGID
        kinds[rng.random(4) < free] = FREE
        self.joints.append((*self.pair(i, j), rng.normal(size=3), kinds))

    def strut(self, i: int, j: int) -> None:
        rng = self.rng
        stiffness = RIGID if rng.random() < 0.2 else 10.0 ** rng.uniform(6, 8)
        self.struts.append((*self.pair(i, j), stiffness))

    def apart(self, count: int = 2) -> list[int]:
        """Return distinct nodes at distinct places."""
        for _ in range(100):
            chosen = self.rng.choice(len(self.points), count, replace=False)
            gaps = [np.linalg.norm(self.points[i] - self.points[j]) for i in chosen for j in chosen if i < j]
            if min(gaps) > 0.1:
                return [int(at) for at in chosen]
        return [0, self.node()][:count]

    def turning(self) -> list[int]:
        ends = [pair[:2] for pair in (*self.beams, *self.rigids, *self.joints)]
        return sorted({node for pair in ends for node in pair})

    def robot(self, tcp: int | None = None) -> Robot:
        free = [node for node in self.turning() if node not in self.fixed]
        parts = {"beams": self.beams, "rigids": self.rigids, "joints": self.joints, "struts": self.struts}
        beam = {"section": self.sections, "material": self.materials, "up": self.ups}
        return frame(self.points, fixed=self.fixed, tcp=free[-1] if tcp is None else tcp, **parts, **beam)

    def reference(self) -> ReferenceFrame:
        parts = zip(self.beams, self.sections, self.materials, self.ups, strict=True)
        beams = [(*pair, properties_of(section, material), up) for pair, section, material, up in parts]
        joints = [(i, j, axis, kinds[[0, 1, 1, 2, 3, 3]]) for i, j, axis, kinds in self.joints]
        return ReferenceFrame(
            np.array(self.points), self.fixed, beams, list(self.rigids), joints, list(self.struts)
        )


def beam_frame(seed: int, more: int = 5, loops: int = 3) -> RandomFrame:
    """Return a frame of beams alone, with loops."""
    made = RandomFrame(np.random.default_rng(seed))
    for _ in range(more):
        old = int(made.rng.integers(len(made.points)))
        made.beam(old, made.node())
    for _ in range(loops):
        made.beam(*made.apart())
    return made


def machine_frame(
    seed: int, more: int = 6, loops: int = 3, rigid: float = 0.3, free: float = 0.15, rigid_loops: bool = True
) -> RandomFrame:
    """Return a structure of all kinds of parts: a tree of `more` of them, and `loops` that close loops.

    Rigids and joints that close loops among rigid parts are in it if `rigid_loops`; some of their
    constraints are then redundant.
    """
    made = RandomFrame(np.random.default_rng(seed))
    rng = made.rng
    for _ in range(more):
        old = int(rng.integers(len(made.points)))
        kind = rng.choice(["beam", "rigid", "joint"], p=[0.4, 0.25, 0.35])
        if kind == "joint":
            made.joint(old, made.node(made.points[old].copy()), rigid, free)
        else:
            new = made.node()
            made.beam(old, new) if kind == "beam" else made.rigids.append(made.pair(old, new))
    if len(made.points) == 1 or not made.turning():
        made.beam(0, made.node())
    for _ in range(loops):
        kinds = ["beam", "strut", "held", "apex"] + (["rigid", "joint", "weld"] if rigid_loops else [])
        kind = rng.choice(kinds)
        if kind == "beam":
            made.beam(*made.apart())
        elif kind == "strut":
            made.strut(*made.apart())
        elif kind == "apex":  # a node on three struts
            feet, top = made.apart(min(3, len(made.points))), made.node()
            for foot in feet:
                made.struts.append((*made.pair(foot, top), 10.0 ** rng.uniform(6, 8)))
        elif kind == "held":
            last = made.turning()[-1]
            made.fixed += [int(at) for at in rng.choice(made.turning(), 1) if at not in (*made.fixed, last)]
        elif kind == "rigid":
            made.rigids.append(made.pair(*made.apart()))
        else:  # two nodes that coincide, or a new one on an old one
            i, j = made.apart()
            twin = made.node(made.points[i].copy())
            made.rigids.append(made.pair(j, twin))
            if kind == "joint":
                made.joint(i, twin, rigid, free)
            else:
                made.rigids.append(made.pair(i, twin))
    return made
