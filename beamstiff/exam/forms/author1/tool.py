"""At the tool: compliance behind it, a wrench or a reflector beside the TCP, and a reflector that slips."""

import dataclasses
from typing import Any

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.draws import always, direction, each, evenly, sized
from beamstiff.exam.effect import Reality, Seen, built, form, reading
from beamstiff.exam.machine import Bar, Hinge, Machine, tapered
from beamstiff.exam.parameters import Draw, Parameters, vector
from beamstiff.robot.description import Robot

TURN = (3e-7, 1.2e-5)  # rad/(N m)
AWAY = (5e-4, 0.3)  # m
# share that remains where absolute positions are measured, for which the tool is calibrated
CALIBRATED = 0.02
SLIP = (5e-5, 1e-2)  # m


def _behind(machine: Machine, behind: float, *hosts: str) -> tuple[Machine, str]:
    """Return the machine with a new node behind the TCP, whose frame's z is the tool's own axis."""
    tcp = machine.node(machine.tcp)
    return machine.with_node("tool", tcp.frame, np.array(tcp.at) - behind * UP, *hosts)


def _cantilever(p: Parameters, machine: Machine, _: str) -> Machine:
    machine, flange = behind_flange(machine)
    length = 2.0 * p["behind"]  # two thirds behind the middle of a beam make a lever of half its length
    machine, root = _behind(machine, length, flange)
    rigidity = length / p["tilt"] * np.array([1 / 0.03**2, np.inf, np.inf, 1 / p["about"], 1.0, 1.0])
    bar = Bar("tool", (root, machine.tcp), tapered(rigidity, lambda x: 1.15 - 0.3 * x), None)
    return machine.plus(bars=(bar,))


def about_tool(p: Parameters) -> Array:
    """Return compliances (3,), rad/(N m), about the tool's axes."""
    return np.asarray(p["tilt"] * np.array([1.0, p["other"], p["about"]]))


def sprung_about(about: Array) -> Array:
    """Return the springs (6,) of compliances about the axes; those along them have a lever of 50 mm."""
    return np.concatenate([1.0 / (about * 0.05**2), 1.0 / about])


def _series(p: Parameters, machine: Machine, _: str) -> Machine:
    machine, previous = behind_flange(machine)
    frame = machine.node(machine.tcp).frame
    for share, behind in ((p["share"], p["behind"]), (1.0 - p["share"], 0.4 * p["behind"])):
        machine, first = _behind(machine, behind, previous)
        machine, previous = _behind(machine, behind)
        k = sprung_about(share * about_tool(p))
        machine = machine.plus(hinges=(Hinge(first, (first, previous), frame, np.eye(3), k),))
    return machine.plus(rigids=(("to the tip", (previous, machine.tcp)),))


def _offset(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the wrench (by x, y, z) and the reflector (by u, v, w) elsewhere, m."""
    lever, target = vector(truth.parameters), vector(truth.parameters, "uvw")
    return dataclasses.replace(
        reality,
        lever=tuple((reality.lever + lever).tolist()),
        target=tuple((reality.target + target).tolist()),
        marked=tuple((CALIBRATED * target).tolist()),
    )


def reflectors(robot: Robot) -> list[str | None]:
    """Return the reflectors, nodes that nothing but a rigid stalk holds; else the TCP, written None."""
    parts: list[Any] = [*robot.rigids, *robot.beams, *robot.joints, *robot.struts]
    ends = [name for part in parts for name in part.nodes]
    stalks = {part.nodes[1] for part in robot.rigids}
    found = [name for name in dict.fromkeys(ends) if ends.count(name) == 1 and name in stalks]
    return [name for name in found if name != robot.tcp] or [None]


def _slip(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return the readings after a slip; of a second one the way is the same."""
    if not seen.absolute:
        return values
    campaign, point = seen.campaign, seen.component or seen.machine.tcp
    row = np.argsort(np.lexsort((campaign.step, campaign.time))) / len(values)
    again = p["when"] + 0.5 * (1.0 - p["when"])
    share = (campaign.point == point) * ((row >= p["when"]) + p["again"] * (row >= again))
    moved = seen.placed.rotations[seen.machine.node(point).frame] @ vector(p) * share[:, None]
    return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)


def came_to_rest(truth: Truth) -> Truth:
    """Return the slip as a later campaign finds it: where it ended."""
    p = truth.parameters
    end = {**p, **{name: p[name] * (1.0 + p["again"]) for name in "xyz"}, "when": 0.0, "again": 0.0}
    return dataclasses.replace(truth, parameters=end)


_AWAY = sized(*AWAY)
_SOFT: dict[str, Draw] = {"tilt": sized(*TURN), "behind": evenly(0.02, 0.12), "about": evenly(0.3, 1.5)}
FORMS = (
    built("tool-compliance", "series", _series, **_SOFT, share=evenly(0.2, 0.6), other=evenly(0.6, 1.0)),
    built("tool-compliance", "cantilever", _cantilever, **_SOFT),
    form("tool-offset", "wrench", _offset, direction(_AWAY), **dict.fromkeys("uvw", always(0.0))),
    form("tool-offset", "target", _offset, direction(_AWAY, "uvw"), **dict.fromkeys("xyz", always(0.0))),
    form("tool-offset", "both", _offset, direction(_AWAY), direction(_AWAY, "uvw")),
    # when it slips, and again, as shares of the rows, and by how much in the tool's frame, m
    *(reading("target-slip", name, _slip, each(again=again, when=evenly(0.2, 0.8)), direction(sized(*SLIP)))
      for name, again in (("once", always(0.0)), ("twice", evenly(0.0, 0.5)))),
)  # fmt: skip
