"""Links with windows and open sections, and slewing rings that lift or sit in a soft casting."""

import dataclasses
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from beamstiff.exam.added_parts import free_name
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, in_the_middle
from beamstiff.exam.forms.author4.by_form import Form, effect_of, main_stiffness, round_about
from beamstiff.exam.laws import Curve, Situation, Stiffness
from beamstiff.exam.machine import TURN, Bar, Machine, Mesh, Profile, joints_of, own_stiffness
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Node

LEGENDRE = np.polynomial.legendre.leggauss(3)
DEPTH = 0.12  # of a link's section over its length: radius of gyration
SHEAR = 0.25  # of the rigidity in stretch
TWIST = 0.7  # of that in bending
RING = 0.12  # m: radius over which a ring's radial and tilting stiffness go together


def links(robot: Robot) -> Sequence[str | None]:
    """Return the rigids and beams with a length, but for those that stand on the ground."""
    placed = in_the_middle(robot)
    node = {n.name: n for n in robot.nodes}
    found: list[str | None] = []
    for name, nodes in _parts(robot).items():
        a, b = (placed.node(node[at])[0] for at in nodes)
        if np.linalg.norm(b - a) > 1e-3 and not set(nodes) & set(robot.fixed):
            found.append(name)
    return found


def _parts(robot: Robot) -> dict[str, tuple[str, str]]:
    """Return the nodes of the rigids and beams by name."""
    return {p.name: p.nodes for p in robot.rigids} | {p.name: p.nodes for p in robot.beams}


def ringed(robot: Robot) -> Sequence[str | None]:
    """Return the joints that the model holds rigid in tilting."""
    return list(dict.fromkeys(j.variable or j.name for j in robot.joints if np.isinf(j.stiffness.tilting)))


def windowed(stiffness: float, length: float, window: tuple[float, float], weaker: Array) -> Profile:
    """Return the profile of a link of which a piece is weaker.

    `stiffness`: against bending over the length, N m/rad.
    `window`: from and to, over the length.
    `weaker`: (6,) array; how often more compliant the piece is.
    """
    bending = stiffness * length
    along = bending / (DEPTH * length) ** 2
    compliance = 1.0 / np.array([along, SHEAR * along, SHEAR * along, TWIST * bending, bending, bending])
    stations, parts = [], []
    edges = (0.0, *window, 1.0)
    for piece, (start, end) in enumerate(pairwise(edges)):
        stations.append(start + 0.5 * (LEGENDRE[0] + 1.0) * (end - start))
        more = weaker if piece == 1 else np.ones(6)
        parts.append(0.5 * (end - start) * LEGENDRE[1][:, None] * compliance * more)
    return Profile(np.concatenate(stations), np.concatenate(parts))


def _scale(robot: Robot, link: str) -> float:
    """Return the stiffness of the stiffest drive at a link's ends, N m/rad, else of the main drive."""
    ends = set(_parts(robot)[link])
    at = [float(j.stiffness.torsional) for j in robot.joints if set(j.nodes) & ends]
    return max((k for k in at if 0.0 < k < np.inf), default=main_stiffness(robot))


def _window(request: DrawRequest) -> dict[str, float]:
    start = request.uniform(0.15, 0.5)
    return {
        "stiffness": _scale(request.robot, str(request.component)) / request.sized(0.01, 0.25),
        "from": start,
        "to": start + request.uniform(0.2, 0.4),
        "bending": request.uniform(1.3, 2.5),
        "twist": request.uniform(3.0, 8.0),
        "shear": request.log_uniform(8.0, 40.0),
        "side": request.uniform(0.0, np.pi),
    }


def _channel(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": _scale(request.robot, str(request.component)) / request.sized(0.01, 0.25),
        "twist": request.log_uniform(4.0, 15.0),
        "off": request.uniform(0.06, 0.2),
        "side": request.uniform(0.0, 2.0 * np.pi),
    }


def _bend(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    link = str(truth.component)
    old = next((bar for bar in machine.bars if bar.name == link), None)
    nodes = dict(machine.rigids)[link] if old is None else old.nodes
    placed = in_the_middle(machine.robot)
    a, b = (placed.node(machine.node(name))[0] for name in nodes)
    length, along = float(np.linalg.norm(b - a)), (b - a) / np.linalg.norm(b - a)
    u = np.eye(3)[np.argmin(np.abs(along))]
    u = u - (u @ along) * along
    u = u / np.linalg.norm(u)
    side = np.cos(p["side"]) * u + np.sin(p["side"]) * np.cross(along, u)
    if truth.form == "window":
        weaker = np.array([1.5, p["shear"], 1.5, p["twist"], p["bending"], 1.0])
        profile = windowed(p["stiffness"], length, (p["from"], p["to"]), weaker)
    else:
        weaker = np.array([1.0, 1.0, 1.0, p["twist"], 1.0, 1.0])
        profile = windowed(p["stiffness"], length, (0.0, 1.0), weaker)
    up = placed.rotations[machine.node(nodes[0]).frame][0].T @ side
    machine = machine.without(link)
    # what the model has of the link bends as well, in series: from the first end to a body at the second, on
    # which what is added starts
    first = nodes[0]
    if old is not None:
        first = free_name(machine, f"{link} end")
        node = machine.node(nodes[1]).model_copy(update={"name": first})
        bar = dataclasses.replace(old, nodes=(nodes[0], first))
        machine = machine.plus(nodes=(node,), bars=(bar,))
    # the line through the shear centres of an open section runs beside the link
    away = p["off"] * length * side if truth.form == "open-section" else np.zeros(3)
    machine, start = _held(machine, nodes[0], first, away)
    machine, end = _held(machine, nodes[1], nodes[1], away)
    return reality.with_machine(machine.plus(bars=(Bar(f"{link} added", (start, end), profile, up),)))


def _held(machine: Machine, name: str, host: str, away: Array) -> tuple[Machine, str]:
    """Return the machine with a node beside one, by a way in the middle of the range, rigidly on a host."""
    node = machine.node(name)
    at = np.array(node.at) + in_the_middle(machine.robot).rotations[node.frame][0].T @ away
    new = Node(name=free_name(machine, f"beside {name}"), frame=node.frame, at=tuple(map(float, at)))  # type: ignore[arg-type]
    machine = machine.plus(nodes=(new,), rigids=((f"{host} {new.name}", (host, new.name)),))
    return machine, new.name


def lifting(k: float, from_: float, rest: float) -> Curve:
    """Return a spring of stiffness k that falls to a share of it beyond a strain, as a preloaded rim's."""

    def curve(strain: Array) -> tuple[Array, Array]:
        bent = np.tanh(strain / from_)
        force = k * (rest * strain + (1.0 - rest) * from_ * bent)
        return force, k * (rest + (1.0 - rest) * (1.0 - bent**2))

    return Curve(curve)


def _rim(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": _joint_scale(request) / request.sized(0.02, 0.7),
        "from": request.log_uniform(3e-5, 2e-4),
        "rest": request.uniform(0.25, 0.6),
    }


def _soft_side(request: DrawRequest) -> dict[str, float]:
    return {
        "stiffness": _joint_scale(request) / request.sized(0.02, 0.7),
        "softer": request.uniform(0.5, 0.85),
        "phase": request.uniform(0.0, np.pi),
    }


def _joint_scale(request: DrawRequest) -> float:
    robot = request.robot
    own = [own_stiffness(robot, name, TURN) for name, _ in joints_of(robot, str(request.component))]
    return max((k for k in own if 0.0 < k < np.inf), default=0.3 * main_stiffness(robot))


def _tilt(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    variable = str(truth.component)

    def way(situation: Situation) -> Array:
        # the casting does not turn with the ring: seen from the ring its soft side turns back
        return np.asarray(p["phase"] - situation.value(variable))

    for name, _ in joints_of(machine.robot, variable):
        hinge, k = machine.hinge(name), p["stiffness"]
        stiffness = np.array(hinge.stiffness)
        if truth.form == "lifting-rim":
            stiffness[4:] = 0.0
            machine = machine.with_hinge(dataclasses.replace(hinge, stiffness=stiffness))
            machine = round_about(machine, hinge, 4, lifting(0.5 * k, p["from"], p["rest"]))
            continue
        stiffness[4:] = k
        stiffness[1:3] = np.where(np.isinf(stiffness[1:3]), k / RING**2, stiffness[1:3])
        machine = machine.with_hinge(dataclasses.replace(hinge, stiffness=stiffness))
        weights = (lambda s: np.cos(way(s)), lambda s: np.sin(way(s)))
        taken = -k * p["softer"]
        law = Stiffness(lambda s, taken=taken: np.full(len(s.time), taken))  # type: ignore[misc]
        machine = machine.plus(meshes=(Mesh((name, 4), (name, 5), weights, law),))
    return reality.with_machine(machine)


EFFECTS = (
    effect_of("link-bending", links, {"window": Form(_window, _bend), "open-section": Form(_channel, _bend)}),
    effect_of(
        "bearing-tilt",
        ringed,
        {"lifting-rim": Form(_rim, _tilt), "casting-soft-side": Form(_soft_side, _tilt)},
    ),
)
