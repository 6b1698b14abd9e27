"""Third forms of levers and balancers: a slider-crank, a cylinder with its oil, a cam, a chain."""

from collections.abc import Callable

import numpy as np

from beamstiff.exam.added_parts import lever, with_balancer
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, stiffness_of, stroke
from beamstiff.exam.forms.author1 import levers as author1
from beamstiff.exam.laws import Situation, Stiffness
from beamstiff.exam.reality import Reality

CLEAR = author1.CLEAR
GEARS = 200  # tried
BLUNT = 0.02  # m over which a chain draws taut
SQUEEZED = 0.05  # least part of an oil column that is left


def crank(angle: Array, p: dict[str, float]) -> Array:
    """Return how far a slide moves as its crank turns, over the crank's length."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.asarray(sine + p["rod"] * sine * cosine / np.sqrt(1.0 - (p["rod"] * sine) ** 2))


def oil(length: Array, p: dict[str, float]) -> Array:
    """Return the stiffness of the oil on both sides of a piston, up to a factor."""
    (low, high) = (lever(p["crank"], p["frame"], end)[1] for end in (CLEAR, np.pi - CLEAR))
    out = np.maximum((length - low) / (high - low), 0.0)
    side = np.maximum(1.0 - out, 0.0)
    return np.asarray(
        1.0 / np.maximum(out + p["dead"], SQUEEZED) + p["ring"] / np.maximum(side + p["dead"], SQUEEZED)
    )


def _share(form: str, p: dict[str, float]) -> Callable[[Array], Array]:
    """Return the stiffness about the axis at angles of the crank, up to a factor."""

    def slider(angle: Array) -> Array:
        return crank(angle, p) ** 2

    def piston(angle: Array) -> Array:
        arm, length = lever(p["crank"], p["frame"], angle)
        return np.asarray(arm**2 * oil(length, p))

    return slider if form == "slider-crank" else piston


def _draw_lever(request: DrawRequest) -> dict[str, float]:
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*author1.SWING)
    found = {"way": request.sign(), "middle": middle}
    if request.form == "slider-crank":
        found |= {"rod": request.uniform(0.2, 0.45)}  # crank over connecting rod
    else:
        found |= {
            "crank": request.uniform(0.2, 0.35),
            "frame": request.uniform(0.8, 1.3),
            "ring": request.uniform(0.5, 0.8),  # the rod's side of the piston over the other
            "dead": request.uniform(0.4, 1.0),  # oil in lines and ends, over the swept one
        }
    share = _share(request.form, found)
    aside, best = float(request.rng.uniform()), (np.inf, 0.0, 0.0)
    for gear in np.linspace(0.0, min(1.0, (0.5 * np.pi - CLEAR) / half), GEARS)[1:]:
        low, high = CLEAR + gear * half, np.pi - CLEAR - gear * half
        start = low + aside * (high - low)
        k = share(start + gear * half * np.linspace(-1.0, 1.0, 31))
        miss = abs(float(np.log(k.max() / k.min() / swing)))
        best = min(best, (miss, float(start), float(gear)))
    return found | {"start": best[1], "gear": best[2]}


def _lever(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the joint driven through a lever; the drive's stiffness is that at mid-range.

    ``slider-crank``: a screw moves a slide on rails, and a rod from it turns the crank on the joint, so
    that the lever is that of piston engines. Any textbook of mechanisms.

    ``cylinder``: a hydraulic cylinder across the joint, whose oil columns grow softer towards mid-stroke:
    ``A1^2/V1 + A2^2/V2`` (Merritt, Hydraulic control systems, 1967). Heavy manipulators; sizes are an
    estimate.
    """
    p, variable = dict(truth.parameters), str(truth.component)
    share = _share(truth.form, p)

    def stiffness(situation: Situation, k: float) -> Array:
        angle = p["start"] + p["way"] * p["gear"] * (situation.values[variable] - p["middle"])
        angle = np.clip(angle, 0.5 * CLEAR, np.pi - 0.5 * CLEAR)
        return np.asarray(k * share(angle) / share(np.array(p["start"])))

    return at_joints(truth, reality, lambda k: Stiffness(lambda situation: stiffness(situation, k)))


def _draw_balancer(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_balancer(request)
    if request.form == "cam":
        return found | {
            "top": request.uniform(-0.6, 0.6),  # rad from mid-range, where it neither lifts nor sinks
            "pointed": request.uniform(-0.4, 0.4),  # second harmonic of the cam's lift
        }
    return found | {"slack": request.uniform(-0.3, -0.1)}  # m of stretch from mid-range


def lift(angle: Array, p: dict[str, float]) -> tuple[Array, Array, Array]:
    """Return how far a cam has pressed its spring, m, and the first two slopes by the angle."""
    high, more = p["crank"], p["pointed"]
    pressed = high * (1.0 - np.cos(angle) + 0.25 * more * (1.0 - np.cos(2.0 * angle)))
    slope = high * (np.sin(angle) + 0.5 * more * np.sin(2.0 * angle))
    return pressed, slope, high * (np.cos(angle) + more * np.cos(2.0 * angle))


def _balancer(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the balancer.

    ``cam``: a cam on the joint presses a roller against a spring; upright it rests in its hollow and has no
    lever. Known from balancers that follow a sine (any textbook of mechanisms); sizes as for the others.

    ``chain``: a coil pulls by a chain that hangs slack over part of the range, so that it helps on one side
    only. Known from balancers with a chain or rope; sizes as for the others.
    """
    p, variable, machine = dict(truth.parameters), str(truth.component), reality.machine
    strong = p["share"] * stiffness_of(machine.robot, variable) / p["crank"] ** 2  # N/m

    def turned(situation: Situation) -> Array:
        return np.asarray(p["way"] * (situation.values[variable] - p["middle"]))

    if truth.form == "cam":

        def torque(situation: Situation) -> Array:
            pressed, slope, _ = lift(turned(situation) - p["top"], p)
            return np.asarray((p["pull"] + p["growth"] * pressed) * slope)

        def stiffness(situation: Situation, k: float) -> Array:
            pressed, slope, curved = lift(turned(situation) - p["top"], p)
            return np.asarray(k + strong * slope**2 + (p["pull"] + p["growth"] * pressed) * curved)

        return at_joints(
            truth, reality, lambda k: Stiffness(lambda situation: stiffness(situation, k), torque)
        )

    def beyond(situation: Situation) -> Array:
        ways = (0.0, turned(situation))
        start, now = (lever(p["crank"], p["frame"], p["angle"] + by)[1] for by in ways)
        return np.asarray(now - start - p["slack"])

    def pull(situation: Situation) -> Array:
        z = beyond(situation)
        return np.asarray(p["growth"] * (z + np.hypot(z, BLUNT)))

    def rate(situation: Situation) -> Array:
        z = beyond(situation)
        return np.asarray(strong * 0.5 * (1.0 + z / np.hypot(z, BLUNT)))

    law = Stiffness(rate, pull)
    return reality.with_machine(with_balancer(machine, variable, p, strong, law))


EFFECTS: tuple[Effect, ...] = (
    Effect("actuator-lever", ("slider-crank", "cylinder"), author1.rod_drives, _draw_lever, _lever),
    Effect("gravity-compensator", ("cam", "chain"), author1.balanced_axes, _draw_balancer, _balancer),
)
