"""Structure that is compliant: links, bearings across their axis, and the base under the machine."""

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import about_x, across_link, on_pedestal, seen_from_foot
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender
from beamstiff.exam.draws import evenly, sized, softer
from beamstiff.exam.effect import built, built_at_joints
from beamstiff.exam.laws import Curved, curved
from beamstiff.exam.machine import (
    Bar,
    Machine,
    Profile,
    in_the_middle,
    joints_of,
    machine_of,
    own_stiffness,
    tapered,
)
from beamstiff.exam.parameters import DrawRequest, Parameters, between, vector
from beamstiff.exam.placing import skeleton_of
from beamstiff.robot.description import Robot

SHORTEST = 0.02  # m
SOFTEST, STIFFEST = 3e6, 6e7  # N m^2, of a large robot
BEARING_TILT = (4e-8, 6e-7)  # rad/(N m)
RADIAL = 4e-2  # m^2: radial compliance over tilting compliance, of rollers on a ring of 0.3 m
BASE_TILT = (8e-9, 2.5e-7)  # rad/(N m)
STIFF = 1e12  # N/m or N m/rad: a full matrix knows no rigid directions


def links(robot: Robot) -> list[str | None]:
    """Return the beams and rigids with a length that carry load; those on the ground are the base."""
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
    body = rest.bodies()
    if body[nodes[0]] == body[nodes[1]]:
        return False
    held = rest.held()
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


def rigidity_of(p: Parameters) -> Array:
    """Return a link's rigidity (6,) at its thick end: stiff in shear, and as slender whatever its size."""
    return np.asarray(p["EI"] * np.array([1 / 0.12**2, np.inf, np.inf, p["twist"], p["flat"], 1.0]))


def _link(
    bend: Callable[[Parameters, Array], Profile] | None, p: Parameters, machine: Machine, name: str
) -> Machine:
    """Return the machine with a link that bends by a profile of parameters and rigidity; None: an elbow."""
    if "softer" in p:
        return machine.with_profile(name, lambda profile: _softer(profile, p))
    nodes = dict(machine.rigids)[name]
    machine = machine.without(name)
    if bend is None:
        return _elbow(p, machine, name, nodes)
    return machine.plus(bars=(Bar(name, nodes, bend(p, rigidity_of(p)), up_of(machine, nodes)),))


def up_of(machine: Machine, nodes: tuple[str, str]) -> Array:
    """Return a direction across the link in the frame of its first node: its section turns with it."""
    a, b = machine.places(*nodes)
    return machine.seen_from(nodes[0], np.eye(3)[np.argmin(np.abs(b - a))])


def _softer(profile: Profile, p: Parameters) -> Profile:
    swell = (1.0 - p["taper"] * profile.stations) ** -3
    swell = swell * p["softer"] / np.average(swell, weights=profile.compliance[:, 0])
    return Profile(profile.stations, profile.compliance * swell[:, None])


def _tapered(p: Parameters, rigidity: Array) -> Profile:
    return tapered(rigidity, lambda x: 1.0 - p["taper"] * x)


def _hinged(p: Parameters, rigidity: Array) -> Profile:
    """Two links that bend, in a link that is stiff elsewhere (a hollow casting with flanges)."""
    with np.errstate(divide="ignore"):
        compliance = 1.0 / rigidity
    return Profile(np.array([p["first"], p["second"]]), np.array([0.6, 0.4])[:, None] * compliance)


def _elbow(p: Parameters, machine: Machine, name: str, nodes: tuple[str, str]) -> Machine:
    """Return the machine with a link whose neutral line runs round a corner beside the straight one."""
    a, b = machine.places(*nodes)
    corner = 0.5 * (a + b) + p["offset"] * np.linalg.norm(b - a) * across_link(a, b, p["side"])
    machine, elbow = machine.with_node_at("elbow", machine.node(nodes[0]).frame, corner)
    up, rigidity = up_of(machine, nodes), rigidity_of(p)
    before = Bar(f"{name} before", (nodes[0], elbow), tapered(rigidity, lambda x: 1.1 - 0.2 * x), up)
    behind = Bar(f"{name} behind", (elbow, nodes[1]), tapered(rigidity, lambda x: 0.9 - 0.2 * x), up)
    return machine.plus(bars=(before, behind))


def draw_bearing(request: DrawRequest) -> dict[str, float]:
    """Return compliances: tilting rad/(N m), radial and axial m/N; and how the bearing sits."""
    joints = joints_of(request.robot, str(request.component))
    own = [own_stiffness(request.robot, *joint) for joint in joints]
    drive = min(own)
    least, most = BEARING_TILT
    # a wrist's bearings are smaller, as its drives are
    softest = most * slender(request.robot) if drive in (0.0, math.inf) else max(most, 1.0 / drive)
    tilt = request.sized(least, softest)
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


def _bearing(p: Parameters, machine: Machine, joint: str, own: int) -> Machine:
    added = np.array([p["axial"], p["radial"], p["radial"], 0.0, p["tilt"], p["tilt"] * p["other"]])
    hinge = machine.hinge(joint)
    k = hinge.stiffness.copy()
    others = [d for d in range(6) if d != own and k.ndim == 1 and k[d] > 0.0 and added[d] > 0.0]
    k[others] = 1.0 / (added[others] + 1.0 / k[others])
    laws = dict(hinge.laws)
    if "strain" in p:
        laws |= {d: curved(partial(_contact, float(k[d]), p["strain"])) for d in others if d >= 4}
    if p.get("offset", 0.0):
        springs = np.diag(np.where(np.isinf(k), STIFF, k))
        k = seen_from_foot(np.array([p["offset"], 0.0, 0.0]), springs)
    axes = hinge.axes @ about_x(p["turned"])
    return machine.with_hinge(dataclasses.replace(hinge, axes=axes, stiffness=k, laws=laws))


def with_tilting(
    curve: Callable[[Parameters, float, Array], Curved], p: Parameters, machine: Machine, joint: str, own: int
) -> Machine:
    """Return the machine with a soft bearing whose tilting follows a curve of stiffness and strain."""
    machine = _bearing(p, machine, joint, own)
    for d in (4, 5):
        k = float(machine.hinge(joint).stiffness[d])
        if d != own and 0.0 < k < math.inf:
            machine = machine.with_law(joint, d, curved(partial(curve, p, k)))
    return machine


def _contact(k: float, strain: float, e: Array) -> Curved:
    """Stiffer under load, as rolling contacts are."""
    root = np.sqrt(1.0 + (e / strain) ** 2)
    return 0.7 * k * e * root, 0.7 * k * (root + (e / strain) ** 2 / root)


def _block(p: Parameters, machine: Machine, _: str) -> Machine:
    """Springs at an elastic centre beside the machine's foot; `shift`, m: of the translations, as a lever."""
    about = p["tilt"] * np.array([1.0, p["about_y"], p["about_z"]])
    along = p["tilt"] * p["shift"] ** 2 * np.array([1.0, 0.8, 0.5])
    springs = np.diag(np.concatenate([1.0 / along, 1.0 / about]))
    return on_pedestal(machine, seen_from_foot(vector(p), springs))


def _bolts(p: Parameters, machine: Machine, _: str) -> Machine:
    """Four bolted feet, none as stiff as the other."""
    corners = 0.5 * p["span"] * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    shares = np.array([p[f"bolt{i}"] for i in range(4)])
    k = 1.0 / (p["tilt"] * np.sum(shares * corners[:, 1] ** 2))
    return on_feet(machine, corners, shares * k, p["across"])


def on_feet(machine: Machine, places: Array, upright: Array, across: float) -> Machine:
    """Return the machine on feet at places (n, 3), of an upright stiffness (n,), N/m; `across`: over it."""
    ways = np.array([across, across, 1.0, 0.0, 0.0, 0.0])
    feet = [seen_from_foot(at, np.diag(k * ways)) for at, k in zip(places, upright, strict=True)]
    return on_pedestal(machine, np.sum(feet, axis=0))


TILT = softer(sized(*BASE_TILT))  # about x, rad/(N m)
FORMS = (
    built("link-bending", "tapered", partial(_link, _tapered), draw_link),
    built("link-bending", "hinged", partial(_link, _hinged), draw_link),
    built("link-bending", "elbow", partial(_link, None), draw_link),
    *(built_at_joints("bearing-tilt", name, _bearing, draw_bearing)
      for name in ("anisotropic", "off-centre", "contact")),
    built("base-compliance", "block", _block,
          tilt=TILT, about_y=evenly(0.4, 1.2), about_z=evenly(0.1, 0.6), shift=evenly(0.1, 0.5),
          x=evenly(-0.2, 0.2), y=evenly(-0.2, 0.2), z=evenly(-0.6, 0.0)),
    built("base-compliance", "bolts", _bolts,
          tilt=TILT, **{f"bolt{i}": evenly(0.3, 1.0) for i in range(4)}, span=evenly(0.5, 0.9),
          across=evenly(0.3, 0.8)),
)  # fmt: skip
