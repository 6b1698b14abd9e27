"""Third forms of soft structure, base to tool, and loads hung on in other places."""

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import (
    UP,
    about_x,
    across_link,
    behind_flange,
    on_pedestal,
    seen_from_foot,
    sprung,
)
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender
from beamstiff.exam.draws import PHASE, SEED, by_ratio, direction, each, evenly, sized
from beamstiff.exam.effect import Seen, built, built_at_joints, load
from beamstiff.exam.forms.author1 import structure as structure1
from beamstiff.exam.forms.author1 import tool as tool1
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import Curved, curved
from beamstiff.exam.layout import tip_stiffness
from beamstiff.exam.machine import Bar, Hinge, Machine, Profile, in_the_middle, tapered
from beamstiff.exam.parameters import Draw, Parameters, vector

LIFTED = 0.1  # of the contacts' stiffness, that the clamp has by itself
MINDLIN = 0.8  # stiffness of a ball's contact across over that along its normal
FIRM = 20.0  # of a remote centre: stiffness along its axis over that across


def _base(stiffness: Callable[[Parameters], Array], p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a soft base, turned about the vertical.

    ``carriage``: of a seventh axis, on four guide blocks (catalogues of Bosch Rexroth, THK) and a rack.
    `long`, `wide`: m, half the distances of the guide blocks; `across`: sideways over upright; `rack`: along
    the rails over one block's upright. ``girder``: beside the axis of a bridge that is clamped at both ends.
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
    profile = tapered(rigidity, np.ones_like)
    K = np.zeros((6, 6))
    for length, way in ((p["place"] * p["span"], 1.0), ((1.0 - p["place"]) * p["span"], -1.0)):
        axes = np.kron(np.eye(2), np.diag([way, way, 1.0]))
        K += axes @ tip_stiffness(profile, np.array([length]))[0] @ axes.T
    K = seen_from_foot(np.array([0.0, p["beside"], -p["above"]]), K)
    return np.asarray(K * np.linalg.inv(K)[3, 3] / p["tilt"])


def _housing(p: Parameters, machine: Machine, joint: str, own: int) -> Machine:
    """Return the machine with a bearing whose seat in the link before it is softer one way, as in a fork."""
    hinge, placed = machine.hinge(joint), in_the_middle(machine.robot)
    at = int(machine.node(hinge.nodes[0]).frame == hinge.frame)  # the node that does not turn with the joint
    host = machine.node(hinge.nodes[at])
    seat = host.model_copy(update={"name": machine.free_name("seat")})
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


def _link(fork: bool, p: Parameters, machine: Machine, name: str) -> Machine:
    """Return the machine with a link that bends.

    ``channel``: an open section, whose shear centre lies beside the line from joint to joint.
    ``fork``: two legs side by side between stiff ends; one may be the weaker, by `uneven`.
    """
    beam = next((bar for bar in machine.bars if bar.name == name), None)
    if beam is None:
        nodes = dict(machine.rigids)[name]
        profile = tapered(structure1.rigidity_of(p), np.ones_like)
        beam = Bar(name, nodes, profile, structure1.up_of(machine, nodes))
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
    a, b = machine.places(*bar.nodes)
    away = beside * np.linalg.norm(b - a) * across_link(a, b, side)
    names: list[str] = []
    for end, place in zip(bar.nodes, (a, b), strict=True):
        machine, name = machine.with_node_at("leg", machine.node(end).frame, place + away, end)
        names.append(name)
    profile = Profile(bar.profile.stations, bar.profile.compliance / share)
    leg = Bar(f"{bar.name} {names[0]}", (names[0], names[1]), profile, bar.up, share * bar.weight)
    return machine.plus(bars=(leg,))


_BASE: dict[str, Draw] = {"tilt": structure1.TILT, "turned": evenly(0.0, math.pi)}


def hertzian(pressed: Array, k: float, clamped: float) -> Curved:
    """Return the force over its clamping that a ball takes, and its slope, from the approach (P,).

    The approach grows with the load's power 2/3; k is the stiffness under the clamping force. Where the ball
    lifts the clamp alone is left.
    """
    scale = 1.5 * clamped / k
    root = np.sqrt(np.maximum(1.0 + pressed / scale, 0.0))
    force = LIFTED * k * pressed + (1.0 - LIFTED) * clamped * (root**3 - 1.0)
    return force, k * (LIFTED + (1.0 - LIFTED) * root)


def _balls(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a tool changer or kinematic coupling that seats on three balls under a clamp.

    Their contacts stiffen as they are pressed (A. H. Slocum, Precision machine design, 1992). `clamped`: N.
    """
    machine, flange = behind_flange(machine)
    angles = p["first"] + 2.0 * math.pi / 3.0 * np.arange(3)
    shares = np.array([p[f"ball{i}"] for i in range(3)])
    contacts = p["radius"] * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
    upright = shares / (p["tilt"] * float(shares @ contacts[:, 1] ** 2))
    for contact, k in zip(contacts, upright, strict=True):

        def ball(e: Array, k: float = float(k)) -> Curved:
            force, slope = hertzian(-e, k, p["clamped"])  # pressed where the tool comes nearer
            return -force, slope

        springs = np.array([MINDLIN * k, MINDLIN * k, k, 0.0, 0.0, 0.0])
        machine = sprung(machine, flange, contact - p["behind"] * UP, springs, {2: curved(ball)})
    return machine


def _remote_centre(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a compliant device for assembly, its elastic centre at or ahead of the tip.

    (D. E. Whitney, 1982.) `reach`: m, root of what it gives across over what it tilts.
    """
    about = tool1.about_tool(p)
    across = 1.0 / (about[:2] * p["reach"] ** 2)
    k = np.concatenate([across, [FIRM * across[0]], 1.0 / about])
    return sprung(*behind_flange(machine), p["ahead"] * UP, k)


def eyes(p: Parameters) -> Array:
    """Return the places of the eye bolts of a loading adapter, (5, 3), m from the TCP in its frame."""
    angles = p["turned"] + 0.5 * math.pi * np.arange(4)
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(4)], axis=-1)
    return np.asarray(p["away"] * np.concatenate([around, [[0.0, 0.0, p["tip"]]]]))


def _at_eyes(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads hooked into that eye bolt of an adapter, one on each of its sides, that faces them."""
    places, axes = eyes(p), seen.tool_axes
    own = np.einsum("nji,nj->ni", axes, wrench[:, :3])
    facing = np.argmax(own @ (places / np.linalg.norm(places, axis=1, keepdims=True)).T, axis=1)
    return seen.with_arm(wrench, (axes @ places[facing][..., None])[..., 0])


def _rehung(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads by a sling laid on anew in each pose, beside the TCP, never quite the same."""
    poses = np.unique(seen.campaign.pose)
    apart = np.array(
        [np.random.default_rng([int(p["seed"]), int(pose)]).standard_normal(3) for pose in poses]
    )
    at = vector(p) + p["scatter"] * apart[np.searchsorted(poses, seen.campaign.pose)]
    return seen.with_arm(wrench, (seen.tool_axes @ (p["away"] * at)[..., None])[..., 0])


_TILT, _AWAY = sized(*tool1.TURN), sized(*tool1.AWAY)


FORMS = (
    built("base-compliance", "carriage", partial(_base, carriage), **_BASE,
          long=evenly(0.3, 0.6), wide=evenly(0.25, 0.5), across=evenly(0.5, 1.0), rack=evenly(0.1, 0.5),
          low=evenly(0.1, 0.4)),
    built("base-compliance", "girder", partial(_base, girder), **_BASE,
          span=evenly(2.0, 5.0), place=evenly(0.25, 0.75), beside=evenly(-0.3, 0.3), above=evenly(0.1, 0.4),
          flat=evenly(0.2, 0.8), twist=evenly(0.2, 0.6)),
    built_at_joints("bearing-tilt", "housing", _housing, structure1.draw_bearing, other=evenly(0.15, 0.6)),
    # a preloaded pair of angular-contact rows, one of which lifts (catalogues of SKF, Schaeffler)
    built_at_joints("bearing-tilt", "unloading", partial(structure1.with_tilting, slackening),
                    structure1.draw_bearing, loose=evenly(0.35, 0.6), **{"from": by_ratio(2e-5, 3e-4)}),
    built("link-bending", "channel", partial(_link, False),
          structure1.draw_link, side=PHASE, beside=evenly(0.04, 0.12)),
    built("link-bending", "fork", partial(_link, True),
          structure1.draw_link, side=PHASE, beside=evenly(0.05, 0.12), uneven=evenly(0.5, 1.0)),
    built("tool-compliance", "balls", _balls,
          tilt=_TILT, **{f"ball{i}": evenly(0.7, 1.0) for i in range(3)}, behind=evenly(0.02, 0.12),
          radius=evenly(0.03, 0.07), first=PHASE, clamped=lambda r: by_ratio(1e3, 6e3)(r) / slender(r.robot)),
    built("tool-compliance", "remote-centre", _remote_centre,
          tilt=_TILT, ahead=evenly(0.0, 0.06), reach=evenly(0.05, 0.12), other=evenly(0.7, 1.0),
          about=evenly(0.3, 1.0)),
    load("tool-offset", "eyes", _at_eyes, away=_AWAY, turned=PHASE, tip=evenly(0.5, 1.5)),
    load("tool-offset", "rehung", _rehung,
         each(away=_AWAY), direction(), scatter=evenly(0.2, 0.5), seed=SEED),
)  # fmt: skip
