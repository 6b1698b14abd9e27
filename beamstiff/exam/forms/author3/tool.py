"""Third forms at the tool: a changer on three balls, a remote centre, and loads hung on in other places."""

import math

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, sprung
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, slender, vector
from beamstiff.exam.forms.author1 import tool as author1
from beamstiff.exam.laws import Curve
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality

LIFTED = 0.1  # of the contacts' stiffness, that the clamp has by itself
MINDLIN = 0.8  # stiffness of a ball's contact across over that along its normal
FIRM = 20.0  # of a remote centre: stiffness along its axis over that across


def _draw_soft(request: DrawRequest) -> dict[str, float]:
    found = {"tilt": request.sized(*author1.TURN)}
    if request.form == "balls":
        return (
            found
            | {f"ball{i}": request.uniform(0.7, 1.0) for i in range(3)}
            | {
                "behind": request.uniform(0.02, 0.12),
                "radius": request.uniform(0.03, 0.07),
                "first": request.uniform(0.0, 2.0 * math.pi),
                # N on each ball; a small robot's changer is smaller
                "clamped": request.log_uniform(1e3, 6e3) / slender(request.robot),
            }
        )
    return found | {
        "ahead": request.uniform(0.0, 0.06),
        "reach": request.uniform(0.05, 0.12),  # m, root of what it gives across over what it tilts
        "other": request.uniform(0.7, 1.0),
        "about": request.uniform(0.3, 1.0),
    }


def hertzian(pressed: Array, k: float, clamped: float) -> tuple[Array, Array]:
    """Return the force over its clamping that a ball takes, and its slope, from the approach (P,).

    The approach grows with the load's power 2/3; k is the stiffness under the clamping force. Where the ball
    lifts the clamp alone is left.
    """
    scale = 1.5 * clamped / k
    root = np.sqrt(np.maximum(1.0 + pressed / scale, 0.0))
    force = LIFTED * k * pressed + (1.0 - LIFTED) * clamped * (root**3 - 1.0)
    return force, k * (LIFTED + (1.0 - LIFTED) * root)


def _soft(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a soft tool.

    ``balls``: a tool changer or kinematic coupling seats on three balls under a clamp, whose contacts stiffen
    as they are pressed and soften as they are lifted (A. H. Slocum, Precision machine design, 1992); the
    clamping forces are an engineering estimate.

    ``remote-centre``: a compliant device for assembly, whose elastic centre lies at or ahead of the tip, so
    that a force there moves the tool without tilting it (D. E. Whitney, 1982).
    """
    p, (machine, flange) = dict(truth.parameters), behind_flange(reality.machine)
    if truth.form == "remote-centre":
        about = p["tilt"] * np.array([1.0, p["other"], p["about"]])
        across = 1.0 / (about[:2] * p["reach"] ** 2)
        k = np.concatenate([across, [FIRM * across[0]], 1.0 / about])
        return reality.with_machine(sprung(machine, flange, p["ahead"] * UP, k))
    angles = p["first"] + 2.0 * math.pi / 3.0 * np.arange(3)
    shares = np.array([p[f"ball{i}"] for i in range(3)])
    contacts = p["radius"] * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
    upright = shares / (p["tilt"] * float(shares @ contacts[:, 1] ** 2))
    for contact, k in zip(contacts, upright, strict=True):

        def ball(e: Array, k: float = float(k)) -> tuple[Array, Array]:
            force, slope = hertzian(-e, k, p["clamped"])  # pressed where the tool comes nearer
            return -force, slope

        springs = np.array([MINDLIN * k, MINDLIN * k, k, 0.0, 0.0, 0.0])
        machine = sprung(machine, flange, contact - p["behind"] * UP, springs, {2: Curve(ball)})
    return reality.with_machine(machine)


def _draw_offset(request: DrawRequest) -> dict[str, float]:
    found = {"away": request.sized(*author1.AWAY)}
    if request.form == "eyes":
        return found | {
            "turned": request.uniform(0.0, 2.0 * math.pi),
            "tip": request.uniform(0.5, 1.5),  # distance of the eye ahead over that of the others
        }
    found |= request.direction()
    return found | {"scatter": request.uniform(0.2, 0.5), "seed": request.integer(0, 2**31)}


def eyes(p: dict[str, float]) -> Array:
    """Return the places of the eye bolts of a loading adapter, (5, 3), m from the TCP in its frame."""
    angles = p["turned"] + 0.5 * math.pi * np.arange(4)
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(4)], axis=-1)
    return np.asarray(p["away"] * np.concatenate([around, [[0.0, 0.0, p["tip"]]]]))


def _offset(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a load that acts beside the TCP.

    ``eyes``: an adapter has an eye bolt on each of its sides, and the load is hooked into the one that faces
    it. Common practice with dead weights and pulleys.

    ``rehung``: the sling is laid on anew in each pose, about a place beside the TCP but never quite the same.
    Common practice; the scatter is an engineering estimate.
    """
    p, machine = dict(truth.parameters), reality.machine

    def beside(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        force, axes = wrench[:, :3], placed.rotations[machine.node(machine.tcp).frame]
        if truth.form == "eyes":
            places = eyes(p)
            own = np.einsum("nji,nj->ni", axes, force)
            facing = np.argmax(own @ (places / np.linalg.norm(places, axis=1, keepdims=True)).T, axis=1)
            local = places[facing]
        else:
            middle, poses = vector(p), np.unique(campaign.pose)
            apart = np.array([_scatter(int(p["seed"]), int(pose)) for pose in poses])
            local = p["away"] * (middle + p["scatter"] * apart[np.searchsorted(poses, campaign.pose)])
        arm = (axes @ local[..., None])[..., 0]
        moment = np.where((campaign.load_point == machine.tcp)[:, None], np.cross(arm, force), 0.0)
        return np.concatenate([force, wrench[:, 3:] + moment], axis=1)

    return reality.with_load(beside)


def _scatter(seed: int, pose: int) -> Array:
    """Return three normal numbers of a pose, whichever other poses are measured."""
    return np.random.default_rng([seed, pose]).standard_normal(3)


EFFECTS: tuple[Effect, ...] = (
    Effect("tool-compliance", ("balls", "remote-centre"), nowhere, _draw_soft, _soft),
    Effect("tool-offset", ("eyes", "rehung"), nowhere, _draw_offset, _offset),
)
