"""Links, slewing rings, and what holds a robot and what it holds: feet, mats, a tool changer, a bracket."""

import dataclasses
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, on_pedestal, round_about, sprung
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import main_stiffness, slender, wrist_stiffness
from beamstiff.exam.draws import PHASE, by_ratio, by_reach, each, evenly, whole
from beamstiff.exam.effect import built, built_at_joints
from beamstiff.exam.laws import Curved, Law, Situation, curved, ramp, varying
from beamstiff.exam.machine import TURN, Bar, Machine, Mesh, Profile, Rod, joints_of, own_stiffness
from beamstiff.exam.parameters import DrawRequest, Parameters
from beamstiff.exam.rotations import cross_matrix
from beamstiff.robot.description import Robot

LEGENDRE = np.polynomial.legendre.leggauss(3)
DEPTH = 0.12  # of a link's section over its length: radius of gyration
SHEAR = 0.25  # of the rigidity in stretch
TWIST = 0.7  # of that in bending
RING = 0.12  # m: radius over which a ring's radial and tilting stiffness go together
ROUND = 0.2  # of a foot's gap: it comes down slowly
ROUGH = 1.2e-5  # m: of the surfaces that meet there
LEG = 0.1  # m
STUD = 0.1  # of a foot's stiffness: what its bolt alone has
SIDEWAYS = 1.5  # of a foot's stiffness


def windowed(stiffness: float, length: float, window: tuple[float, float], weaker: Array) -> Profile:
    """Return the profile of a link, `stiffness` N m/rad against bending, of which a piece is weaker.

    `window`: from and to, over the length. `weaker`: (6,) array; how often more compliant the piece is.
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


def _link_stiffness(request: DrawRequest) -> float:
    """Return a link's stiffness, by the stiffest drive at its ends, N m/rad, else the main drive's."""
    robot = request.robot
    parts = {part.name: part.nodes for part in robot.rigids} | {part.name: part.nodes for part in robot.beams}
    ends = set(parts[str(request.component)])
    at = [float(j.stiffness.torsional) for j in robot.joints if set(j.nodes) & ends]
    scale = max((k for k in at if 0.0 < k < np.inf), default=main_stiffness(robot))
    return scale / request.sized(0.01, 0.25)


# where a link is weaker, from and to over its length, and how often more compliant it is there, (6,)
Piece = Callable[[Parameters], tuple[tuple[float, float], Array]]


def _draw_window(request: DrawRequest) -> dict[str, float]:
    start = request.uniform(0.15, 0.5)
    return {"from": start, "to": start + request.uniform(0.2, 0.4)}


def _window(p: Parameters) -> tuple[tuple[float, float], Array]:
    return (p["from"], p["to"]), np.array([1.5, p["shear"], 1.5, p["twist"], p["bending"], 1.0])


def _open_section(p: Parameters) -> tuple[tuple[float, float], Array]:
    return (0.0, 1.0), np.array([1.0, 1.0, 1.0, p["twist"], 1.0, 1.0])


def _bend(piece: Piece, p: Parameters, machine: Machine, link: str) -> Machine:
    old = next((bar for bar in machine.bars if bar.name == link), None)
    nodes = dict(machine.rigids)[link] if old is None else old.nodes
    a, b = machine.places(*nodes)
    length, along = float(np.linalg.norm(b - a)), (b - a) / np.linalg.norm(b - a)
    u = np.eye(3)[np.argmin(np.abs(along))]
    u = u - (u @ along) * along
    u = u / np.linalg.norm(u)
    side = np.cos(p["side"]) * u + np.sin(p["side"]) * np.cross(along, u)
    profile = windowed(p["stiffness"], length, *piece(p))
    up = machine.seen_from(nodes[0], side)
    machine = machine.without(link)
    # what the model has of the link bends as well, in series: from the first end to a body at the second, on
    # which what is added starts
    first = nodes[0]
    if old is not None:
        first = machine.free_name(f"{link} end")
        node = machine.node(nodes[1]).model_copy(update={"name": first})
        machine = machine.plus(nodes=(node,), bars=(dataclasses.replace(old, nodes=(nodes[0], first)),))
    # the line through the shear centres of an open section runs beside the link
    away = p.get("off", 0.0) * length * side
    machine, start = _held(machine, nodes[0], first, away)
    machine, end = _held(machine, nodes[1], nodes[1], away)
    return machine.plus(bars=(Bar(f"{link} added", (start, end), profile, up),))


def _held(machine: Machine, name: str, host: str, away: Array) -> tuple[Machine, str]:
    """Return the machine with a node beside one, by a way in the middle of the range, rigidly on a host."""
    node = machine.node(name)
    return machine.with_node(
        f"beside {name}", node.frame, np.array(node.at) + machine.seen_from(name, away), host
    )


def lifting(k: float, from_: float, rest: float) -> Law:
    """Return a spring of stiffness k that falls to a share of it beyond a strain, as a preloaded rim's."""

    def curve(strain: Array) -> Curved:
        bent = np.tanh(strain / from_)
        force = k * (rest * strain + (1.0 - rest) * from_ * bent)
        return force, k * (rest + (1.0 - rest) * (1.0 - bent**2))

    return curved(curve)


def _joint_stiffness(request: DrawRequest) -> float:
    """Return a ring's stiffness, by its joint's, N m/rad, else by the main drive's."""
    robot = request.robot
    own = [own_stiffness(robot, name, TURN) for name, _ in joints_of(robot, str(request.component))]
    scale = max((k for k in own if 0.0 < k < np.inf), default=0.3 * main_stiffness(robot))
    return scale / request.sized(0.02, 0.7)


def _lifting_rim(p: Parameters, machine: Machine, joint: str, _: int) -> Machine:
    machine = machine.with_stiffness(joint, slice(4, 6), 0.0)
    return round_about(machine, joint, 4, lifting(0.5 * p["stiffness"], p["from"], p["rest"]))


def _soft_side(p: Parameters, machine: Machine, variable: str) -> Machine:
    """Return the machine with a ring in a casting, softer on one side, that does not turn with the ring."""
    k, taken = p["stiffness"], -p["stiffness"] * p["softer"]

    def way(situation: Situation) -> Array:
        # seen from the ring its soft side turns back
        return np.asarray(p["phase"] - situation.value(variable))

    for name, _ in joints_of(machine.robot, variable):
        radial = machine.hinge(name).stiffness[1:3]
        machine = machine.with_stiffness(name, slice(4, 6), k)
        machine = machine.with_stiffness(name, slice(1, 3), np.where(np.isinf(radial), k / RING**2, radial))
        weights = (lambda s: np.cos(way(s)), lambda s: np.sin(way(s)))
        law = varying(lambda s: np.full(len(s.time), taken))
        machine = machine.plus(meshes=(Mesh((name, 4), (name, 5), weights, law),))
    return machine


def _half_foot(robot: Robot) -> float:
    return 0.35 / float(np.sqrt(slender(robot)))


def short_foot(k: float, gap: float) -> Law:
    """Return the force of a foot that stands off its shim by a gap: its bolt alone, until it is down."""
    width = ROUGH + ROUND * gap

    def part(strain: Array) -> Curved:
        down, slope = ramp(-strain - gap, width)
        return k * (STUD * strain - (1.0 - STUD) * down), k * (STUD + (1.0 - STUD) * slope)

    free = part(np.zeros(1))[0]
    return curved(lambda strain: (part(strain)[0] - free, part(strain)[1]))


def _on_feet(p: Parameters, machine: Machine, _: str) -> Machine:
    half, k = _half_foot(machine.robot), p["foot"]
    sideways = SIDEWAYS * k
    machine = on_pedestal(machine, np.array([sideways, sideways, 0.0, 0.0, 0.0, 2.0 * sideways * half**2]))
    ground, body = machine.hinges[-1].nodes
    middle = np.array(machine.node(ground).at)
    for at, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        top = middle + half * np.array([x, y, 0.0])
        ends = []
        for host, place in ((ground, top - [0.0, 0.0, LEG]), (body, top)):
            machine, name = machine.with_node(f"leg {at}", "base", place, host)
            ends.append(name)
        law = short_foot(k, p["gap"]) if at == p["short"] else None
        machine = machine.plus(rods=(Rod(f"leg {at}", (ends[0], ends[1]), k, law),))
    return machine


def rubber(k: float, from_: float, rest: float) -> Law:
    """Return a filled rubber's force: its stiffness falls from k to a share of it, by Payne's effect."""

    def curve(strain: Array) -> Curved:
        u = 1.0 + np.abs(strain) / from_
        return k * strain * (rest + (1.0 - rest) / u), k * (rest + (1.0 - rest) / u**2)

    return curved(curve)


def _on_mats(p: Parameters, machine: Machine, _: str) -> Machine:
    half = _half_foot(machine.robot)
    tilting, upright = p["tilting"], p["tilting"] / half**2
    shear = p["sideways"] * upright
    stiffness = np.array([shear, shear, upright, tilting, tilting, 2.0 * shear * half**2])
    soft = {0: half, 1: half, 3: 1.0, 4: 1.0, 5: 1.0}  # strains are larger by the arm than turns
    laws = {at: rubber(float(stiffness[at]), p["from"] * arm, p["rest"]) for at, arm in soft.items()}
    return on_pedestal(machine, stiffness, laws)


def bracket(p: Parameters) -> Array:
    """Return an L-bracket's compliance at the tool (6, 6): an arm aside of the flange, and one ahead."""
    aside = np.array([np.cos(p["way"]), np.sin(p["way"]), 0.0])
    ahead = np.array([0.0, 0.0, 1.0])
    long = p["aside"] + p["ahead"]
    rigidity = p["bending"] * long
    # bending of a flat bar: weak about its broad side
    turn = 1.0 / (rigidity * np.array([p["twist"], p["flat"], 1.0]))
    compliance = np.zeros((6, 6))
    corner = -p["ahead"] * ahead
    for along, start, length in (
        (aside, corner - p["aside"] * aside, p["aside"]),
        (ahead, corner, p["ahead"]),
    ):
        axes = np.stack([along, np.cross(ahead, aside), np.cross(along, np.cross(ahead, aside))], axis=-1)
        flexible = axes @ np.diag(turn) @ axes.T
        for x, weight in zip(0.5 * (LEGENDRE[0] + 1.0), 0.5 * LEGENDRE[1], strict=True):
            # moment at the station from the load at the tool
            carried = np.concatenate([cross_matrix(-(start + x * length * along)), np.eye(3)], axis=1)
            compliance += weight * length * carried.T @ flexible @ carried
    small = 1e-3 * np.trace(compliance[:3, :3])  # stretch and shear
    compliance[:3, :3] += small * np.eye(3)
    return compliance


def _side_bracket(p: Parameters, machine: Machine, _: str) -> Machine:
    stiffness = np.linalg.inv(bracket(p))
    return sprung(*behind_flange(machine), np.zeros(3), 0.5 * (stiffness + stiffness.T))


def _tool_changer(p: Parameters, machine: Machine, _: str) -> Machine:
    held = np.array([np.inf, np.inf, np.inf, 0.0, 0.0, p["twist"] * p["bending"]])
    machine = sprung(*behind_flange(machine), -p["behind"] * UP, held)
    return round_about(machine, machine.hinges[-1].name, 3, lifting(0.5 * p["bending"], p["from"], p["rest"]))


def _foot(request: DrawRequest) -> float:
    stiffness = main_stiffness(request.robot) / request.sized(0.02, 0.5)
    return stiffness / (4.0 * _half_foot(request.robot) ** 2)


def _bending(request: DrawRequest) -> float:
    return wrist_stiffness(request.robot) / request.sized(0.02, 1.0)


FORMS = (
    built("link-bending", "window", partial(_bend, _window), each(stiffness=_link_stiffness),
          _draw_window, bending=evenly(1.3, 2.5), twist=evenly(3.0, 8.0), shear=by_ratio(8.0, 40.0),
          side=evenly(0.0, np.pi)),
    built("link-bending", "open-section", partial(_bend, _open_section),
          stiffness=_link_stiffness, twist=by_ratio(4.0, 15.0), off=evenly(0.06, 0.2), side=PHASE),
    built_at_joints("bearing-tilt", "lifting-rim", _lifting_rim,
                    stiffness=_joint_stiffness, **{"from": by_ratio(3e-5, 2e-4), "rest": evenly(0.25, 0.6)}),
    built("bearing-tilt", "casting-soft-side", _soft_side,
          stiffness=_joint_stiffness, softer=evenly(0.5, 0.85), phase=evenly(0.0, np.pi)),
    built("base-compliance", "short-foot", _on_feet,
          foot=_foot, gap=by_ratio(1e-5, 1.5e-4), short=whole(0, 4)),
    built("base-compliance", "mats", _on_mats,
          tilting=lambda request: main_stiffness(request.robot) / request.sized(0.02, 0.6),
          **{"from": by_ratio(2e-5, 1.5e-4), "rest": evenly(0.3, 0.6), "sideways": evenly(0.15, 0.5)}),
    built("tool-compliance", "tool-changer", _tool_changer,
          bending=_bending, **{"from": by_ratio(3e-5, 3e-4), "rest": evenly(0.2, 0.5)},
          twist=evenly(2.0, 5.0), behind=by_reach(evenly(0.05, 0.2))),
    built("tool-compliance", "side-bracket", _side_bracket,
          bending=_bending, aside=by_reach(evenly(0.08, 0.3)), ahead=by_reach(evenly(0.08, 0.35)),
          way=PHASE, flat=evenly(0.15, 0.7), twist=evenly(0.3, 0.8)),
)  # fmt: skip
