"""At the tool: compliance behind it, a wrench or a reflector beside the TCP, and a reflector that slips."""

import dataclasses

import numpy as np

from beamstiff.exam.added_parts import behind_flange, free_name
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.machine import Bar, Hinge, tapered
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Node

TURN = (3e-7, 1.2e-5)  # rad/(N m)
AWAY = (5e-4, 0.3)  # m
# share that remains where absolute positions are measured, for which the tool is calibrated
CALIBRATED = 0.02
SLIP = (5e-5, 1e-2)  # m


def _draw_soft(request: DrawRequest) -> dict[str, float]:
    """Return the tilting compliance, rad/(N m), its distance behind the TCP, m, and the tool's shape."""
    found = {"tilt": request.sized(*TURN), "behind": request.uniform(0.02, 0.12)}
    found["about"] = request.uniform(0.3, 1.5)
    if request.form == "series":
        found |= {"share": request.uniform(0.2, 0.6), "other": request.uniform(0.6, 1.0)}
    return found


def _soft(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a soft tool; its own axis is z of the TCP's frame."""
    machine, flange = behind_flange(reality.machine)
    p, tcp = truth.parameters, machine.node(machine.tcp)

    def node(behind: float) -> Node:
        at = (tcp.at[0], tcp.at[1], tcp.at[2] - behind)
        return Node(name=free_name(machine, "tool"), frame=tcp.frame, at=at)

    if truth.form == "cantilever":
        # two thirds behind the middle of a beam make a lever of half its length
        length = 2.0 * p["behind"]
        root = node(length)
        EI = length / p["tilt"]
        rigidity = EI * np.array([1 / 0.03**2, np.inf, np.inf, 1 / p["about"], 1.0, 1.0])
        bar = Bar("tool", (root.name, tcp.name), tapered(rigidity, lambda x: 1.15 - 0.3 * x), None)
        return reality.with_machine(
            machine.plus(nodes=(root,), rigids=(("tool root", (flange, root.name)),), bars=(bar,))
        )
    compliance = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    axes = np.eye(3)
    previous = flange
    for share, behind in ((p["share"], p["behind"]), (1.0 - p["share"], 0.4 * p["behind"])):
        first = node(behind)
        machine = machine.plus(nodes=(first,))
        second = node(behind)
        about = share * compliance
        k = np.concatenate([1.0 / (about * 0.05**2), 1.0 / about])
        machine = machine.plus(
            nodes=(second,),
            rigids=((f"to {first.name}", (previous, first.name)),),
            hinges=(Hinge(first.name, (first.name, second.name), tcp.frame, axes, k),),
        )
        previous = second.name
    tie = ("to the tip", (previous, tcp.name))
    return reality.with_machine(machine.plus(rigids=(tie,)))


def _draw_offset(request: DrawRequest) -> dict[str, float]:
    """Return where the wrench acts (x, y, z) and the reflector sits (u, v, w), m, in the node's frame."""
    away, found = request.sized(*AWAY), dict.fromkeys("xyzuvw", 0.0)
    if request.form in ("wrench", "both"):
        found |= request.direction(away)
    if request.form in ("target", "both"):
        found |= request.direction(away, "uvw")
    return found


def _offset(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the tool offset."""
    p = truth.parameters
    x, y, z = reality.lever
    u, v, w = reality.target
    return dataclasses.replace(
        reality,
        lever=(x + p["x"], y + p["y"], z + p["z"]),
        target=(u + p["u"], v + p["v"], w + p["w"]),
        marked=(CALIBRATED * p["u"], CALIBRATED * p["v"], CALIBRATED * p["w"]),
    )


def reflectors(robot: Robot) -> list[str | None]:
    """Return the reflectors, nodes that nothing but a rigid stalk holds; else the TCP, written None."""
    ends = [name for part in robot.rigids for name in part.nodes]
    ends += [name for part in (*robot.beams, *robot.joints, *robot.struts) for name in part.nodes]  # type: ignore[attr-defined]
    stalks = {part.nodes[1] for part in robot.rigids}
    found = [name for name in dict.fromkeys(ends) if ends.count(name) == 1 and name in stalks]
    return [name for name in found if name != robot.tcp] or [None]


def _draw_slip(request: DrawRequest) -> dict[str, float]:
    """Return when it slips, as a share of the rows, and by how much in the tool's frame, m."""
    again = request.uniform(0.0, 0.5) if request.form == "twice" else 0.0
    return {"when": request.uniform(0.2, 0.8), "again": again} | request.direction(request.sized(*SLIP))


def _slip(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the slip; of a second one the way is the same."""
    p, point = truth.parameters, truth.component or reality.machine.tcp
    frame = reality.machine.node(point).frame

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        if campaign.kind != "absolute":
            return values
        row = np.argsort(np.lexsort((campaign.step, campaign.time))) / len(values)
        again = p["when"] + 0.5 * (1.0 - p["when"])
        share = (campaign.point == point) * ((row >= p["when"]) + p["again"] * (row >= again))
        moved = placed.rotations[frame] @ vector(p) * share[:, None]
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    return reality.with_reading(read)


def came_to_rest(truth: Truth) -> Truth:
    """Return the slip as a later campaign finds it: where it ended."""
    p = truth.parameters
    end = {**p, **{name: p[name] * (1.0 + p["again"]) for name in "xyz"}, "when": 0.0, "again": 0.0}
    return dataclasses.replace(truth, parameters=end)


EFFECTS: tuple[Effect, ...] = (
    Effect("tool-compliance", ("series", "cantilever"), nowhere, _draw_soft, _soft),
    Effect("tool-offset", ("wrench", "target", "both"), nowhere, _draw_offset, _offset),
)
# in the table since the exam of crowded machines, which alone draws them: others keep their cases
LATER: tuple[Effect, ...] = (Effect("target-slip", ("once", "twice"), reflectors, _draw_slip, _slip),)
