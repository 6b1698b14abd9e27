"""Third forms of soft structure: base, bearings and links."""

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import (
    about_x,
    across_link,
    ends_of,
    free_name,
    node_at,
    on_pedestal,
    seen_from_foot,
)
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import in_the_middle
from beamstiff.exam.draws import PHASE, by_ratio, evenly
from beamstiff.exam.effect import built
from beamstiff.exam.forms.author1 import structure as author1
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import Curved
from beamstiff.exam.layout import tip_stiffness
from beamstiff.exam.machine import Bar, Hinge, Machine, Profile, joints_of, tapered
from beamstiff.exam.parameters import Draw, Parameters


def _base(stiffness: Callable[[Parameters], Array], p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a soft base, turned about the vertical.

    ``carriage``: the robot rides on a seventh axis, held by four guide blocks on rails and, along them, by
    the rack's drive, which is softer. Common in body shops; block stiffness as in catalogues (Bosch Rexroth,
    THK), the drive's an engineering estimate. `long`, `wide`: m, half the distances of the guide blocks;
    `across`: sideways over upright; `rack`: along the rails over one block's upright.

    ``girder``: it stands on a bridge that is clamped at both ends, beside the bridge's axis, as on gantries
    and platforms; sizes are an engineering estimate.
    """
    c, s = math.cos(p["turned"]), math.sin(p["turned"])
    turned = np.kron(np.eye(2), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    return on_pedestal(machine, turned @ stiffness(p) @ turned.T)


def carriage(p: Parameters) -> Array:
    """Return the stiffness of a carriage at the foot, its rails along x."""
    upright = 1.0 / (4.0 * p["tilt"] * p["wide"] ** 2)
    rack = np.diag([p["rack"] * upright, 0.0, 0.0, 0.0, 0.0, 0.0])
    K = seen_from_foot(np.array([0.0, 0.0, -p["low"]]), rack)
    for x in (p["long"], -p["long"]):
        for y in (p["wide"], -p["wide"]):
            block = np.diag([0.0, p["across"] * upright, upright, 0.0, 0.0, 0.0])
            K = K + seen_from_foot(np.array([x, y, -p["low"]]), block)
    return np.asarray(K)


def girder(p: Parameters) -> Array:
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


def _housing(p: Parameters, machine: Machine, component: str) -> Machine:
    """Return the machine with a bearing whose seat is softer one way, in a fork for instance.

    That way stays with the link before the joint as that turns. Seen in finite-element models of castings;
    the ratio is an engineering estimate.
    """
    for name, own in joints_of(machine.robot, component):
        machine = _seated(machine, name, own, p)
    return machine


def _seated(machine: Machine, joint: str, own: int, p: Parameters) -> Machine:
    """Return the machine with a seat between a joint and the link that it is mounted in."""
    hinge, placed = machine.hinge(joint), in_the_middle(machine.robot)
    at = int(machine.node(hinge.nodes[0]).frame == hinge.frame)  # the node that does not turn with the joint
    host = machine.node(hinge.nodes[at])
    seat = host.model_copy(update={"name": free_name(machine, "seat")})
    axes = placed.rotations[host.frame][0].T @ placed.rotations[hinge.frame][0] @ hinge.axes
    soft = np.array(
        [p["axial"], p["radial"], p["radial"] * p["other"], 0.0, p["tilt"] * p["other"], p["tilt"]]
    )
    soft[own] = 0.0
    with np.errstate(divide="ignore"):
        # the seat comes first: where errors of the geometry move the joint, the host follows
        held = Hinge(seat.name, (seat.name, host.name), host.frame, axes @ about_x(p["turned"]), 1.0 / soft)
    nodes = (seat.name, hinge.nodes[1]) if at == 0 else (hinge.nodes[0], seat.name)
    machine = machine.with_hinge(dataclasses.replace(hinge, nodes=nodes))
    return machine.plus(nodes=(seat,), hinges=(held,))


def _unloading(p: Parameters, k: float, e: Array) -> Curved:
    """Return a pair of angular-contact rows under preload.

    Past a moment one row has no load left, and the other holds alone, with the stiffness `loose`. Bearing
    catalogues (SKF, Schaeffler) give the load at which it lifts.
    """
    return slackening(e, k, p["loose"], p["strain"])


def _link(fork: bool, p: Parameters, machine: Machine, name: str) -> Machine:
    """Return the machine with a link that bends.

    ``channel``: an open section, whose shear centre lies beside the line from joint to joint, so that forces
    across twist it. Any textbook of strength of materials.

    ``fork``: two legs side by side between stiff ends, as forked arms have; one may be the weaker, by
    `uneven`. Any textbook; the distances, shares of the length, are an engineering estimate.
    """
    beam = next((bar for bar in machine.bars if bar.name == name), None)
    if beam is None:
        nodes = dict(machine.rigids)[name]
        profile = tapered(author1.rigidity_of(p), lambda x: np.ones_like(x))
        beam = Bar(name, nodes, profile, author1.up_of(machine, nodes))
    else:
        profile = Profile(beam.profile.stations, beam.profile.compliance * p["softer"])
        beam = dataclasses.replace(beam, profile=profile)
    machine = machine.without(name)
    if not fork:
        return _beside(machine, beam, p["beside"], p["side"], 1.0)
    shares = np.array([1.0, p["uneven"]]) / (1.0 + p["uneven"])
    for way, share in zip((1.0, -1.0), shares, strict=True):
        machine = _beside(machine, beam, way * p["beside"], p["side"], float(share))
    return machine


def _beside(machine: Machine, bar: Bar, beside: float, side: float, share: float) -> Machine:
    """Return the machine with a share of a bar, that far from its line, a share of its length."""
    placed, a, b = ends_of(machine, bar.nodes)
    away = beside * np.linalg.norm(b - a) * across_link(a, b, side)
    names: list[str] = []
    for end, place in zip(bar.nodes, (a, b), strict=True):
        node = node_at(machine, placed, machine.node(end).frame, place + away, "leg")
        names.append(node.name)
        machine = machine.plus(nodes=(node,), rigids=((f"{end} {node.name}", (end, node.name)),))
    profile = Profile(bar.profile.stations, bar.profile.compliance / share)
    leg = Bar(f"{bar.name} {names[0]}", (names[0], names[1]), profile, bar.up, share * bar.weight)
    return machine.plus(bars=(leg,))


_BASE: dict[str, Draw] = {"tilt": author1.TILT, "turned": evenly(0.0, math.pi)}
FORMS = (
    built("base-compliance", "carriage", partial(_base, carriage), **_BASE,
          long=evenly(0.3, 0.6), wide=evenly(0.25, 0.5), across=evenly(0.5, 1.0), rack=evenly(0.1, 0.5),
          low=evenly(0.1, 0.4)),
    built("base-compliance", "girder", partial(_base, girder), **_BASE,
          span=evenly(2.0, 5.0), place=evenly(0.25, 0.75), beside=evenly(-0.3, 0.3), above=evenly(0.1, 0.4),
          flat=evenly(0.2, 0.8), twist=evenly(0.2, 0.6)),
    built("bearing-tilt", "housing", _housing, author1.draw_bearing, other=evenly(0.15, 0.6)),
    built("bearing-tilt", "unloading", partial(author1.with_tilting, _unloading),
          author1.draw_bearing, loose=evenly(0.35, 0.6), strain=by_ratio(2e-5, 3e-4)),
    built("link-bending", "channel", partial(_link, False),
          author1.draw_link, side=PHASE, beside=evenly(0.04, 0.12)),
    built("link-bending", "fork", partial(_link, True),
          author1.draw_link, side=PHASE, beside=evenly(0.05, 0.12), uneven=evenly(0.5, 1.0)),
)  # fmt: skip
