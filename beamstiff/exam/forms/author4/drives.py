"""Drives: wind-up, play, friction, coupling of two; screws and slides by their lever arm; balancers."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from beamstiff.exam.added_parts import axis_in_the_middle, beside, pair_of
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import main_stiffness, stiffness_of, turns
from beamstiff.exam.draws import PHASE, SIGN, by_ratio, evenly, product, signed, sized
from beamstiff.exam.effect import Drive, Reality, built, curve, form, in_pose, law, wind_up
from beamstiff.exam.laws import Curved, Law, Situation, curved, fading, posed, ramp, rubbing, varying, winding
from beamstiff.exam.machine import Machine, Mesh, drives_of, joints_of, own_stiffness, stroke
from beamstiff.exam.parameters import Draw, DrawRequest, Parameters

ROUND = 0.08  # of a play's width: its corners
BLUNT = 2e-6  # rad
STEP = 1e-30  # of complex steps
ROOM = 293.15  # K
DEGC = 273.15
COMES_IN = 0.05  # of a balancer's crank: where its second coil comes in
TORQUE = 6e-4  # rad: what the drive would give under the usual balancer
SWING = 0.85  # rad: of a slotted lever to either side


def soft_zone(p: Parameters, k: float, force: Array) -> Curved:
    """Return a strain wave gear's wind-up: teeth that settle add up to `lost` while the torque is small."""
    u = force / (k * p["knee"])
    slope = 1.0 / k + p["lost"] * (2.0 / np.pi) / (k * p["knee"] * (1.0 + u**2))
    return force / k + p["lost"] * (2.0 / np.pi) * np.arctan(u), slope


def engaging(p: Parameters, k: float, force: Array) -> Curved:
    """Return a gear's wind-up of which more teeth carry the larger the torque, sooner in one direction.

    Stiffness ``k (1 + gain (1 - exp(-|T| / T1)))``, T1 = ``k scale (1 + skew sign(T))``.
    """
    T1 = k * p["scale"] * np.where(force >= 0.0, 1.0 + p["skew"], 1.0 - p["skew"])
    u = np.abs(force) / T1
    rest = 1.0 + p["gain"] * -np.expm1(-u)
    wound = T1 / (k * (1.0 + p["gain"])) * (u + np.log1p(p["gain"] * -np.expm1(-u)))
    return np.sign(force) * wound, 1.0 / (k * rest)


def spline(k: float, contact: float, knee: float) -> Law:
    """Return the wind-up of a shaft in a spline; `contact`: its give at no torque over the shaft's."""

    def wind_up(force: Array) -> Curved:
        u = force / (k * knee)
        soft = u * (1.0 + u**2) ** (-1.0 / 6.0)
        slope = (1.0 + u**2) ** (-7.0 / 6.0) * (1.0 + 2.0 / 3.0 * u**2)
        return force / k + contact * knee * soft, (1.0 + contact * slope) / k

    return winding(wind_up, k)


def scissor(p: Parameters, k: float, strain: Array) -> Curved:
    """Return a split gear: beyond its preload in one direction the spring half gives by a gap."""
    width = ROUND * (p["gap"] + p["preload"])

    def part(y: Array) -> Curved:
        first, its = ramp(-y - p["preload"], width)
        last, other = ramp(-y - p["preload"] - p["gap"], width)
        return k * y + (1.0 - p["soft"]) * k * (first - last), k - (1.0 - p["soft"]) * k * (its - other)

    force, slope = part(p["sign"] * strain)
    return p["sign"] * (force - part(np.zeros(1))[0]), slope


def eccentric_mesh(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return play between greased flanks of a wheel that runs out: wider on one side of its turn."""
    w = p["half_width"] * (1.0 + p["runout"] * np.cos(situation.values[drive.component] - p["phase"]))
    above, below = (np.sqrt((e + way * w) ** 2 + (ROUND * w) ** 2) for way in (-1.0, 1.0))
    free = e + 0.5 * (above - below)
    slope = 1.0 + 0.5 * ((e - w) / above - (e + w) / below)
    carried, rest = drive.k * (1.0 - p["grease"]), drive.k * p["grease"]
    return rest * e + carried * free, rest + carried * slope


def _usual(request: DrawRequest) -> float:
    """Return a stiffness, by the geometric mean of the other drives'."""
    robot, place = request.robot, request.component
    names = [name for name in drives_of(robot) if turns(robot, name) == turns(robot, place)]
    like = [stiffness_of(robot, name) for name in names]
    usual = float(np.exp(np.mean(np.log(like)))) if like else main_stiffness(robot)
    return usual / request.sized(0.03, 1.2)


def _rope_drive(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return a rope's drive: its free strand grows as the drum winds off."""
    middle, half = stroke(drive.robot, drive.component)
    # limits of a joint may be passed by a little
    way = np.clip((situation.values[drive.component] - middle) / half, -1.5, 1.5)
    k = p["stiffness"] / (1.0 + p["longer"] * way)
    return k * e, k


def tooth_friction(p: Parameters, k: float, _: str) -> Law:
    """Return friction of seals (`friction`, a strain), and of teeth by a `share` of the torque they carry.

    It turns round by Dahl's law over a `reach`, which grows with the share: teeth bend before they slide.
    """
    friction = k * p["friction"]

    def largest(strain: Array, state: Array) -> tuple[Array, Array]:
        return friction + p["share"] * k * np.abs(strain), p["share"] * k * np.sign(strain) * state

    return rubbing(k, friction, p["arrived"], partial(fading, reach=p["reach"]), largest)


def driven_back(p: Parameters, k: float, _: str) -> Law:
    """Return friction that is larger one way than the other, as of a worm that is driven back.

    What is left of the way to its largest, ``(1 + skew)`` forward and ``(1 - skew)`` back, obeys
    ``du/dx = -u^power / reach``, power over 1: slower than exponentially.
    """
    friction = k * p["friction"]

    def run(state: Array, way: Array) -> Curved:
        n = p["power"] - 1.0
        start = np.maximum(1.0 - state, 1e-12)
        left = (start**-n + n * way / p["reach"]) ** (-1.0 / n)
        return 1.0 - left, left ** p["power"] / p["reach"]

    def largest(strain: Array, state: Array) -> tuple[Array, float]:
        return friction * (1.0 + p["skew"] * np.sign(state)), 0.0

    return rubbing(k, friction, p["arrived"], run, largest)


def _idler(p: Parameters, machine: Machine, pair: str) -> Machine:
    one, two, k1, k2 = pair_of(machine, pair)
    k, side = min(k1, k2) * p["stiffness"], p["side"]

    def curve(strain: Array) -> Curved:
        carried, slope = ramp(side * strain, BLUNT)
        return side * k * (carried - 0.5 * BLUNT), k * slope

    return machine.plus(meshes=(Mesh(one, two, (1.0, p["ratio"]), curved(curve)),))


def _housing(p: Parameters, machine: Machine, pair: str) -> Machine:
    """Return the machine with a housing that both torques twist, the second by the cosine between the axes.

    Compliance c in series: ``(C + c u u^T)^-1 = K - K u u^T K c / (1 + c u^T K u)``.
    """
    one, two, k1, k2 = pair_of(machine, pair)
    c = p["compliance"] / max(k1, k2)

    def leaning(situation: Situation) -> Array:
        return np.asarray(p["share"] * np.cos(situation.values[pair.split("+")[1]] - p["phase"]))

    def taken(situation: Situation) -> Array:
        return np.asarray(-c / (1.0 + c * (k1 + k2 * leaning(situation) ** 2)))

    return machine.plus(meshes=(Mesh(one, two, (k1, lambda s: k2 * leaning(s)), varying(taken)),))


_ARRIVED = evenly(-0.9, 0.9)


def screw(angle: Array, crank: float, shaft: float) -> Array:
    """Return the stiffness of a screw's drive about its joint, up to a factor; the frame's arm is 1 long.

    `shaft`: compliance of its free length, which grows with it, over nut and bearings', at length 1.
    """
    long = np.sqrt(1.0 + crank**2 - 2.0 * crank * np.cos(angle))
    arm = crank * np.sin(angle) / long
    return np.asarray(arm**2 / (1.0 + shaft * long))


def slotted(angle: Array) -> Array:
    """Return the stiffness of a pin that goes straight past a joint, in a lever's slot, up to a factor."""
    return np.asarray(np.cos(angle) ** -4)


def _screwed(p: Parameters, half: float, way: Array) -> Array:
    most = min(p["angle"] - 0.45, 2.7 - p["angle"], half)
    return screw(p["angle"] + p["swing"] * most * way, p["crank"], p["shaft"])


def _slotted(p: Parameters, half: float, way: Array) -> Array:
    most = min(SWING - abs(p["angle"]), half)
    return slotted(p["angle"] + p["swing"] * most * way)


Share = Callable[[Parameters, float, Array], Array]  # of stiffness, from half the range and the way in it


def _lever(share: Share, p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return the drive through a lever."""
    middle, half = stroke(drive.robot, drive.component)
    way = np.clip((situation.values[drive.component] - middle) / half, -1.05, 1.05)
    k = drive.k * share(p, half, way) / float(share(p, half, np.zeros(1))[0])
    return k * e, k


def _heavy_side(machine: Machine, joint: str) -> float:
    """Return the sense in which what hangs on a joint would turn it, in the middle of its range."""
    axis, point = axis_in_the_middle(machine, joint)
    (tool,) = machine.places(machine.tcp)
    return 1.0 if axis @ np.cross(tool - point, [0.0, 0.0, -1.0]) >= 0.0 else -1.0


def _balance(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a balancer's torque against its joint: `torque` in the middle, at 20 degC."""
    p, variable, machine = truth.parameters, str(truth.component), reality.machine
    robot, heats = machine.robot, truth.form == "gas-and-heat"
    middle = stroke(robot, variable)[0]

    def pull(stretch: Any, warmth: Array) -> Any:
        if heats:
            return warmth * (1.0 - p["filled"] * stretch) ** -p["power"]
        second = np.log1p(np.exp((stretch - p["second_from"]) / COMES_IN)) * COMES_IN
        return 1.0 + p["rate"] * stretch + p["second_rate"] * second

    def long(at: Any) -> Any:
        return np.sqrt(1.0 + p["crank"] ** 2 - 2.0 * p["crank"] * np.cos(at))

    usual = np.sin(p["angle"]) / long(p["angle"])

    def curve(torque: float, strain: Array, situation: Situation) -> Curved:
        warmth = (situation.temperature + DEGC) / ROOM
        angle = p["angle"] + (situation.values[variable] + strain + 1j * STEP) - middle
        stretch = (long(angle) - long(p["angle"])) / p["crank"]
        found = torque * pull(stretch, warmth) * np.sin(angle) / long(angle) / usual
        return found.real, found.imag / STEP

    for name, own in joints_of(robot, variable):
        torque = _heavy_side(machine, name) * p["torque"] * TORQUE * own_stiffness(robot, name, own)
        machine = beside(machine, name, own, posed(partial(curve, torque), heats))
    return reality.with_machine(machine)


_TEETH, _WORM = sized(0.01, 0.25), sized(8e-6, 2.5e-4)
_CRANK: dict[str, Draw] = {
    "torque": sized(0.1, 2.5), "crank": evenly(0.2, 0.45), "angle": signed(evenly(0.9, 2.2))
}  # fmt: skip


FORMS = (
    wind_up("hardening", "soft-zone", soft_zone, lost=sized(1e-5, 4e-4), knee=by_ratio(2e-5, 1.5e-4)),
    wind_up("hardening", "engaging-teeth", engaging,
            gain=sized(0.05, 1.5), scale=by_ratio(6e-5, 4e-4), skew=signed(evenly(0.0, 0.5))),
    in_pose("joint-compliance", "rope-drive", _rope_drive,
            stiffness=_usual, longer=signed(evenly(0.15, 0.5))),
    law("joint-compliance", "spline", lambda p, _, __: spline(p["stiffness"], p["contact"], p["knee"]),
        stiffness=_usual, contact=evenly(0.5, 2.0), knee=by_ratio(3e-5, 3e-4)),
    in_pose("backlash", "eccentric-mesh", eccentric_mesh,
            half_width=sized(5e-6, 4e-4), runout=evenly(0.2, 0.6), phase=PHASE, grease=evenly(0.01, 0.06)),
    curve("backlash", "scissor-gear", scissor,
          sign=SIGN, preload=by_ratio(1e-5, 1.2e-4), gap=sized(1e-5, 6e-4), soft=evenly(0.02, 0.12)),
    law("hysteresis", "tooth-friction", tooth_friction,
        share=_TEETH, friction=product(_TEETH, by_ratio(3e-5, 4e-4)),
        reach=product(_TEETH, by_ratio(2e-4, 1e-3)), arrived=_ARRIVED),
    law("hysteresis", "driven-back", driven_back,
        friction=_WORM, reach=product(_WORM, by_ratio(0.35, 2.0)),
        power=evenly(1.2, 1.8), skew=signed(evenly(0.15, 0.5)), arrived=_ARRIVED),
    built("joint-coupling", "common-housing", _housing,
          compliance=sized(0.02, 0.8), share=signed(evenly(0.5, 1.2)), phase=PHASE),
    built("joint-coupling", "one-way-idler", _idler,
          stiffness=sized(0.03, 1.2), ratio=signed(evenly(0.4, 1.3)), side=SIGN),
    in_pose("actuator-lever", "long-screw", partial(_lever, _screwed),
            crank=evenly(0.25, 0.6), shaft=evenly(0.5, 3.0), angle=evenly(1.2, 1.9), swing=sized(0.1, 1.0)),
    in_pose("actuator-lever", "slotted-lever", partial(_lever, _slotted),
            angle=evenly(-0.35, 0.35), swing=sized(0.12, 1.0)),
    form("gravity-compensator", "gas-and-heat", _balance, **_CRANK,
         filled=evenly(0.1, 0.35), power=evenly(1.0, 1.35)),
    form("gravity-compensator", "nested-coils", _balance, **_CRANK,
         rate=evenly(0.15, 0.45), second_rate=evenly(0.5, 1.5), second_from=evenly(-0.3, 0.3)),
)  # fmt: skip
