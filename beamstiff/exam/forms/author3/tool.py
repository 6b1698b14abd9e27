"""Third forms at the tool: a changer on three balls, a remote centre, and loads hung on in other places."""

import math

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, sprung
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender
from beamstiff.exam.draws import PHASE, SEED, by_ratio, direction, each, evenly, sized
from beamstiff.exam.effect import Seen, built, load
from beamstiff.exam.forms.author1 import tool as author1
from beamstiff.exam.laws import Curved, curved
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import Parameters, vector

LIFTED = 0.1  # of the contacts' stiffness, that the clamp has by itself
MINDLIN = 0.8  # stiffness of a ball's contact across over that along its normal
FIRM = 20.0  # of a remote centre: stiffness along its axis over that across


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

    Their contacts stiffen as they are pressed and soften as they are lifted (A. H. Slocum, Precision machine
    design, 1992); the clamping forces, N on each ball, are an engineering estimate.
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

    A force there moves the tool without tilting it (D. E. Whitney, 1982). `reach`: m, root of what it gives
    across over what it tilts.
    """
    about = author1.about_tool(p)
    across = 1.0 / (about[:2] * p["reach"] ** 2)
    k = np.concatenate([across, [FIRM * across[0]], 1.0 / about])
    return sprung(*behind_flange(machine), p["ahead"] * UP, k)


def eyes(p: Parameters) -> Array:
    """Return the places of the eye bolts of a loading adapter, (5, 3), m from the TCP in its frame."""
    angles = p["turned"] + 0.5 * math.pi * np.arange(4)
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(4)], axis=-1)
    return np.asarray(p["away"] * np.concatenate([around, [[0.0, 0.0, p["tip"]]]]))


def _at_eyes(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads hooked into that eye bolt of an adapter, one on each of its sides, that faces them.

    Common practice with dead weights and pulleys. `tip`: distance of the eye ahead over that of the others.
    """
    places, axes = eyes(p), seen.tool_axes
    own = np.einsum("nji,nj->ni", axes, wrench[:, :3])
    facing = np.argmax(own @ (places / np.linalg.norm(places, axis=1, keepdims=True)).T, axis=1)
    return seen.with_arm(wrench, (axes @ places[facing][..., None])[..., 0])


def _rehung(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads by a sling laid on anew in each pose, beside the TCP but never quite the same.

    Common practice; the scatter, by the pose's number whichever others are measured, is an engineering
    estimate.
    """
    poses = np.unique(seen.campaign.pose)
    apart = np.array(
        [np.random.default_rng([int(p["seed"]), int(pose)]).standard_normal(3) for pose in poses]
    )
    at = vector(p) + p["scatter"] * apart[np.searchsorted(poses, seen.campaign.pose)]
    return seen.with_arm(wrench, (seen.tool_axes @ (p["away"] * at)[..., None])[..., 0])


_TILT, _AWAY = sized(*author1.TURN), sized(*author1.AWAY)
FORMS = (
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
