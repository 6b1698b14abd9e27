"""What holds a robot and what it holds: feet, mats, a tool changer, a bracket."""

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, free_name, on_pedestal, sprung
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender
from beamstiff.exam.draws import PHASE, by_ratio, by_reach, evenly, whole
from beamstiff.exam.effect import built
from beamstiff.exam.forms.author4.scales import main_stiffness, round_about, rounded_ramp, wrist_stiffness
from beamstiff.exam.forms.author4.structure import LEGENDRE, lifting
from beamstiff.exam.laws import Curved, Law, curved
from beamstiff.exam.machine import Machine, Rod
from beamstiff.exam.parameters import DrawRequest, Parameters
from beamstiff.exam.rotations import cross_matrix
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Node

ROUND = 0.2  # of a foot's gap: it comes down slowly
ROUGH = 1.2e-5  # m: of the surfaces that meet there
LEG = 0.1  # m
STUD = 0.1  # of a foot's stiffness: what its bolt alone has
SIDEWAYS = 1.5  # of a foot's stiffness


def _half_foot(robot: Robot) -> float:
    return 0.35 / float(np.sqrt(slender(robot)))


def short_foot(k: float, gap: float) -> Law:
    """Return the force of a foot that stands off its shim by a gap: its bolt alone, until it is down."""
    width = ROUGH + ROUND * gap

    def part(strain: Array) -> Curved:
        down, slope = rounded_ramp(-strain - gap, width)
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
            node = Node(name=free_name(machine, f"leg {at}"), at=tuple(map(float, place)))  # type: ignore[arg-type]
            machine = machine.plus(nodes=(node,), rigids=((f"{host} {node.name}", (host, node.name)),))
            ends.append(node.name)
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
    return round_about(machine, machine.hinges[-1], 3, lifting(0.5 * p["bending"], p["from"], p["rest"]))


def _foot(request: DrawRequest) -> float:
    stiffness = main_stiffness(request.robot) / request.sized(0.02, 0.5)
    return stiffness / (4.0 * _half_foot(request.robot) ** 2)


def _bending(request: DrawRequest) -> float:
    return wrist_stiffness(request.robot) / request.sized(0.02, 1.0)


FORMS = (
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
