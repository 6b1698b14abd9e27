"""Drives: wind-up, play that is not a plain dead zone, friction by load or by way, and coupling of two."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, at_joints, drives, stiffness_of, stroke, turning_drives, turns
from beamstiff.exam.forms.author4.by_form import Form, effect_of, main_stiffness, rounded_ramp
from beamstiff.exam.laws import Curve, Forgetful, Friction, Law, Memory, Situation, Stiffness, WindUp, fading
from beamstiff.exam.machine import Mesh, drives_of, joints_of, own_stiffness
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

ROUND = 0.08  # of a play's width: its corners
BLUNT = 2e-6  # rad


def soft_zone(k: float, lost: float, knee: float) -> WindUp:
    """Return a strain wave gear's wind-up: teeth that settle add up to `lost` while the torque is small."""

    def wind_up(force: Array) -> tuple[Array, Array]:
        u = force / (k * knee)
        return force / k + lost * (2.0 / np.pi) * np.arctan(u), 1.0 / k + lost * (2.0 / np.pi) / (
            k * knee * (1.0 + u**2)
        )

    return WindUp(wind_up, k)


def engaging(k: float, gain: float, scale: float, skew: float) -> WindUp:
    """Return a gear's wind-up of which more teeth carry the larger the torque, sooner in one direction.

    Stiffness ``k (1 + gain (1 - exp(-|T| / T1)))``, T1 = ``k scale (1 + skew sign(T))``.
    """

    def wind_up(force: Array) -> tuple[Array, Array]:
        T1 = k * scale * np.where(force >= 0.0, 1.0 + skew, 1.0 - skew)
        u = np.abs(force) / T1
        rest = 1.0 + gain * -np.expm1(-u)
        wound = T1 / (k * (1.0 + gain)) * (u + np.log1p(gain * -np.expm1(-u)))
        return np.sign(force) * wound, 1.0 / (k * rest)

    return WindUp(wind_up, k * (1.0 + gain))


def spline(k: float, contact: float, knee: float) -> WindUp:
    """Return the wind-up of a shaft in a spline: contacts that give with the torque to two thirds.

    `contact`: their compliance at no torque, over that of the shaft.
    """

    def wind_up(force: Array) -> tuple[Array, Array]:
        u = force / (k * knee)
        soft = u * (1.0 + u**2) ** (-1.0 / 6.0)
        slope = (1.0 + u**2) ** (-7.0 / 6.0) * (1.0 + 2.0 / 3.0 * u**2)
        return force / k + contact * knee * soft, (1.0 + contact * slope) / k

    return WindUp(wind_up, k)


def scissor(k: float, sign: float, preload: float, gap: float, soft: float) -> Curve:
    """Return a split gear: beyond its preload in one direction the spring half gives by a gap."""
    width = ROUND * (gap + preload)

    def part(y: Array) -> tuple[Array, Array]:
        first, its = rounded_ramp(-y - preload, width)
        last, other = rounded_ramp(-y - preload - gap, width)
        return k * y + (1.0 - soft) * k * (first - last), k - (1.0 - soft) * k * (its - other)

    at_rest = part(np.zeros(1))[0]

    def curve(strain: Array) -> tuple[Array, Array]:
        force, slope = part(sign * strain)
        return sign * (force - at_rest), slope

    return Curve(curve)


@dataclass(frozen=True)
class EccentricMesh(Forgetful):
    """Play between flanks of a wheel that runs out: half as wide again on one side of its turn.

    Grease between the flanks carries a little.
    """

    stiffness: float
    half_width: float
    runout: float
    phase: float
    grease: float
    variable: str

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, slope and no memory."""
        w = self.half_width * (1.0 + self.runout * np.cos(situation.values[self.variable] - self.phase))
        above, below = (np.sqrt((strain + way * w) ** 2 + (ROUND * w) ** 2) for way in (-1.0, 1.0))
        free = strain + 0.5 * (above - below)
        slope = 1.0 + 0.5 * ((strain - w) / above - (strain + w) / below)
        carried = self.stiffness * (1.0 - self.grease)
        rest = self.stiffness * self.grease
        return rest * strain + carried * free, rest + carried * slope, memory


def _soft_zone(request: DrawRequest) -> dict[str, float]:
    return {"lost": request.sized(1e-5, 4e-4), "knee": request.log_uniform(2e-5, 1.5e-4)}


def _engaging(request: DrawRequest) -> dict[str, float]:
    return {
        "gain": request.sized(0.05, 1.5),
        "scale": request.log_uniform(6e-5, 4e-4),
        "skew": request.sign() * request.uniform(0.0, 0.5),
    }


def _hardening(truth: Truth, reality: Reality) -> Reality:
    law_of = soft_zone if truth.form == "soft-zone" else engaging
    return at_joints(truth, reality, lambda k: law_of(k, **truth.parameters))


def _usual(request: DrawRequest) -> float:
    """Return the geometric mean of the other drives' stiffness."""
    robot, place = request.robot, request.component
    like = [
        stiffness_of(robot, name) for name in drives_of(robot) if turns(robot, name) == turns(robot, place)
    ]
    return float(np.exp(np.mean(np.log(like)))) if like else main_stiffness(robot)


def _rope(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": _usual(request) / request.sized(0.03, 1.2),
        "longer": request.sign() * request.uniform(0.15, 0.5),
    }


def _spline(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": _usual(request) / request.sized(0.03, 1.2),
        "contact": request.uniform(0.5, 2.0),
        "knee": request.log_uniform(3e-5, 3e-4),
    }


def _given_way(truth: Truth, reality: Reality) -> Reality:
    p, variable = truth.parameters, str(truth.component)
    if truth.form == "spline":
        return at_joints(truth, reality, lambda _: spline(p["stiffness"], p["contact"], p["knee"]))
    middle, half = stroke(reality.machine.robot, variable)

    def stiffness(situation: Situation) -> Array:
        # the free strand grows as the drum winds off; limits of a joint may be passed by a little
        way = np.clip((situation.values[variable] - middle) / half, -1.5, 1.5)
        return np.asarray(p["stiffness"] / (1.0 + p["longer"] * way))

    return at_joints(truth, reality, lambda _: Stiffness(stiffness))


def _mesh(request: DrawRequest) -> dict[str, float]:
    return {
        "half_width": request.sized(5e-6, 4e-4),
        "runout": request.uniform(0.2, 0.6),
        "phase": request.uniform(0.0, 2.0 * np.pi),
        "grease": request.uniform(0.01, 0.06),
    }


def _scissor(request: DrawRequest) -> dict[str, float]:
    return {
        "sign": request.sign(),
        "preload": request.log_uniform(1e-5, 1.2e-4),
        "gap": request.sized(1e-5, 6e-4),
        "soft": request.uniform(0.02, 0.12),
    }


def _backlash(truth: Truth, reality: Reality) -> Reality:
    def law_of(k: float) -> Law:
        if truth.form == "scissor-gear":
            return scissor(k, **truth.parameters)
        return EccentricMesh(k, variable=str(truth.component), **truth.parameters)

    return at_joints(truth, reality, law_of)


def stiff_joints(robot: Robot) -> Sequence[str | None]:
    """Return the actuated joints that the model holds rigid."""
    names = [v.name for v in robot.actuated if any(j.variable == v.name for j in robot.joints)]
    return [n for n in names if all(np.isinf(own_stiffness(robot, *at)) for at in joints_of(robot, n))]


@dataclass(frozen=True)
class MeshFriction(Friction):
    """Friction of seals, and of teeth in proportion to the torque that they carry: the loop is a bow tie.

    `reach`: strain over which the friction turns round.
    `share`: of the torque.
    """

    reach: float
    share: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state after a way, by Dahl's law."""
        return fading(state, way, self.reach)

    def largest(self, strain: Array, state: Array) -> tuple[Array, Array]:
        """Return the largest friction, and its growth."""
        most = self.friction + self.share * self.stiffness * np.abs(strain)
        return most, self.share * self.stiffness * np.sign(strain) * state


@dataclass(frozen=True)
class WormFriction(Friction):
    """Friction that is larger one way than the other, as of a worm that is driven back.

    `reach`: strain over which it turns round.
    `power`: over 1; by which it nears its largest force, slower than exponentially.
    `skew`: in (-1, 1): friction ``(1 + skew)`` forward, ``(1 - skew)`` back.
    """

    reach: float
    power: float
    skew: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state after a way: what is left of it obeys ``du/dx = -u^power / reach``."""
        n = self.power - 1.0
        start = np.maximum(1.0 - state, 1e-12)
        left = (start**-n + n * way / self.reach) ** (-1.0 / n)
        return 1.0 - left, left**self.power / self.reach

    def largest(self, strain: Array, state: Array) -> tuple[Array, float]:
        """Return the largest friction, which does not grow."""
        return self.friction * (1.0 + self.skew * np.sign(state)), 0.0


def _gear(request: DrawRequest) -> dict[str, float]:
    share = request.sized(0.01, 0.25)
    return {
        "share": share,
        "friction": share * request.log_uniform(3e-5, 4e-4),
        "reach": share * request.log_uniform(2e-4, 1e-3),  # the same teeth bend before they slide
        "arrived": request.uniform(-0.9, 0.9),
    }


def _worm(request: DrawRequest) -> dict[str, float]:
    friction = request.sized(8e-6, 2.5e-4)
    return {
        "friction": friction,
        "reach": friction * request.log_uniform(0.35, 2.0),  # the same teeth bend before they slide
        "power": request.uniform(1.2, 1.8),
        "skew": request.sign() * request.uniform(0.15, 0.5),
        "arrived": request.uniform(-0.9, 0.9),
    }


def _friction(truth: Truth, reality: Reality) -> Reality:
    p = dict(truth.parameters)
    friction = p.pop("friction")  # as the strain that it holds

    def law_of(k: float) -> Law:
        kind = MeshFriction if truth.form == "tooth-friction" else WormFriction
        return kind(stiffness=k, friction=k * friction, **p)

    return at_joints(truth, reality, law_of)


def pairs(robot: Robot) -> Sequence[str | None]:
    """Return the pairs of drives that follow one another."""
    names = turning_drives(robot)
    return [f"{a}+{b}" for a, b in pairwise(names)]


def _housing(request: DrawRequest) -> dict[str, float]:
    return {
        "compliance": request.sized(0.02, 0.8),
        "share": request.sign() * request.uniform(0.5, 1.2),
        "phase": request.uniform(0.0, 2.0 * np.pi),
    }


def _idler(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": request.sized(0.03, 1.2),
        "ratio": request.sign() * request.uniform(0.4, 1.3),
        "side": request.sign(),
    }


def _coupling(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    names = str(truth.component).split("+")
    (first, a), (second, b) = (joints_of(machine.robot, name)[0] for name in names)
    k1, k2 = own_stiffness(machine.robot, first, a), own_stiffness(machine.robot, second, b)
    softer = min(k1, k2)
    if truth.form == "one-way-idler":
        k, side = softer * p["stiffness"], p["side"]

        def curve(strain: Array) -> tuple[Array, Array]:
            carried, slope = rounded_ramp(side * strain, BLUNT)
            return side * k * (carried - 0.5 * BLUNT), k * slope

        mesh = Mesh((first, a), (second, b), (1.0, p["ratio"]), Curve(curve))
        return reality.with_machine(machine.plus(meshes=(mesh,)))

    # both torques twist one housing, the second by the cosine of the angle between the axes: its compliance c
    # in series, (C + c u u^T)^-1 = K - K u u^T K c / (1 + c u^T K u)
    c = p["compliance"] / max(k1, k2)

    def leaning(situation: Situation) -> Array:
        return np.asarray(p["share"] * np.cos(situation.values[names[1]] - p["phase"]))

    def taken(situation: Situation) -> Array:
        return np.asarray(-c / (1.0 + c * (k1 + k2 * leaning(situation) ** 2)))

    mesh = Mesh((first, a), (second, b), (k1, lambda s: k2 * leaning(s)), Stiffness(taken))
    return reality.with_machine(machine.plus(meshes=(mesh,)))


EFFECTS = (
    effect_of(
        "hardening",
        drives,
        {"soft-zone": Form(_soft_zone, _hardening), "engaging-teeth": Form(_engaging, _hardening)},
    ),
    effect_of(
        "joint-compliance",
        stiff_joints,
        {"rope-drive": Form(_rope, _given_way), "spline": Form(_spline, _given_way)},
    ),
    effect_of(
        "backlash",
        drives,
        {"eccentric-mesh": Form(_mesh, _backlash), "scissor-gear": Form(_scissor, _backlash)},
    ),
    effect_of(
        "hysteresis",
        drives,
        {"tooth-friction": Form(_gear, _friction), "driven-back": Form(_worm, _friction)},
    ),
    effect_of(
        "joint-coupling",
        pairs,
        {"common-housing": Form(_housing, _coupling), "one-way-idler": Form(_idler, _coupling)},
    ),
)
