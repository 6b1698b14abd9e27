"""Drives: play, hardening, compliance, friction, and torque on one axis that turns another."""

import math
from itertools import pairwise

import numpy as np

from beamstiff.exam.added_parts import pair_of
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import turning_drives, turns
from beamstiff.exam.draws import at_joint, by_ratio, each, evenly, signed, sized
from beamstiff.exam.effect import Reality, built, curve, form, law, wind_up
from beamstiff.exam.laws import Curved, Law, Memory, Situation, curved, ramp, rubbing, winding
from beamstiff.exam.machine import Cross, Machine, components_of, joints_of, own_stiffness
from beamstiff.exam.parameters import DrawRequest, Parameters
from beamstiff.robot.description import Robot

HALF = (3e-5, 5e-4)  # rad: half the lost motion; m / 10 for slides
TURNING = (3e7, 3e5)  # N m/rad
SLIDING = (1e9, 3e7)  # N/m
SOFTER = (0.85, 0.25)  # stiffness at no torque over that at much
BEND = (4e-5, 4e-4)  # rad: strain about which the stiffness changes
LOST = (3e-5, 5e-4)  # rad: friction torque over stiffness; m / 10 for slides
SLIDERS = 10
SHARE = (0.02, 0.8)  # of the geometric mean of the two compliances


# half the play, rad, and what stiffness is left in it
BACKLASH = each(half=at_joint(sized(*HALF)), left=evenly(0.01, 0.04))
# the friction torque over the stiffness, rad, and how much of the stiffness at first slides
FRICTION = each(friction=at_joint(sized(*LOST)), sliding=evenly(0.35, 0.7))


def _play(p: Parameters, k: float, stages: list[tuple[float, float]]) -> Law:
    h, crossing = p["half"], 2.0 * p["left"] * k * p["half"]  # torque that crosses the play

    def wind_up(torque: Array) -> Curved:
        strain, slope = torque / k, np.full_like(torque, 1.0 / k)
        for share, harder in stages:
            x = torque / (harder * crossing)
            root = np.sqrt(1.0 + x**2)
            strain = strain + share * h * x / root
            slope = slope + share * h / (harder * crossing * root**3)
        return strain, slope

    return winding(wind_up, k)


def flanks(e: Array, k: float, half: Array | float, left: float, rounded: Array | float) -> Curved:
    """Return the force, and its slope, of two flanks at +-half about the middle of a play."""
    s, ds = left * k * e, np.full_like(e, left * k)
    for side in (1.0, -1.0):
        carried, slope = ramp(side * e - half, rounded)
        s = s + side * (1.0 - left) * k * carried
        ds = ds + (1.0 - left) * k * slope
    return s, ds


def _sharp(p: Parameters, k: float, variable: str) -> Law:
    h = p["half"]
    rest = p["rest"] * h  # of the drive where unloaded, from the middle of the play
    before = flanks(np.array([rest]), k, h, p["left"], 0.02 * h)[0]

    def curve(e: Array) -> Curved:
        s, ds = flanks(e + rest, k, h, p["left"], 0.02 * h)
        return s - before, ds

    return curved(curve)


def rigid_joints(robot: Robot) -> list[str]:
    """Return the joints that are rigid in their own direction."""
    every = ((name, joints_of(robot, name)) for name in components_of(robot))
    return [name for name, joints in every if all(own_stiffness(robot, *j) == math.inf for j in joints)]


def draw_compliance(request: DrawRequest) -> dict[str, float]:
    """Return the stiffness, SI."""
    return {"stiffness": request.sized(*(TURNING if turns(request.robot, request.component) else SLIDING))}


def _compliance(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the joint elastic; with ``helped`` a second spring helps from a strain on."""
    p, machine = truth.parameters, reality.machine

    def helped(e: Array) -> Curved:
        k, far = p["stiffness"], np.abs(e) / p["from"]
        share = far**2 / (1.0 + far**2)
        slope = k * (1.0 + p["more"] * share * (1.0 + 2.0 / (1.0 + far**2)))
        return k * e * (1.0 + p["more"] * share), slope

    for name, own in joints_of(machine.robot, str(truth.component)):
        machine = machine.with_stiffness(name, own, p["stiffness"])
        if truth.form == "helped":
            machine = machine.with_law(name, own, curved(helped))
    return reality.with_machine(machine)


def draw_hardening(request: DrawRequest) -> dict[str, float]:
    """Return the stiffness at no and at much torque, over the nominal one, and the strain between, rad."""
    softer = request.sized(*SOFTER)
    return {"soft": softer**0.6, "hard": softer**-0.4} | request.drawn(bend=at_joint(by_ratio(*BEND)))


def _exponential(p: Parameters, k: float, torque: Array) -> Curved:
    soft, hard, T = k * p["soft"], k * p["hard"], k * p["bend"]
    fade = np.exp(-np.abs(torque) / T)
    more = 1.0 / soft - 1.0 / hard
    return torque / hard + np.sign(torque) * more * T * (1.0 - fade), 1.0 / hard + more * fade


def _piecewise(p: Parameters, k: float, torque: Array) -> Curved:
    """Return three pieces; `middle`: of the way from soft to hard; `first`: one corner's torque over T."""
    soft, hard, T = k * p["soft"], k * p["hard"], k * p["bend"]
    middle, one = 1.0 / (soft + p["middle"] * (hard - soft)), p["first"] * T
    size = np.abs(torque)
    strain = np.minimum(size, one) / soft + np.clip(size - one, 0.0, T - one) * middle
    strain = strain + np.maximum(size - T, 0.0) / hard
    slope = np.where(size < one, 1.0 / soft, np.where(size < T, middle, 1.0 / hard))
    return np.sign(torque) * strain, slope


def _sinh(p: Parameters, k: float, e: Array) -> Curved:
    soft, hard, T = k * p["soft"], k * p["hard"], k * p["bend"]
    scale = T / soft / np.sqrt(2.0 * np.log(hard / soft))  # tangent at T: soft sqrt(1 + 2 ln(hard / soft))
    x = np.clip(e / scale, -6.0, 6.0)
    return soft * (scale * np.sinh(x) + (e - scale * x) * np.cosh(x)), soft * np.cosh(x)


def _iwan(p: Parameters, stiffness: float, variable: str) -> Law:
    """Return sliders beside a spring, each behind one of its own, that slip at evenly spaced strains."""
    friction = stiffness * p["friction"]
    k = stiffness * p["sliding"] / (1.0 - p["sliding"]) / SLIDERS
    even = (np.arange(SLIDERS) + 0.5) / SLIDERS
    most = 2.0 * even * friction / (SLIDERS * k)  # together they hold the friction torque

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        before, held = memory
        tried = held + (strain - before)[:, None]
        now = np.clip(tried, -most, most)
        sticking = np.abs(tried) <= most
        force = stiffness * strain + k * now.sum(axis=1)
        return force, stiffness + k * sticking.sum(axis=1), (strain, now)

    return Law(respond, lambda poses: (np.zeros(poses), np.zeros((poses, SLIDERS))))


def _bouc_wen(p: Parameters, k: float, variable: str) -> Law:
    """Return Bouc and Wen's friction with exponent 1, integrated in closed form along each step.

    ``dz = (1 - (1 + sign(de z))/2 |z|) de / e_slip``; `arrived`: left over from the move to the pose.
    """
    friction = k * p["friction"]
    slip = friction * (1.0 - p["sliding"]) / (k * p["sliding"])

    def run(state: Array, way: Array) -> Curved:
        go, back = way / slip, np.minimum(state, 0.0)
        left = np.maximum(go + back, 0.0)  # of the way, after what was held has been given back
        loading = 1.0 - (1.0 - np.maximum(state, 0.0)) * np.exp(-left)
        unloading = go < -back
        return np.where(unloading, state + go, loading), np.where(unloading, 1.0, 1.0 - loading) / slip

    return rubbing(k, friction, p["arrived"], run)


def coupled_drives(robot: Robot) -> list[str]:
    """Return neighbouring drives, and the outer two of the last three (a wrist)."""
    order = [v.name for v in robot.variables]
    names = sorted(turning_drives(robot), key=order.index)
    pairs = list(pairwise(names))
    if len(names) >= 6:
        pairs.append((names[-3], names[-1]))
    return [f"{a}+{b}" for a, b in pairs]


def _by_compliance(p: Parameters, machine: Machine, pair: str) -> Machine:
    one, two, first, second = pair_of(machine, pair)
    cross = p["share"] / np.sqrt(first * second)
    soft = np.array([[1 / first, cross], [cross, 1 / second]])
    return machine.plus(crosses=(Cross(one, two, np.linalg.inv(soft) - np.diag([first, second])),))


def _by_gear(p: Parameters, machine: Machine, pair: str) -> Machine:
    """Return the machine with a third spring between the two gears, that couples by the wanted share."""
    one, two, first, second = pair_of(machine, pair)
    n = np.array([1.0, -np.sign(p["share"]) * p["ratio"] * np.sqrt(first / second)])
    a, b, share = n[0] ** 2 / first, n[1] ** 2 / second, min(abs(p["share"]), 0.9)
    # coupling of k + s n n^T: s|n1 n2|/sqrt(k1 k2 ...) grows with s; solved by bisection
    low, high = 0.0, 1e3 * (first + second)
    for _ in range(80):
        s = 0.5 * (low + high)
        coupled = s * np.sqrt(a * b) / np.sqrt((1 + s * a) * (1 + s * b))
        low, high = (s, high) if coupled < share else (low, s)
    return machine.plus(crosses=(Cross(one, two, s * np.outer(n, n)),))


_SHARE = signed(sized(*SHARE))
FORMS = (
    law("backlash", "sharp", _sharp, BACKLASH, rest=evenly(-0.8, 0.8)),
    law("backlash", "smooth", lambda p, k, _: _play(p, k, [(1.0, 1.0)]), BACKLASH),
    law("backlash", "stages", lambda p, k, _: _play(p, k, [(p["share"], 0.5), (1.0 - p["share"], 2.5)]),
        BACKLASH, share=evenly(0.4, 0.8)),
    form("joint-compliance", "plain", _compliance, draw_compliance),
    form("joint-compliance", "helped", _compliance,
         draw_compliance, **{"from": by_ratio(1e-4, 1e-3), "more": evenly(0.2, 0.8)}),
    wind_up("hardening", "exponential", _exponential, draw_hardening),
    wind_up("hardening", "piecewise", _piecewise,
            draw_hardening, middle=evenly(0.3, 0.7), first=evenly(0.25, 0.4)),
    curve("hardening", "sinh", _sinh, draw_hardening),
    law("hysteresis", "iwan", _iwan, FRICTION),
    law("hysteresis", "bouc-wen", _bouc_wen, FRICTION, arrived=evenly(-0.9, 0.9)),
    built("joint-coupling", "compliance", _by_compliance, share=_SHARE),
    built("joint-coupling", "gear", _by_gear, share=_SHARE, ratio=evenly(0.5, 2.0)),
)  # fmt: skip
