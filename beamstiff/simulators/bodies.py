"""A machine as rigid bodies: what simulators know, bodies in a tree with joints, closed by constraints.

A body's frame and its joints are given with all joints at 0. The joints of a body act one after the other,
the first next to the parent, as MuJoCo has it.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from beamstiff.robot.urdf.export import mass_of_points
from beamstiff.se3 import Array, rotation_from_vector, transform

MOST_JOINTS = 6  # of a body, in MuJoCo
Kind = Literal["hinge", "slide"]
# drive: an actuated variable; passive: one that loops set; spring: compliance; follower: led by another
Role = Literal["drive", "passive", "spring", "follower"]


@dataclass(frozen=True, eq=False)
class BodyJoint:
    """A joint with one degree of freedom, in the body's own frame."""

    name: str
    kind: Kind
    at: Array  # (3,), m
    axis: Array  # (3,)
    role: Role
    stiffness: float = 0.0  # N/m or N m/rad; 0 where nothing resists
    limits: tuple[float, float] | None = None
    leader: str = ""  # of a follower
    factor: float = 1.0  # of a follower, by which it moves as its leader does
    rest: float = 0.0  # m or rad: where a spring pulls nothing
    cubic: float = 0.0  # N/m^3 or N m/rad^3: of a spring whose force is k x + c x^3
    deadband: float = 0.0  # rad or m: half of the way between its stops; 0 where there are none
    friction: float = 0.0  # N or N m: what it takes to move it against its spring


@dataclass(frozen=True, eq=False)
class Shape:
    """What a body looks like, or collides with."""

    kind: str  # "box", "cylinder", "sphere" or "mesh"
    pose: Array  # (4, 4): in its body
    sizes: dict[
        str, Array
    ]  # as URDF calls them: size (3,), radius (1,), length (1,), m; scale (3,) of a mesh
    file: str = ""  # of a mesh
    collision: bool = False


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body."""

    name: str
    parent: int  # -1 for the world
    placed: Array  # (4, 4): its frame in the parent's
    joints: list[BodyJoint] = field(default_factory=list)
    masses: list[tuple[float, Array]] = field(default_factory=list)  # kg, and where, (3,), m
    moments: list[Array] = field(
        default_factory=list
    )  # kg m^2, (3, 3): of its masses about their own centres
    shapes: list[Shape] = field(default_factory=list)
    sites: list[tuple[str, Array]] = field(default_factory=list)  # name and pose, (4, 4)
    lines: list[tuple[Array, Array]] = field(default_factory=list)  # from where to where a part is drawn


@dataclass(frozen=True)
class Closure:
    """Two sites that stay together: as points, or as poses."""

    name: str
    kind: Literal["connect", "weld"]
    one: str
    other: str


@dataclass(frozen=True)
class Tendon:
    """A line between two sites: a spring of its length, or one as long as another tendon (`like`)."""

    name: str
    sites: tuple[str, str]
    stiffness: float  # N/m; inf where it never changes its length, 0 where it is only a measure of it
    length: float  # m: unstressed
    like: str = ""


@dataclass(frozen=True, eq=False)
class BodyTree:
    """A machine of bodies, parents first."""

    name: str
    tcp: str  # site
    gravity: tuple[float, float, float]
    bodies: tuple[Body, ...]
    closures: tuple[Closure, ...]
    tendons: tuple[Tendon, ...]
    reference: dict[str, float]  # joint values of a posture whose loops are closed, where they are not 0
    lost: tuple[str, ...]  # what of the robot it does not say, or not exactly
    varies: bool = False  # whether something that changes with the posture stands as in one posture


def inertia_of(body: Body) -> tuple[float, Array, Array]:
    """Return mass, kg, centre (3,), m, and inertia about it (3, 3), kg m^2, of a body in its frame."""
    mass, centre, inertia = mass_of_points(body.masses)
    return mass, centre, np.asarray(inertia + sum(body.moments, np.zeros((3, 3))))


def motion(joint: BodyJoint, value: float) -> Array:
    """Return the motion of a joint by a value, (4, 4)."""
    if joint.kind == "slide":
        return transform(np.eye(3), joint.axis * value)
    rotation = rotation_from_vector(joint.axis * value)
    return transform(rotation, joint.at - rotation @ joint.at)


def placed_bodies(bodies: list[Body] | tuple[Body, ...], values: dict[str, float]) -> list[Array]:
    """Return where the bodies are at some joint values (others 0), (4, 4) each, world frame."""
    poses: list[Array] = []
    for body in bodies:
        pose = body.placed if body.parent < 0 else poses[body.parent] @ body.placed
        for joint in body.joints:
            value = (
                values.get(joint.leader, 0.0) * joint.factor if joint.leader else values.get(joint.name, 0.0)
            )
            pose = pose @ motion(joint, value)
        poses.append(pose)
    return poses


def few_joints(bodies: list[Body]) -> list[Body]:
    """Return bodies of at most six joints: one with more rides on bodies that have the first of them."""
    bodies, names = [*bodies], {body.name for body in bodies}
    for number in range(len(bodies)):
        while len((own := bodies[number]).joints) > MOST_JOINTS:
            first, rest = own.joints[:MOST_JOINTS], own.joints[MOST_JOINTS:]
            bodies.append(Body(free_name(own.name, names), own.parent, own.placed, first))
            bodies[number] = replace(own, parent=len(bodies) - 1, placed=np.eye(4), joints=rest)
    return bodies


def parents_first(bodies: list[Body]) -> list[Body]:
    """Return bodies in an order in which parents precede their children."""
    order: list[int] = []
    while len(order) < len(bodies):
        order += [at for at, body in enumerate(bodies) if at not in order and body.parent in (-1, *order)]
    places = {at: number for number, at in enumerate(order)} | {-1: -1}
    return [replace(bodies[at], parent=places[bodies[at].parent]) for at in order]


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not taken yet, and take it."""
    number, own = 2, name
    while own in taken:
        own, number = f"{name} {number}", number + 1
    taken.add(own)
    return own
