"""Further forms of levers and balancers: a four-bar linkage, a long screw, nested coils, a disc."""

import numpy as np

from beamstiff.exam.added_parts import crank_stiffness, lever, stretch, turned, with_balancer
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import stroke
from beamstiff.exam.draws import PHASE, SIGN, evenly
from beamstiff.exam.effect import at_joints, built, form, law
from beamstiff.exam.forms.author1 import levers as author1
from beamstiff.exam.laws import Law, Situation, varying
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import DrawRequest, Parameters
from beamstiff.exam.reality import Reality

REACH = np.deg2rad([12.0, 45.0])  # half the turn that a four-bar linkage serves; gears beyond it
MARGIN = np.deg2rad(4.0)
TRIED = 300
FLAT = 0.2  # sine of the least angle between coupler and crank or lever
DEAD = 0.6  # of the shortest length between a screw's ends: what the nut and bearings take
BLUNT = 0.02  # m over which a second coil engages


def _linkage(swing: Array, p: Parameters) -> tuple[Array, Array]:
    """Return the crank's turn over the lever's (length 1), and how far the linkage is from flat or open."""
    end = np.stack([np.cos(swing), np.sin(swing)], axis=-1)
    apart = end - np.array([p["base"], 0.0])
    distance = np.linalg.norm(apart, axis=-1)
    cosine = (p["crank"] ** 2 + distance**2 - p["coupler"] ** 2) / (2.0 * p["crank"] * distance)
    angle = np.arctan2(apart[..., 1], apart[..., 0]) + np.arccos(np.clip(cosine, -1.0, 1.0))
    pin = np.array([p["base"], 0.0]) + p["crank"] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    along = (end - pin) / p["coupler"]
    arms = [along[..., 1] * np.cos(a) - along[..., 0] * np.sin(a) for a in (swing, angle)]
    clear = np.where(np.abs(cosine) < 1.0, np.minimum(np.abs(arms[0]), np.abs(arms[1])), 0.0)
    ratio = np.abs(arms[0]) / (p["crank"] * np.maximum(np.abs(arms[1]), 1e-3))
    return ratio, clear


def _draw_linkage(request: DrawRequest) -> dict[str, float]:
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*author1.SWING)
    even = np.linspace(-1.0, 1.0, 31)
    best, found = np.inf, dict[str, float]()
    for crank, base, longer, start, share in request.rng.uniform(
        [0.6, 1.5, 0.8, 0.3, 0.0], [1.2, 3.0, 1.3, 2.8, 1.0], (TRIED, 5)
    ):
        reach = min(half, REACH[0] + share * (REACH[1] - REACH[0]))
        tried = {"crank": crank, "base": base, "coupler": base * longer, "start": start, "reach": reach}
        ratio, clear = _linkage(start + (reach + MARGIN) * even, tried)
        miss = abs(float(np.log((ratio.max() / ratio.min()) ** 2 / swing)))
        miss += 100.0 * max(0.0, FLAT - float(clear.min()))
        if miss < best:
            best, found = miss, {name: float(value) for name, value in tried.items()}
    return found | {"gear": found["reach"] / half, "way": request.sign(), "middle": middle}


def _four_bar(p: Parameters, k: float, variable: str) -> Law:
    def stiffness(situation: Situation) -> Array:
        turn = p["way"] * p["gear"] * (situation.values[variable] - p["middle"])
        turn = np.clip(turn, -p["reach"] - MARGIN, p["reach"] + MARGIN)
        ratio, _ = _linkage(p["start"] + turn, p)
        return np.asarray(k * (ratio / _linkage(np.array(p["start"]), p)[0]) ** 2)

    return varying(stiffness)


def _triangle(p: Parameters, angle: Array | float) -> tuple[Array, Array]:
    arm, length = lever(p["crank"], p["frame"], angle)
    return arm, length - DEAD * (p["frame"] - p["crank"])


def _screw(p: Parameters, k: float, variable: str) -> Law:
    """Return a screw's; `shaft`: give of its free length over that of nut and bearings, at mid-range."""

    def stiffness(situation: Situation) -> Array:
        (arm, shaft), (arm0, shaft0) = (
            _triangle(p, author1.angle_of(p, variable, situation)),
            _triangle(p, p["start"]),
        )
        return np.asarray(k * ((arm / arm0) ** 2 * (1.0 + p["shaft"]) / (1.0 + p["shaft"] * shaft / shaft0)))

    return varying(stiffness)


def _nested(p: Parameters, machine: Machine, variable: str) -> Machine:
    """Return the machine with two coils: from a stretch on, m, a second one with a share of the rate."""

    def beyond(situation: Situation) -> Array:
        return stretch(p, variable, situation) - p["engages"]

    def pull(situation: Situation) -> Array:
        z = beyond(situation)
        second = 0.5 * p["second"] * (z + np.hypot(z, BLUNT))
        return np.asarray(p["pull"] + p["growth"] * (stretch(p, variable, situation) + second))

    def rate(situation: Situation, strong: float) -> Array:
        z = beyond(situation)
        return np.asarray(strong * (1.0 + 0.5 * p["second"] * (1.0 + z / np.hypot(z, BLUNT))))

    return with_balancer(p, machine, variable, rate, pull)


def _disc(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a strap over a disc that turns with the joint, off its middle."""
    p, variable = truth.parameters, str(truth.component)
    strong = crank_stiffness(p, reality.machine, variable)

    def shape(situation: Situation) -> tuple[Array, Array, Array]:
        """Return the strap's pull, its arm and how that grows with the angle."""
        angle = turned(p, variable, situation)
        wound = angle + p["eccentric"] * (np.sin(angle - p["phase"]) + np.sin(p["phase"]))
        strap = np.maximum(p["pull"] + p["growth"] * p["side"] * p["crank"] * wound, 0.0)
        arm = p["crank"] * (1.0 + p["eccentric"] * np.cos(angle - p["phase"]))
        return strap, arm, -p["crank"] * p["eccentric"] * np.sin(angle - p["phase"])

    def torque(situation: Situation) -> Array:
        strap, arm, _ = shape(situation)
        return p["side"] * strap * arm

    def stiffness(situation: Situation, drive: float) -> Array:
        strap, arm, slope = shape(situation)
        return drive + (strong * arm**2 + p["side"] * strap * slope)

    return at_joints(truth, reality, lambda k: varying(lambda situation: stiffness(situation, k), torque))


FORMS = (
    law("actuator-lever", "four-bar", _four_bar, _draw_linkage),
    law("actuator-lever", "screw", _screw, author1.draw_lever, shaft=evenly(0.5, 2.0)),
    built("gravity-compensator", "nested", _nested,
          author1.draw_balancer, engages=evenly(-0.1, 0.1), second=evenly(0.5, 1.5)),
    form("gravity-compensator", "disc", _disc,
         author1.draw_balancer, side=SIGN, eccentric=evenly(0.2, 0.6), phase=PHASE),
)  # fmt: skip
