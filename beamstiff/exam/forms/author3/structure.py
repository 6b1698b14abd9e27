"""Third forms of soft structure: base, bearings and links."""

import dataclasses
import math

import numpy as np

from beamstiff.exam.added_parts import free_name, node_at, on_pedestal, seen_from_foot
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, in_the_middle, nowhere, slender
from beamstiff.exam.forms.author1 import structure as author1
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.layout import tip_stiffness
from beamstiff.exam.machine import Bar, Hinge, Machine, Profile, joints_of, tapered
from beamstiff.exam.reality import Reality


def _draw_base(request: DrawRequest) -> dict[str, float]:
    found = {
        "tilt": request.sized(*author1.BASE_TILT) * slender(request.robot),
        "turned": request.uniform(0.0, math.pi),
    }
    if request.form == "carriage":
        return found | {
            "long": request.uniform(0.3, 0.6),  # m, half the distances of the guide blocks
            "wide": request.uniform(0.25, 0.5),
            "across": request.uniform(0.5, 1.0),  # sideways over upright
            "rack": request.uniform(0.1, 0.5),  # along the rails over one block's upright
            "low": request.uniform(0.1, 0.4),
        }
    return found | {
        "span": request.uniform(2.0, 5.0),
        "place": request.uniform(0.25, 0.75),
        "beside": request.uniform(-0.3, 0.3),
        "above": request.uniform(0.1, 0.4),
        "flat": request.uniform(0.2, 0.8),
        "twist": request.uniform(0.2, 0.6),
    }


def _base(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a soft base.

    ``carriage``: the robot rides on a seventh axis, held by four guide blocks on rails and, along them, by
    the rack's drive, which is softer. Common in body shops; block stiffness as in catalogues (Bosch Rexroth,
    THK), the drive's an engineering estimate.

    ``girder``: it stands on a bridge that is clamped at both ends, beside the bridge's axis, as on gantries
    and platforms; sizes are an engineering estimate.
    """
    p = dict(truth.parameters)
    K = carriage(p) if truth.form == "carriage" else girder(p)
    c, s = math.cos(p["turned"]), math.sin(p["turned"])
    turned = np.kron(np.eye(2), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    return reality.with_machine(on_pedestal(reality.machine, turned @ K @ turned.T))


def carriage(p: dict[str, float]) -> Array:
    """Return the stiffness of a carriage at the foot, its rails along x."""
    upright = 1.0 / (4.0 * p["tilt"] * p["wide"] ** 2)
    rack = np.diag([p["rack"] * upright, 0.0, 0.0, 0.0, 0.0, 0.0])
    K = seen_from_foot(np.array([0.0, 0.0, -p["low"]]), rack)
    for x in (p["long"], -p["long"]):
        for y in (p["wide"], -p["wide"]):
            block = np.diag([0.0, p["across"] * upright, upright, 0.0, 0.0, 0.0])
            K = K + seen_from_foot(np.array([x, y, -p["low"]]), block)
    return np.asarray(K)


def girder(p: dict[str, float]) -> Array:
    """Return the stiffness at the foot of a girder along x that is clamped at both ends.

    Its size is such that the foot tilts about the girder's axis by `tilt` under a moment of 1.
    """
    rigidity = np.array([1.0 / 0.1**2, np.inf, np.inf, p["twist"], 1.0, p["flat"]])
    profile = tapered(rigidity, lambda x: np.ones_like(x))
    K = np.zeros((6, 6))
    for length, way in ((p["place"] * p["span"], 1.0), ((1.0 - p["place"]) * p["span"], -1.0)):
        axes = np.kron(np.eye(2), np.diag([way, way, 1.0]))
        K += axes @ tip_stiffness(profile, np.array([length]))[0] @ axes.T
    K = seen_from_foot(np.array([0.0, p["beside"], -p["above"]]), K)
    return np.asarray(K * np.linalg.inv(K)[3, 3] / p["tilt"])


def _draw_bearing(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_bearing(request)
    if request.form == "housing":
        return found | {"other": request.uniform(0.15, 0.6)}
    return found | {
        "loose": request.uniform(0.35, 0.6),  # stiffness that the loaded row has by itself
        "strain": request.log_uniform(2e-5, 3e-4),
    }


def _bearing(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with soft bearings.

    ``housing``: the seat of the bearing is softer one way, in a fork for instance, and that way stays with
    the link before the joint as that turns. Seen in finite-element models of castings; the ratio is an
    engineering estimate.

    ``unloading``: a pair of angular-contact rows under preload; past a moment one row has no load left, and
    the other holds alone. Bearing catalogues (SKF, Schaeffler) give the load at which it lifts.
    """
    p, machine = truth.parameters, reality.machine
    if truth.form == "unloading":
        return author1.with_tilting(truth, reality, lambda e, k: slackening(e, k, p["loose"], p["strain"]))
    for name, own in joints_of(machine.robot, str(truth.component)):
        machine = _seated(machine, name, own, dict(p))
    return reality.with_machine(machine)


def _seated(machine: Machine, joint: str, own: int, p: dict[str, float]) -> Machine:
    """Return the machine with a seat between a joint and the link that it is mounted in."""
    hinge, placed = machine.hinge(joint), in_the_middle(machine.robot)
    at = int(machine.node(hinge.nodes[0]).frame == hinge.frame)  # the node that does not turn with the joint
    host = machine.node(hinge.nodes[at])
    seat = host.model_copy(update={"name": free_name(machine, "seat")})
    c, s = math.cos(p["turned"]), math.sin(p["turned"])
    across = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    axes = placed.rotations[host.frame][0].T @ placed.rotations[hinge.frame][0] @ hinge.axes @ across
    soft = np.array(
        [p["axial"], p["radial"], p["radial"] * p["other"], 0.0, p["tilt"] * p["other"], p["tilt"]]
    )
    soft[own] = 0.0
    with np.errstate(divide="ignore"):
        # the seat comes first: where errors of the geometry move the joint, the host follows
        held = Hinge(seat.name, (seat.name, host.name), host.frame, axes, 1.0 / soft)
    nodes = (seat.name, hinge.nodes[1]) if at == 0 else (hinge.nodes[0], seat.name)
    machine = machine.with_hinge(dataclasses.replace(hinge, nodes=nodes))
    return machine.plus(nodes=(seat,), hinges=(held,))


def _draw_link(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_link(request)
    found["side"] = request.uniform(0.0, 2.0 * math.pi)
    if request.form == "channel":
        return found | {"beside": request.uniform(0.04, 0.12)}  # m for a metre of length
    return found | {
        "beside": request.uniform(0.05, 0.12),
        "uneven": request.uniform(0.5, 1.0),  # second leg's section over the first one's
    }


def _link(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a link that bends.

    ``channel``: an open section, whose shear centre lies beside the line from joint to joint, so that forces
    across twist it. Any textbook of strength of materials.

    ``fork``: two legs side by side between stiff ends, as forked arms have; one may be the weaker. Any
    textbook; the distances are an engineering estimate.
    """
    p, machine = dict(truth.parameters), reality.machine
    name = str(truth.component)
    beam = next((bar for bar in machine.bars if bar.name == name), None)
    if beam is None:
        nodes = next(nodes for rigid, nodes in machine.rigids if rigid == name)
        rigidity = p["EI"] * np.array([1 / 0.12**2, np.inf, np.inf, p["twist"], p["flat"], 1.0])
        profile = tapered(rigidity, lambda x: np.ones_like(x))
        beam = Bar(name, nodes, profile, author1.up_of(machine, nodes))
    else:
        profile = Profile(beam.profile.stations, beam.profile.compliance * p["softer"])
        beam = dataclasses.replace(beam, profile=profile)
    machine = machine.without(name)
    if truth.form == "channel":
        return reality.with_machine(_beside(machine, beam, p["beside"], p["side"], 1.0))
    shares = np.array([1.0, p["uneven"]]) / (1.0 + p["uneven"])
    for way, share in zip((1.0, -1.0), shares, strict=True):
        machine = _beside(machine, beam, way * p["beside"], p["side"], float(share))
    return reality.with_machine(machine)


def _beside(machine: Machine, bar: Bar, beside: float, side: float, share: float) -> Machine:
    """Return the machine with a share of a bar, that far from its line, a share of its length."""
    placed = in_the_middle(machine.robot)
    ends = [machine.node(name) for name in bar.nodes]
    a, b = (placed.node(node)[0] for node in ends)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across = across / np.linalg.norm(across)
    away = (
        beside * np.linalg.norm(b - a) * (math.cos(side) * across + math.sin(side) * np.cross(along, across))
    )
    names: list[str] = []
    for end, place in zip(ends, (a, b), strict=True):
        node = node_at(machine, placed, end.frame, place + away, "leg")
        names.append(node.name)
        tie = (f"{end.name} {node.name}", (end.name, node.name))
        machine = machine.plus(nodes=(node,), rigids=(tie,))
    profile = Profile(bar.profile.stations, bar.profile.compliance / share)
    leg = Bar(f"{bar.name} {names[0]}", (names[0], names[1]), profile, bar.up, share * bar.weight)
    return machine.plus(bars=(leg,))


EFFECTS: tuple[Effect, ...] = (
    Effect("base-compliance", ("carriage", "girder"), nowhere, _draw_base, _base),
    Effect("bearing-tilt", ("housing", "unloading"), author1.bearings, _draw_bearing, _bearing),
    Effect("link-bending", ("channel", "fork"), author1.links, _draw_link, _link),
)
