"""Third forms of the drives' springs: play, hardening, and joints that are not stiff."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, stroke, turns
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.laws import Curve, Forgetful, Law, Memory, Situation, Stiffness, WindUp
from beamstiff.exam.reality import Reality

Curved = tuple[Array, Array]
PER_METRE = 6.0  # rad of a pinion's turn for a metre of its rack
ROUNDED = 0.02  # of the play, about which a flank's contact closes
PINS = 18  # of a cycloid disc that can carry one way
FURTHEST = 0.9  # share of half a band's length that a strand can lose to the other


@dataclass(frozen=True)
class Posed(Forgetful):
    """A spring whose force curve changes with the pose.

    `curve`: force and its slope, (P,) each, from the strain (P,) and the situation.
    """

    curve: Callable[[Array, Situation], Curved]

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, slope and no memory."""
        force, slope = self.curve(strain, situation)
        return force, slope, memory


def _angle(truth: Truth, reality: Reality, situation: Situation) -> Array:
    """Return the angle of the joint's own wheel, rad: of a pinion where the joint slides."""
    q = situation.value(str(truth.component))
    return q if turns(reality.machine.robot, truth.component) else PER_METRE * q


def _draw_play(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_backlash(request)
    if request.form == "runout":
        return found | {"depth": request.uniform(0.3, 0.9), "phase": request.uniform(0.0, 2.0 * np.pi)}
    scale = 1.0 if turns(request.robot, request.component) else 0.1
    return found | {
        "preload": scale * request.log_uniform(2e-5, 1e-4),  # torque over the stiffness
        "growth": request.uniform(0.3, 1.0),  # of the preload while the play is crossed
        "way": request.sign(),
    }


def _play(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with play in the drive.

    ``runout``: the output gear sits off its centre, so that the play between its flanks grows and shrinks
    once a turn; known from gear metrology (radial run-out and tooth thickness, ISO 1328, make the range of
    the backlash), its depth an engineering estimate.

    ``scissors``: a split gear whose halves a spring spreads holds both flanks; a torque above the spring's
    preload crosses the whole play, one way only. Anti-backlash gears, any textbook of machine elements; the
    preloads are an engineering estimate.
    """
    p = truth.parameters
    h, left = p["half"], p["left"]

    def runout(e: Array, situation: Situation, k: float) -> Curved:
        half = h * (1.0 + p["depth"] * np.cos(_angle(truth, reality, situation) + p["phase"]))
        force, slope = left * k * e, np.full_like(e, left * k)
        for side in (1.0, -1.0):
            z = side * e - half
            root = np.hypot(z, ROUNDED * h)
            force = force + side * (1.0 - left) * k * 0.5 * (z + root)
            slope = slope + (1.0 - left) * k * 0.5 * (1.0 + z / root)
        return force, slope

    def scissors(torque: Array, k: float) -> Curved:
        width = p["growth"] * p["preload"] * k
        x = (p["way"] * torque - p["preload"] * k) / width
        root, before = np.hypot(1.0, x), 1.0 / p["growth"]
        crossed = h * (x / root + before / np.hypot(1.0, before))
        return torque / k + p["way"] * crossed, 1.0 / k + h / (width * root**3)

    if truth.form == "runout":
        return at_joints(truth, reality, lambda k: Posed(lambda e, situation: runout(e, situation, k)))
    return at_joints(truth, reality, lambda k: WindUp(lambda torque: scissors(torque, k), k))


def _draw_hardening(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_hardening(request)
    if request.form == "lobes":
        return found | {"shortened": request.uniform(0.6, 0.8)}
    return found | {"coast": request.log_uniform(1.5, 5.0) ** request.sign()}


def levers(shortened: float) -> Array:
    """Return the lever arms of a cycloid disc's pins, over the longest one that there can be."""
    angle = (np.arange(PINS) + 0.5) * np.pi / PINS
    return np.asarray(np.sin(angle) / np.sqrt(1.0 + shortened**2 - 2.0 * shortened * np.cos(angle)))


def _hardening(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a drive that grows stiffer with torque.

    ``lobes``: in a cycloid reducer relieved flanks of the disc leave gaps at all pins but one, which close
    one after another as it winds up, so that ever more pins carry. The gaps are those of Yu and others for a
    relieved disc, ``g (1 - l)`` with l a pin's lever (given in papers on the load distribution in RV gears);
    the pins that carry from the start are an engineering estimate.

    ``hypoid``: flanks of different pressure angle carry either way, as in hypoid and bevel gears (Gleason);
    the stiffness rises both ways but from different torques. The curve is an engineering estimate.
    """
    p = truth.parameters

    def lobes(e: Array, k: float) -> Curved:
        arm = levers(p["shortened"])
        closed = np.abs(e)[:, None] * arm - p["bend"] * (1.0 - arm)
        more = k * (p["hard"] - p["soft"]) / float(arm @ arm)
        force = k * p["soft"] * e + np.sign(e) * more * (np.maximum(closed, 0.0) @ arm)
        return force, k * p["soft"] + more * ((closed > 0.0) @ arm**2)

    def hypoid(torque: Array, k: float) -> Curved:
        more = (1.0 / p["soft"] - 1.0 / p["hard"]) / k
        knee = 0.5 * k * p["bend"] * np.where(torque < 0.0, p["coast"], 1.0)
        x = torque / knee
        return torque / (k * p["hard"]) + more * knee * np.arcsinh(x), 1.0 / (
            k * p["hard"]
        ) + more / np.hypot(1.0, x)

    if truth.form == "lobes":
        return at_joints(truth, reality, lambda k: Curve(lambda e: lobes(e, k)))
    return at_joints(truth, reality, lambda k: WindUp(lambda torque: hypoid(torque, k), k * p["hard"]))


def _draw_compliance(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_compliance(request)
    if request.form == "strands":
        return found | {"reach": request.uniform(0.5, 0.85)}
    return found | {
        "spokes": request.integer(3, 7),
        "depth": request.uniform(0.2, 0.6),
        "phase": request.uniform(0.0, 2.0 * np.pi),
    }


def _compliance(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a joint that the model holds stiff.

    ``strands``: a band or cable pulls it from either side, and what one strand gains in length the other
    loses, so that the two together are softest in the middle of the stroke: ``1/L1 + 1/L2``. Catalogues of
    belt-driven axes (Gates, HIWIN) compute the stiffness so.

    ``spokes``: the wheel that holds the joint is softer between its spokes or bolts than at them. Known of
    bull gears and turntables; the depth is an engineering estimate.
    """
    p = truth.parameters
    middle, half = stroke(reality.machine.robot, truth.component)

    def strands(situation: Situation) -> Array:
        q = situation.value(str(truth.component), middle)
        share = np.clip(p["reach"] * (q - middle) / half, -FURTHEST, FURTHEST)
        return np.asarray(p["stiffness"] / (1.0 - share**2))

    def spokes(situation: Situation) -> Array:
        wave = np.cos(p["spokes"] * _angle(truth, reality, situation) + p["phase"])
        return np.asarray(p["stiffness"] / (1.0 + p["depth"] * wave))

    law: Law = Stiffness(strands if truth.form == "strands" else spokes)
    return at_joints(truth, reality, lambda _: law)


EFFECTS: tuple[Effect, ...] = (
    Effect("backlash", ("runout", "scissors"), drives, _draw_play, _play),
    Effect("hardening", ("lobes", "hypoid"), drives, _draw_hardening, _hardening),
    Effect("joint-compliance", ("strands", "spokes"), author1.rigid_joints, _draw_compliance, _compliance),
)
