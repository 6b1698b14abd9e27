"""Third forms of levers and balancers: a slider-crank, a cylinder with its oil, a cam, a chain."""

from collections.abc import Callable
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import crank_stiffness, lever, turned, with_balancer
from beamstiff.exam.campaign import Array
from beamstiff.exam.draws import evenly
from beamstiff.exam.effect import Drive, built, in_pose
from beamstiff.exam.forms.author1 import levers as author1
from beamstiff.exam.laws import Curved, Situation
from beamstiff.exam.machine import stroke
from beamstiff.exam.parameters import DrawRequest, Parameters

CLEAR = author1.CLEAR
GEARS = 200  # tried
BLUNT = 0.02  # m over which a chain draws taut
SQUEEZED = 0.05  # least part of an oil column that is left


def crank(angle: Array, p: Parameters) -> Array:
    """Return how far a slide moves as its crank turns, over the crank's length."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.asarray(sine + p["rod"] * sine * cosine / np.sqrt(1.0 - (p["rod"] * sine) ** 2))


def oil(length: Array, p: Parameters) -> Array:
    """Return the stiffness of the oil on both sides of a piston, up to a factor."""
    (low, high) = (lever(p["crank"], p["frame"], end)[1] for end in (CLEAR, np.pi - CLEAR))
    out = np.maximum((length - low) / (high - low), 0.0)
    side = np.maximum(1.0 - out, 0.0)
    return np.asarray(
        1.0 / np.maximum(out + p["dead"], SQUEEZED) + p["ring"] / np.maximum(side + p["dead"], SQUEEZED)
    )


def _slider(p: Parameters, angle: Array) -> Array:
    return crank(angle, p) ** 2


def _piston(p: Parameters, angle: Array) -> Array:
    arm, length = lever(p["crank"], p["frame"], angle)
    return np.asarray(arm**2 * oil(length, p))


def _draw_lever(request: DrawRequest) -> dict[str, float]:
    """Return the lever; `rod`: crank over connecting rod.

    `ring`: the rod's side of the piston over the other; `dead`: oil in lines and ends, over the swept one.
    """
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*author1.SWING)
    found = {"way": request.sign(), "middle": middle}
    if request.form == "slider-crank":
        found |= request.drawn(rod=evenly(0.2, 0.45))
    else:
        found |= request.drawn(
            crank=evenly(0.2, 0.35), frame=evenly(0.8, 1.3), ring=evenly(0.5, 0.8), dead=evenly(0.4, 1.0)
        )
    share = partial(_slider if request.form == "slider-crank" else _piston, found)
    aside, best = float(request.rng.uniform()), (np.inf, 0.0, 0.0)
    for gear in np.linspace(0.0, min(1.0, (0.5 * np.pi - CLEAR) / half), GEARS)[1:]:
        low, high = CLEAR + gear * half, np.pi - CLEAR - gear * half
        start = low + aside * (high - low)
        k = share(start + gear * half * np.linspace(-1.0, 1.0, 31))
        miss = abs(float(np.log(k.max() / k.min() / swing)))
        best = min(best, (miss, float(start), float(gear)))
    return found | {"start": best[1], "gear": best[2]}


Share = Callable[[Parameters, Array], Array]  # of stiffness, from the angle


def _lever(share: Share, p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return the drive of a joint through a lever; its stiffness is that at mid-range.

    ``slider-crank``: a screw moves a slide, and a rod from it turns the crank on the joint.
    ``cylinder``: a hydraulic one, whose oil is softest at mid-stroke: ``A1^2/V1 + A2^2/V2`` (Merritt, 1967).
    """
    angle = author1.angle_of(p, drive.component, situation)
    k = drive.k * share(p, angle) / share(p, np.array(p["start"]))
    return k * e, k


def lift(angle: Array, p: Parameters) -> tuple[Array, Array, Array]:
    """Return how far a cam has pressed its spring, m, and the first two slopes by the angle."""
    high, more = p["crank"], p["pointed"]
    pressed = high * (1.0 - np.cos(angle) + 0.25 * more * (1.0 - np.cos(2.0 * angle)))
    slope = high * (np.sin(angle) + 0.5 * more * np.sin(2.0 * angle))
    return pressed, slope, high * (np.cos(angle) + more * np.cos(2.0 * angle))


def _cam(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return the drive with a cam on the joint that presses a roller against a spring.

    `top`: rad from mid-range, where it neither lifts nor sinks; `pointed`: second harmonic of its lift.
    """
    pressed, slope, curved = lift(turned(p, drive.component, situation) - p["top"], p)
    strong, push = crank_stiffness(p, drive.robot, drive.component), p["pull"] + p["growth"] * pressed
    k = drive.k + strong * slope**2 + push * curved
    return k * e + push * slope, k


def _chain(p: Parameters, strong: float, longer: Array) -> Curved:
    """Return a coil that pulls by a chain; `slack`: m of stretch from mid-range."""
    z = longer - p["slack"]
    rate = strong * 0.5 * (1.0 + z / np.hypot(z, BLUNT))
    return rate, p["growth"] * (z + np.hypot(z, BLUNT))


FORMS = (
    in_pose("actuator-lever", "slider-crank", partial(_lever, _slider), _draw_lever),
    in_pose("actuator-lever", "cylinder", partial(_lever, _piston), _draw_lever),
    in_pose("gravity-compensator", "cam", _cam,
            author1.draw_balancer, top=evenly(-0.6, 0.6), pointed=evenly(-0.4, 0.4)),
    built("gravity-compensator", "chain", partial(with_balancer, _chain),
          author1.draw_balancer, slack=evenly(-0.3, -0.1)),
)  # fmt: skip
