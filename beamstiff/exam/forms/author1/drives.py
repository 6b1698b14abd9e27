"""Drives: play, hardening, compliance, friction, and torque on one axis that turns another."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, stiffness_of, turning_drives, turns
from beamstiff.exam.laws import Curve, Friction, Law, Memory, Remembering, Situation, WindUp
from beamstiff.exam.machine import Cross, joints_of, own_stiffness
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

HALF = (3e-5, 5e-4)  # rad: half the lost motion; m / 10 for slides
TURNING = (3e7, 3e5)  # N m/rad
SLIDING = (1e9, 3e7)  # N/m
SOFTER = (0.85, 0.25)  # stiffness at no torque over that at much
BEND = (4e-5, 4e-4)  # rad: strain about which the stiffness changes
LOST = (3e-5, 5e-4)  # rad: friction torque over stiffness; m / 10 for slides
SLIDERS = 10
SHARE = (0.02, 0.8)  # of the geometric mean of the two compliances


def draw_backlash(request: DrawRequest) -> dict[str, float]:
    """Return half the play, rad; where in it the drive rests; what stiffness is left in it."""
    found = {
        "half": request.sized(*HALF) * (1.0 if turns(request.robot, request.component) else 0.1),
        "left": request.uniform(0.01, 0.04),
    }
    if request.form == "sharp":
        found["rest"] = request.uniform(-0.8, 0.8)
    if request.form == "stages":
        found["share"] = request.uniform(0.4, 0.8)
    return found


def _backlash(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with play in the drive."""
    return at_joints(truth, reality, lambda k: _backlash_law(truth, k))


def _backlash_law(truth: Truth, k: float) -> Law:
    p = truth.parameters
    h, left = p["half"], p["left"]
    if truth.form == "sharp":
        return Curve(lambda e: _between_flanks(e, k, h, left, p["rest"] * h))
    crossing = 2.0 * left * k * h  # torque that crosses the play
    stages = [(1.0, 1.0)] if truth.form == "smooth" else [(p["share"], 0.5), (1.0 - p["share"], 2.5)]

    def wind_up(torque: Array) -> tuple[Array, Array]:
        strain, slope = torque / k, np.full_like(torque, 1.0 / k)
        for share, harder in stages:
            x = torque / (harder * crossing)
            root = np.sqrt(1.0 + x**2)
            strain = strain + share * h * x / root
            slope = slope + share * h / (harder * crossing * root**3)
        return strain, slope

    return WindUp(wind_up, k)


def _between_flanks(e: Array, k: float, h: float, left: float, rest: float) -> tuple[Array, Array]:
    """Two flanks at +-h about the middle of the play, from which the drive rests by `rest` where unloaded."""

    def force(x: Array) -> tuple[Array, Array]:
        s, ds = left * k * x, np.full_like(x, left * k)
        for side in (1.0, -1.0):
            z = side * x - h
            root = np.sqrt(z**2 + (0.02 * h) ** 2)
            s = s + side * (1.0 - left) * k * 0.5 * (z + root)
            ds = ds + (1.0 - left) * k * 0.5 * (1.0 + z / root)
        return s, ds

    s, ds = force(e + rest)
    return s - force(np.array([rest]))[0], ds


def rigid_joints(robot: Robot) -> list[str | None]:
    """Return the joints that are rigid in their own direction."""
    names = dict.fromkeys(joint.variable or joint.name for joint in robot.joints)
    return [n for n in names if all(own_stiffness(robot, *j) == math.inf for j in joints_of(robot, n))]


def draw_compliance(request: DrawRequest) -> dict[str, float]:
    """Return the stiffness, SI, and from which strain on a second spring helps."""
    found = {"stiffness": request.sized(*(TURNING if turns(request.robot, request.component) else SLIDING))}
    if request.form == "helped":
        found |= {"from": request.log_uniform(1e-4, 1e-3), "more": request.uniform(0.2, 0.8)}
    return found


def _compliance(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the joint elastic."""
    p, machine = truth.parameters, reality.machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        hinge = machine.hinge(name)
        k = hinge.stiffness.copy()
        k[own] = p["stiffness"]
        machine = machine.with_hinge(dataclasses.replace(hinge, stiffness=k))
        if truth.form == "helped":
            machine = machine.with_law(name, own, Curve(lambda e: _helped(e, p)))
    return reality.with_machine(machine)


def _helped(e: Array, p: Mapping[str, float]) -> tuple[Array, Array]:
    k, far = p["stiffness"], np.abs(e) / p["from"]
    share = far**2 / (1.0 + far**2)
    return k * e * (1.0 + p["more"] * share), k * (1.0 + p["more"] * share * (1.0 + 2.0 / (1.0 + far**2)))


def draw_hardening(request: DrawRequest) -> dict[str, float]:
    """Return the stiffness at no and at much torque, over the nominal one, and the strain between, rad."""
    softer = request.sized(*SOFTER)
    bend = request.log_uniform(*BEND) * (1.0 if turns(request.robot, request.component) else 0.1)
    found = {"soft": softer**0.6, "hard": softer**-0.4, "bend": bend}
    if request.form == "piecewise":
        found["middle"] = request.uniform(0.3, 0.7)  # of the way from soft to hard
        found["first"] = request.uniform(0.25, 0.4)  # first corner's torque over the second's
    return found


def _hardening(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a hardening drive."""
    return at_joints(truth, reality, lambda k: _hardening_law(truth, k))


def _hardening_law(truth: Truth, k: float) -> Law:
    p = truth.parameters
    soft, hard, T = k * p["soft"], k * p["hard"], k * p["bend"]

    def exponential(torque: Array) -> tuple[Array, Array]:
        fade = np.exp(-np.abs(torque) / T)
        more = 1.0 / soft - 1.0 / hard
        return torque / hard + np.sign(torque) * more * T * (1.0 - fade), 1.0 / hard + more * fade

    def piecewise(torque: Array) -> tuple[Array, Array]:
        middle = 1.0 / (soft + p["middle"] * (hard - soft))
        one, two = p["first"] * T, T
        size = np.abs(torque)
        strain = (
            np.minimum(size, one) / soft
            + np.clip(size - one, 0.0, two - one) * middle
            + np.maximum(size - two, 0.0) / hard
        )
        slope = np.where(size < one, 1.0 / soft, np.where(size < two, middle, 1.0 / hard))
        return np.sign(torque) * strain, slope

    if truth.form == "exponential":
        return WindUp(exponential, hard)
    if truth.form == "piecewise":
        return WindUp(piecewise, hard)
    scale = T / soft / np.sqrt(2.0 * np.log(hard / soft))  # tangent at T: soft sqrt(1 + 2 ln(hard / soft))

    def sinh(e: Array) -> tuple[Array, Array]:
        x = np.clip(e / scale, -6.0, 6.0)
        return soft * (scale * np.sinh(x) + (e - scale * x) * np.cosh(x)), soft * np.cosh(x)

    return Curve(sinh)


def draw_friction(request: DrawRequest) -> dict[str, float]:
    """Return the friction torque over the stiffness, rad, and how much of the stiffness at first slides."""
    found = {
        "friction": request.sized(*LOST) * (1.0 if turns(request.robot, request.component) else 0.1),
        "sliding": request.uniform(0.35, 0.7),
    }
    if request.form == "bouc-wen":
        found["arrived"] = request.uniform(-0.9, 0.9)  # friction left over from the move to the pose
    return found


def _friction(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with friction in the drive."""
    p = truth.parameters

    def law(k: float) -> Law:
        if truth.form == "iwan":
            return Iwan(k, k * p["friction"], p["sliding"])
        return BoucWen(k, k * p["friction"], p["arrived"], p["sliding"])

    return at_joints(truth, reality, law)


@dataclass(frozen=True)
class Iwan(Remembering):
    """Sliders beside a spring, each with a spring of its own, that slip at evenly spaced strains."""

    stiffness: float
    friction: float
    sliding: float

    def start(self, situation: Situation) -> Memory:
        """Return strain and sliders at rest."""
        poses = len(situation.time)
        return np.zeros(poses), np.zeros((poses, SLIDERS))

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent and the sliders after."""
        before, held = memory
        k = self.stiffness * self.sliding / (1.0 - self.sliding) / SLIDERS
        even = (np.arange(SLIDERS) + 0.5) / SLIDERS
        most = 2.0 * even * self.friction / (SLIDERS * k)  # together they hold the friction torque
        tried = held + (strain - before)[:, None]
        now = np.clip(tried, -most, most)
        sticking = np.abs(tried) <= most
        force = self.stiffness * strain + k * now.sum(axis=1)
        return force, self.stiffness + k * sticking.sum(axis=1), (strain, now)


@dataclass(frozen=True)
class BoucWen(Friction):
    """Bouc and Wen's friction with exponent 1, integrated in closed form along each step.

    ``dz = (1 - (1 + sign(de z))/2 |z|) de / e_slip``: linear while unloading, exponential while loading.
    """

    sliding: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state and its slope after a way."""
        slip = self.friction * (1.0 - self.sliding) / (self.stiffness * self.sliding)
        go, back = way / slip, np.minimum(state, 0.0)
        left = np.maximum(go + back, 0.0)  # of the way, after what was held has been given back
        loading = 1.0 - (1.0 - np.maximum(state, 0.0)) * np.exp(-left)
        unloading = go < -back
        return np.where(unloading, state + go, loading), np.where(unloading, 1.0, 1.0 - loading) / slip


def coupled_drives(robot: Robot) -> list[str | None]:
    """Return neighbouring drives, and the outer two of the last three (a wrist)."""
    order = [v.name for v in robot.variables]
    names = sorted((str(n) for n in turning_drives(robot)), key=order.index)
    pairs = list(pairwise(names))
    if len(names) >= 6:
        pairs.append((names[-3], names[-1]))
    return [f"{a}+{b}" for a, b in pairs]


def _draw_coupling(request: DrawRequest) -> dict[str, float]:
    """Return how strongly and which way the two joints are linked."""
    found = {"share": request.sign() * request.sized(*SHARE)}
    if request.form == "gear":
        found["ratio"] = request.uniform(0.5, 2.0)
    return found


def _coupling(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the two joints linked."""
    p, machine = truth.parameters, reality.machine
    first, second = (stiffness_of(machine.robot, name) for name in str(truth.component).split("+"))
    k = np.diag([first, second])
    if truth.form == "compliance":
        cross = p["share"] / np.sqrt(first * second)
        added = np.linalg.inv(np.array([[1 / first, cross], [cross, 1 / second]])) - k
    else:
        # a third spring between the two gears; its stiffness gives the wanted share of coupling
        n = np.array([1.0, -np.sign(p["share"]) * p["ratio"] * np.sqrt(first / second)])
        a, b, share = n[0] ** 2 / first, n[1] ** 2 / second, min(abs(p["share"]), 0.9)
        # coupling of k + s n n^T: s|n1 n2|/sqrt(k1 k2 ...) grows with s; solved by bisection
        low, high = 0.0, 1e3 * (first + second)
        for _ in range(80):
            s = 0.5 * (low + high)
            coupled = s * np.sqrt(a * b) / np.sqrt((1 + s * a) * (1 + s * b))
            low, high = (s, high) if coupled < share else (low, s)
        added = s * np.outer(n, n)
    one, two = (joints_of(machine.robot, name)[0] for name in str(truth.component).split("+"))
    return reality.with_machine(machine.plus(crosses=(Cross(one, two, added),)))


EFFECTS: tuple[Effect, ...] = (
    Effect("backlash", ("sharp", "smooth", "stages"), drives, draw_backlash, _backlash),
    Effect("joint-compliance", ("plain", "helped"), rigid_joints, draw_compliance, _compliance),
    Effect("hardening", ("exponential", "piecewise", "sinh"), drives, draw_hardening, _hardening),
    Effect("hysteresis", ("iwan", "bouc-wen"), drives, draw_friction, _friction),
    Effect("joint-coupling", ("compliance", "gear"), coupled_drives, _draw_coupling, _coupling),
)
