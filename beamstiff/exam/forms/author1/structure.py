"""Structure that is compliant: links, bearings across their axis, and the base under the machine."""

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np

from beamstiff.exam.added_parts import node_at, on_pedestal, seen_from_foot
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, between, in_the_middle, nowhere, slender
from beamstiff.exam.laws import Curve
from beamstiff.exam.machine import (
    Bar,
    Hinge,
    Machine,
    Profile,
    bodies_of,
    joints_of,
    machine_of,
    own_stiffness,
    tapered,
)
from beamstiff.exam.placing import skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

SHORTEST = 0.02  # m
SOFTEST, STIFFEST = 3e6, 6e7  # N m^2, of a large robot
Curved = tuple[Array, Array]
BEARING_TILT = (4e-8, 6e-7)  # rad/(N m)
RADIAL = 4e-2  # m^2: radial compliance over tilting compliance, of rollers on a ring of 0.3 m
BASE_TILT = (8e-9, 2.5e-7)  # rad/(N m)


def links(robot: Robot) -> list[str | None]:
    """Return the beams, and the rigids that have a length and carry load.

    Not those that stand on the ground: they are the base by another name.
    """
    machine, placed = machine_of(robot), in_the_middle(robot)
    ground = {"base"}
    for name, parent, parameters in skeleton_of(robot).frames:  # parents first
        if parent in ground and not any(expression.coefficients for expression in parameters.values()):
            ground.add(name)
    standing = {node.name for node in machine.nodes if node.frame in ground}
    found: list[str | None] = [bar.name for bar in machine.bars if not standing.issuperset(bar.nodes)]
    for name, nodes in machine.rigids:
        if standing.issuperset(nodes):
            continue
        a, b = (placed.node(machine.node(n))[0] for n in nodes)
        if np.linalg.norm(b - a) > SHORTEST and _carries(machine, name, nodes):
            found.append(name)
    return found


def _carries(machine: Machine, name: str, nodes: tuple[str, str]) -> bool:
    """Return whether load passes a rigid: it parts its body, and what it parts holds the tool or a loop."""
    rest = machine.without(name)
    body = bodies_of(rest)
    if body[nodes[0]] == body[nodes[1]]:
        return False
    ties = rest.ties
    held = set(rest.fixed)
    for _ in machine.nodes:
        held |= {n for tie in ties if held & set(tie) for n in tie}
    return machine.tcp not in held or set(nodes) <= held


def draw_link(request: DrawRequest) -> dict[str, float]:
    """Return E I at the thick end, N m^2 (or by what factor a beam is softer), and the link's shape."""
    shape = {"flat": request.uniform(0.5, 1.0), "twist": request.uniform(0.4, 0.9)}
    if any(beam.name == request.component for beam in request.robot.beams):
        return {"softer": request.sized(1.1, 4.0), "taper": request.uniform(0.2, 0.5)}
    shape["EI"] = between(1.0 - request.size, SOFTEST, STIFFEST) / slender(request.robot)
    if request.form == "tapered":
        return shape | {"taper": request.uniform(0.2, 0.5)}
    if request.form == "hinged":
        return shape | {"first": request.uniform(0.0, 0.3), "second": request.uniform(0.5, 0.9)}
    return shape | {"offset": request.uniform(0.05, 0.2), "side": request.uniform(0.0, 2 * np.pi)}


def _link(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the link bending."""
    machine, p = reality.machine, truth.parameters
    if "softer" in p:
        bars = tuple(_softer(bar, p) if bar.name == truth.component else bar for bar in machine.bars)
        return reality.with_machine(dataclasses.replace(machine, bars=bars))
    nodes = next(nodes for name, nodes in machine.rigids if name == truth.component)
    rigidity = p["EI"] * np.array([1 / 0.12**2, np.inf, np.inf, p["twist"], p["flat"], 1.0])
    machine = machine.without(str(truth.component))
    up = up_of(machine, nodes)
    if truth.form == "elbow":
        halves = _elbow(machine, str(truth.component), nodes, rigidity, p["offset"], p["side"])
        return reality.with_machine(halves)
    profile = (
        tapered(rigidity, lambda x: 1.0 - p["taper"] * x)
        if truth.form == "tapered"
        else _hinged(rigidity, p["first"], p["second"])
    )
    return reality.with_machine(machine.plus(bars=(Bar(str(truth.component), nodes, profile, up),)))


def up_of(machine: Machine, nodes: tuple[str, str]) -> Array:
    """Return a direction across the link in the frame of its first node: its section turns with it."""
    placed = in_the_middle(machine.robot)
    a, b = (placed.node(machine.node(n))[0] for n in nodes)
    up = np.eye(3)[np.argmin(np.abs(b - a))]
    fixed: Array = placed.rotations[machine.node(nodes[0]).frame][0].T @ up
    return fixed


def _softer(bar: Bar, p: Mapping[str, float]) -> Bar:
    swell = (1.0 - p["taper"] * bar.profile.stations) ** -3
    swell = swell * p["softer"] / np.average(swell, weights=bar.profile.compliance[:, 0])
    profile = Profile(bar.profile.stations, bar.profile.compliance * swell[:, None])
    return dataclasses.replace(bar, profile=profile)


def _hinged(rigidity: Array, first: float, second: float) -> Profile:
    """Two links that bend, in a link that is stiff elsewhere (a hollow casting with flanges)."""
    with np.errstate(divide="ignore"):
        compliance = 1.0 / rigidity
    return Profile(np.array([first, second]), np.array([0.6, 0.4])[:, None] * compliance)


def _elbow(
    machine: Machine, name: str, nodes: tuple[str, str], rigidity: Array, offset: float, side: float
) -> Machine:
    """Return the machine with a link whose neutral line runs round a corner beside the straight one."""
    placed = in_the_middle(machine.robot)
    a, b = (placed.node(machine.node(n))[0] for n in nodes)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across = across / np.linalg.norm(across)
    corner = 0.5 * (a + b) + offset * np.linalg.norm(b - a) * (
        np.cos(side) * across + np.sin(side) * np.cross(along, across)
    )
    node = node_at(machine, placed, machine.node(nodes[0]).frame, corner, "elbow")
    up = up_of(machine, nodes)
    halves = (
        Bar(f"{name} before", (nodes[0], node.name), tapered(rigidity, lambda x: 1.1 - 0.2 * x), up),
        Bar(f"{name} behind", (node.name, nodes[1]), tapered(rigidity, lambda x: 0.9 - 0.2 * x), up),
    )
    return machine.plus(nodes=(node,), bars=halves)


def bearings(robot: Robot) -> list[str | None]:
    """Return all joints."""
    return list(dict.fromkeys(joint.variable or joint.name for joint in robot.joints))


def draw_bearing(request: DrawRequest) -> dict[str, float]:
    """Return compliances: tilting rad/(N m), radial and axial m/N; and how the bearing sits."""
    joints = joints_of(request.robot, str(request.component))
    own = [own_stiffness(request.robot, *joint) for joint in joints]
    drive = min(own)
    # a wrist's bearings are smaller, as its drives are
    softest = (
        BEARING_TILT[1] * slender(request.robot)
        if drive in (0.0, math.inf)
        else max(BEARING_TILT[1], 1.0 / drive)
    )
    tilt = request.sized(BEARING_TILT[0], softest)
    radial = tilt * RADIAL * request.uniform(0.3, 1.0)
    found = {
        "tilt": tilt,
        "other": request.uniform(0.5, 1.0),
        "radial": radial,
        "axial": radial * request.uniform(0.5, 1.0),
        "turned": request.uniform(0.0, math.pi),
    }
    if request.form == "off-centre":
        found["offset"] = 0.0 if math.inf in own else request.uniform(-0.15, 0.15)
    if request.form == "contact":
        found["strain"] = 2e3 * tilt * request.uniform(0.5, 2.0)
    return found


def _bearing(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with soft bearings."""
    machine, p = reality.machine, truth.parameters
    added = np.array([p["axial"], p["radial"], p["radial"], 0.0, p["tilt"], p["tilt"] * p["other"]])
    for name, own in joints_of(machine.robot, str(truth.component)):
        hinge = machine.hinge(name)
        c, s = math.cos(p["turned"]), math.sin(p["turned"])
        axes = hinge.axes @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        k = hinge.stiffness.copy()
        others = [d for d in range(6) if d != own and k.ndim == 1 and k[d] > 0.0 and added[d] > 0.0]
        k[others] = 1.0 / (added[others] + 1.0 / k[others])
        hinge = dataclasses.replace(hinge, axes=axes, stiffness=k)
        if p.get("offset", 0.0):
            hinge = dataclasses.replace(hinge, stiffness=_moved(hinge, p["offset"]))
        if "strain" in p:
            stiffer = {d: Curve(_contact(float(k[d]), p["strain"])) for d in others if d >= 4}
            hinge = dataclasses.replace(hinge, laws={**hinge.laws, **stiffer})
        machine = machine.with_hinge(hinge)
    return reality.with_machine(machine)


def with_tilting(truth: Truth, reality: Reality, curve: Callable[[Array, float], Curved]) -> Reality:
    """Return the reality with soft bearings whose tilting follows a curve of the strain and the stiffness."""
    machine = _bearing(truth, reality).machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        for d in (4, 5):
            k = float(machine.hinge(name).stiffness[d])
            if d != own and 0.0 < k < math.inf:
                machine = machine.with_law(name, d, Curve(lambda e, k=k: curve(e, k)))  # type: ignore[misc]
    return reality.with_machine(machine)


def _moved(hinge: Hinge, offset: float) -> Array:
    """Return the stiffness of springs that sit `offset` along the axis from the joint's node."""
    k = np.where(np.isinf(hinge.stiffness), 1e12, hinge.stiffness)  # a full matrix knows no rigid ones
    X = np.eye(6)
    X[1, 5], X[2, 4] = offset, -offset  # displacement at the springs: t + r x (offset, 0, 0)
    moved: Array = X.T @ np.diag(k) @ X
    return moved


def _contact(k: float, strain: float):  # type: ignore[no-untyped-def]
    """Stiffer under load, as rolling contacts are."""

    def curve(e: Array) -> tuple[Array, Array]:
        root = np.sqrt(1.0 + (e / strain) ** 2)
        return 0.7 * k * e * root, 0.7 * k * (root + (e / strain) ** 2 / root)

    return curve


def _draw_base(request: DrawRequest) -> dict[str, float]:
    """Return the compliance about x, rad/(N m), and the shape of the base."""
    found = {"tilt": request.sized(*BASE_TILT) * slender(request.robot)}
    if request.form == "block":
        return found | {
            "about_y": request.uniform(0.4, 1.2),
            "about_z": request.uniform(0.1, 0.6),
            "shift": request.uniform(0.1, 0.5),  # m: of the translations, as a lever
            "x": request.uniform(-0.2, 0.2),
            "y": request.uniform(-0.2, 0.2),
            "z": request.uniform(-0.6, 0.0),
        }
    return (
        found
        | {f"bolt{i}": request.uniform(0.3, 1.0) for i in range(4)}
        | {"span": request.uniform(0.5, 0.9), "across": request.uniform(0.3, 0.8)}
    )


def _base(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a soft base."""
    p = truth.parameters
    K = _block(p) if truth.form == "block" else _bolts(p)
    return reality.with_machine(on_pedestal(reality.machine, K))


def _block(p: Mapping[str, float]) -> Array:
    """Springs at an elastic centre beside the machine's foot."""
    about = p["tilt"] * np.array([1.0, p["about_y"], p["about_z"]])
    along = p["tilt"] * p["shift"] ** 2 * np.array([1.0, 0.8, 0.5])
    k = np.concatenate([1.0 / along, 1.0 / about])
    return seen_from_foot(np.array([p["x"], p["y"], p["z"]]), np.diag(k))


def _bolts(p: Mapping[str, float]) -> Array:
    """Four bolted feet, none as stiff as the other."""
    half = 0.5 * p["span"]
    corners = half * np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    shares = np.array([p[f"bolt{i}"] for i in range(4)])
    k = 1.0 / (p["tilt"] * np.sum(shares * corners[:, 1] ** 2))
    feet = [
        seen_from_foot(corner, np.diag(k * share * np.array([p["across"], p["across"], 1.0, 0.0, 0.0, 0.0])))
        for corner, share in zip(corners, shares, strict=True)
    ]
    return np.asarray(np.sum(feet, axis=0))


EFFECTS: tuple[Effect, ...] = (
    Effect("link-bending", ("tapered", "hinged", "elbow"), links, draw_link, _link),
    Effect("bearing-tilt", ("anisotropic", "off-centre", "contact"), bearings, draw_bearing, _bearing),
    Effect("base-compliance", ("block", "bolts"), nowhere, _draw_base, _base),
)
