"""Further forms of levers and balancers: a four-bar linkage, a long screw, nested coils, a disc."""

import numpy as np

from beamstiff.exam.added_parts import lever, with_balancer
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, stiffness_of, stroke
from beamstiff.exam.forms.author1 import levers as author1
from beamstiff.exam.laws import Situation, Stiffness
from beamstiff.exam.reality import Reality

REACH = np.deg2rad([12.0, 45.0])  # half the turn that a four-bar linkage serves; gears beyond it
MARGIN = np.deg2rad(4.0)
TRIED = 300
FLAT = 0.2  # sine of the least angle between coupler and crank or lever
DEAD = 0.6  # of the shortest length between a screw's ends: what the nut and bearings take
BLUNT = 0.02  # m over which a second coil engages


def _linkage(turn: Array, p: dict[str, float]) -> tuple[Array, Array]:
    """Return the crank's turn over the lever's (length 1), and how far the linkage is from flat or open."""
    end = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    apart = end - np.array([p["base"], 0.0])
    distance = np.linalg.norm(apart, axis=-1)
    cosine = (p["crank"] ** 2 + distance**2 - p["coupler"] ** 2) / (2.0 * p["crank"] * distance)
    angle = np.arctan2(apart[..., 1], apart[..., 0]) + np.arccos(np.clip(cosine, -1.0, 1.0))
    pin = np.array([p["base"], 0.0]) + p["crank"] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    along = (end - pin) / p["coupler"]
    arms = [along[..., 1] * np.cos(a) - along[..., 0] * np.sin(a) for a in (turn, angle)]
    clear = np.where(np.abs(cosine) < 1.0, np.minimum(np.abs(arms[0]), np.abs(arms[1])), 0.0)
    ratio = np.abs(arms[0]) / (p["crank"] * np.maximum(np.abs(arms[1]), 1e-3))
    return ratio, clear


def _draw_lever(request: DrawRequest) -> dict[str, float]:
    if request.form == "screw":
        # give of the free shaft over that of nut and bearings, in the middle of the range
        return author1.draw_lever(request) | {"shaft": request.uniform(0.5, 2.0)}
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*author1.SWING)
    even = np.linspace(-1.0, 1.0, 31)
    best, found = np.inf, dict[str, float]()
    for crank, base, stretch, start, share in request.rng.uniform(
        [0.6, 1.5, 0.8, 0.3, 0.0], [1.2, 3.0, 1.3, 2.8, 1.0], (TRIED, 5)
    ):
        reach = min(half, REACH[0] + share * (REACH[1] - REACH[0]))
        tried = {"crank": crank, "base": base, "coupler": base * stretch, "start": start, "reach": reach}
        ratio, clear = _linkage(start + (reach + MARGIN) * even, tried)
        miss = abs(float(np.log((ratio.max() / ratio.min()) ** 2 / swing)))
        miss += 100.0 * max(0.0, FLAT - float(clear.min()))
        if miss < best:
            best, found = miss, {name: float(value) for name, value in tried.items()}
    return found | {"gear": found["reach"] / half, "way": request.sign(), "middle": middle}


def _lever(truth: Truth, reality: Reality) -> Reality:
    p, variable = dict(truth.parameters), str(truth.component)

    def linkage(situation: Situation) -> Array:
        turn = p["way"] * p["gear"] * (situation.values[variable] - p["middle"])
        turn = np.clip(turn, -p["reach"] - MARGIN, p["reach"] + MARGIN)
        ratio, _ = _linkage(p["start"] + turn, p)
        return np.asarray((ratio / _linkage(np.array(p["start"]), p)[0]) ** 2)

    def triangle(angle: Array) -> tuple[Array, Array]:
        arm, length = lever(p["crank"], p["frame"], angle)
        return arm, length - DEAD * (p["frame"] - p["crank"])

    def screw(situation: Situation) -> Array:
        clear = 0.5 * author1.CLEAR
        angle = p["start"] + p["way"] * p["gear"] * (situation.values[variable] - p["middle"])
        (arm, shaft), (arm0, shaft0) = (
            triangle(np.clip(angle, clear, np.pi - clear)),
            triangle(np.array(p["start"])),
        )
        return np.asarray((arm / arm0) ** 2 * (1.0 + p["shaft"]) / (1.0 + p["shaft"] * shaft / shaft0))

    share = linkage if truth.form == "four-bar" else screw
    return at_joints(truth, reality, lambda k: Stiffness(lambda situation: k * share(situation)))


def _draw_balancer(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_balancer(request)
    if request.form == "nested":
        return found | {
            "engages": request.uniform(-0.1, 0.1),  # m of stretch from mid-range
            "second": request.uniform(0.5, 1.5),  # of the first coil's rate
        }
    return found | {
        "side": request.sign(),
        "eccentric": request.uniform(0.2, 0.6),
        "phase": request.uniform(0.0, 2.0 * np.pi),
    }


def _balancer(truth: Truth, reality: Reality) -> Reality:
    p, variable, machine = truth.parameters, str(truth.component), reality.machine
    strong = p["share"] * stiffness_of(machine.robot, variable) / p["crank"] ** 2  # N/m

    def turned(situation: Situation) -> Array:
        return np.asarray(p["way"] * (situation.values[variable] - p["middle"]))

    def longer(situation: Situation) -> Array:
        ways = (turned(situation), 0.0)
        now, middle = (lever(p["crank"], p["frame"], p["angle"] + by)[1] for by in ways)
        return np.asarray(now - middle)

    if truth.form == "nested":

        def pull(situation: Situation) -> Array:
            z = longer(situation) - p["engages"]
            second = 0.5 * p["second"] * (z + np.hypot(z, BLUNT))
            return np.asarray(p["pull"] + p["growth"] * (longer(situation) + second))

        def rate(situation: Situation) -> Array:
            z = longer(situation) - p["engages"]
            return np.asarray(strong * (1.0 + 0.5 * p["second"] * (1.0 + z / np.hypot(z, BLUNT))))

        law = Stiffness(rate, pull)
        return reality.with_machine(with_balancer(machine, variable, p, strong, law))

    # a strap over a disc that turns with the joint about a point beside its middle
    def arm(situation: Situation) -> Array:
        return np.asarray(p["crank"] * (1.0 + p["eccentric"] * np.cos(turned(situation) - p["phase"])))

    def strap(situation: Situation) -> Array:
        angle = turned(situation)
        wound = angle + p["eccentric"] * (np.sin(angle - p["phase"]) + np.sin(p["phase"]))
        return np.asarray(np.maximum(p["pull"] + p["growth"] * p["side"] * p["crank"] * wound, 0.0))

    def torque(situation: Situation) -> Array:
        return p["side"] * strap(situation) * arm(situation)

    def stiffness(situation: Situation, drive: float) -> Array:
        slope = -p["crank"] * p["eccentric"] * np.sin(turned(situation) - p["phase"])
        own = strong * arm(situation) ** 2 + p["side"] * strap(situation) * slope
        return drive + own

    return at_joints(truth, reality, lambda k: Stiffness(lambda situation: stiffness(situation, k), torque))


EFFECTS = (
    Effect("actuator-lever", ("four-bar", "screw"), author1.rod_drives, _draw_lever, _lever),
    Effect("gravity-compensator", ("nested", "disc"), author1.balanced_axes, _draw_balancer, _balancer),
)
