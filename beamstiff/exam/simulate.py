"""Measurements of a machine with an effect that its model lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import ROWS, Array, Integers, SimulatedCampaign, Truth, some
from beamstiff.exam.effect import Reality, axes_of
from beamstiff.exam.equilibrium import Load, Problem, Solved, equilibrium, rows_of
from beamstiff.exam.forms import imposed
from beamstiff.exam.laws import Situation
from beamstiff.exam.layout import Layout, Topology, lay_out, topology_of
from beamstiff.exam.machine import drives_of, joints_of, machine_of
from beamstiff.exam.placing import Placed, place, skeleton_of
from beamstiff.exam.rotations import turned_by
from beamstiff.exam.strain import State
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import JOINT_DIRECTIONS

LOG_STD = 0.25
PAUSE = 30.0  # s from one state to the next where the campaign gives no time
ROOM = 20.0  # degC where it gives no temperature


def simulate(
    robot: Robot, truths: Sequence[Truth], campaign: SimulatedCampaign, rng: np.random.Generator
) -> Measurements:
    """Return what a campaign reads on a robot of true stiffness that has some effects, imposed in order.

    Raises BeamstiffError when an effect does not fit, a loop does not close or a state does not come to rest.
    """
    values = readings(reality_of(robot, truths), campaign) + _noise(campaign, rng)
    if not campaign.rotations:
        values[:, 3:] = np.nan
    displacement = campaign.kind == "displacement"
    return table_of(
        robot,
        campaign,
        displacement=values if displacement else None,
        position=None if displacement else values[:, :3],
        rotation=None if displacement else values[:, 3:],
        sigma_position=campaign.claimed_position,
        sigma_rotation=campaign.claimed_rotation if campaign.rotations else None,
        shared_unloaded=campaign.shared_unloaded and displacement,
    )


def table_of(robot: Robot, campaign: SimulatedCampaign, **measured: Any) -> Measurements:
    """Return the states of a campaign as a table, with what was measured."""
    states = {name: getattr(campaign, name) for name in ROWS if name != "q"}
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, campaign.q, tcp=robot.tcp, source="<exam>", **states, **measured)


def reality_of(robot: Robot, truths: Sequence[Truth]) -> Reality:
    """Return a robot's machine with effects, imposed in this order."""
    reality = Reality(machine_of(robot))
    for truth in truths:
        reality = imposed(truth, reality)
    return reality


def draw_stiffness(rng: np.random.Generator, robot: Robot) -> dict[str, float]:
    """Return the true stiffness by name of what is identified, of all drives where nothing is: lognormal."""
    names = robot.identify or tuple(
        f"{joint}.{JOINT_DIRECTIONS[own]}"
        for name in drives_of(robot)
        for joint, own in joints_of(robot, name)
    )
    return {name: robot.parameter(name) * float(np.exp(LOG_STD * rng.standard_normal())) for name in names}


def readings(reality: Reality, campaign: SimulatedCampaign) -> Array:
    """Return the six values of every row without noise, (N, 6)."""
    return read(reality, campaign, solve(reality, campaign))


def read(reality: Reality, campaign: SimulatedCampaign, solved: Solution) -> Array:
    """Return the six values (N, 6) that the rows read on a machine in these equilibria."""
    machine, nodes = reality.machine, solved.topology.index
    point = np.array([nodes[name] for name in campaign.point])
    axes = axes_of(machine, campaign.point, solved.placed)
    away = np.array(reality.target if campaign.kind == "displacement" else reality.marked)
    away = np.where((campaign.point == machine.tcp)[:, None], axes @ away, 0.0)  # the tool's own reflector
    arm = solved.layout.arms[np.arange(len(point)), point] + away
    body = solved.topology.body[point]
    every = np.arange(len(point))
    loaded, unloaded = (state.point(body, arm, every) for state in (solved.loaded, solved.unloaded))
    if campaign.kind == "displacement":
        turned = solved.loaded.turned[every, body] @ np.swapaxes(solved.unloaded.turned[every, body], -1, -2)
        values = np.concatenate([loaded - unloaded, turned_by(turned)], axis=1)
    else:
        tcp = machine.node(machine.tcp)
        turned = solved.loaded.turned[every, solved.topology.body[nodes[machine.tcp]]]
        place_of_point = solved.layout.nodes[every, point] + away
        rotation = turned_by(turned @ solved.placed.rotations[tcp.frame])
        values = np.concatenate([place_of_point + loaded, rotation], axis=1)
    for change in reality.readings:
        values = change(campaign, solved.placed, values)
    return values


@dataclass(frozen=True, eq=False)
class Solution:
    """The machine in every row of a campaign: placed, laid out, loaded and unloaded; N rows each.

    Where absolute positions are read and no law remembers, `unloaded` is any state: nobody asks for it.
    """

    topology: Topology
    placed: Placed
    layout: Layout
    loaded: State
    unloaded: State
    unbalanced: Array


def solve(
    reality: Reality,
    campaign: SimulatedCampaign,
    near: Solution | None = None,
    *,
    start: Solution | None = None,
    once: bool = False,
) -> Solution:
    """Return the equilibrium of the machine in every row of a campaign.

    `near`: to start from; of a machine of the same parts and geometry in the same campaign.
    `start`: the same of any machine; taken where its bodies are as many. `once`: one step: to first order.
    """
    topology = topology_of(reality.machine)
    q, row, row_of = np.unique(campaign.q, axis=0, return_index=True, return_inverse=True)
    row_of = row_of.reshape(-1)
    if near is None:
        errors = {name: error for name, error in reality.geometry.items() if "." in name}
        for change in reality.encoders:
            q = change(q)
        placed = place(skeleton_of(reality.machine.robot, errors), q, reality.geometry)
    else:
        placed = some(near.placed, row)
    layout, placed = some(lay_out(topology, placed), row_of), some(placed, row_of)
    load = _load(reality, topology, campaign, placed, layout)
    first, state_of, state_pose, turn_of = campaign.states()
    situation = _situation(campaign, placed, first, turn_of)
    states = Problem(topology, rows_of(topology), some(layout, first), some(load, first), situation)
    laws = [law for _, law in states.rows.laws]

    start = start or near
    if start is not None and start.topology.bodies != topology.bodies:
        start = None
    own = any(law.changes for law in laws) and not campaign.shared_unloaded
    here = np.arange(len(first))
    poses, first_state = np.unique(state_pose, return_index=True)
    rest_of = here if own else np.searchsorted(poses, state_pose)
    rest_states = here if own else first_state
    unloaded = states.at(rest_states)
    nothing = replace(unloaded.load, wrench=np.zeros_like(unloaded.load.wrench))
    memory = tuple(law.start(len(rest_states)) for law in laws)
    unloaded = replace(unloaded, load=nothing, memory=memory)
    still = unloaded.at_rest()
    begin = still if start is None else _from(start.unloaded, first[rest_states], still)
    remembers = any(law.remembers for law in laws)
    rest = Solved(begin, memory, np.zeros(len(rest_states)))
    if remembers or campaign.kind == "displacement":
        rest = equilibrium(unloaded, begin, once=once)

    state, after, unbalanced = (some(part, rest_of) for part in (rest.state, rest.memory, rest.unbalanced))
    begin = state if start is None else _from(start.loaded, first, state)
    loaded = State(*(np.copy(part) for part in (begin.moved, begin.turned, begin.hold)))
    for turn in range(int(turn_of.max()) + 1) if remembers else (-1,):
        now = here if turn < 0 else here[turn_of == turn]
        before = now  # the state before in the same pose; before the first one the unloaded machine
        if turn > 0:
            last = here[turn_of == turn - 1]
            before = last[np.searchsorted(state_pose[last], state_pose[now])]
        problem = replace(states.at(now), memory=some(after, before))
        found = equilibrium(problem, some(loaded, before if start is None else now), once=once)
        for name in ("moved", "turned", "hold"):
            getattr(loaded, name)[now] = getattr(found.state, name)
        for old, new in zip(after, found.memory, strict=True):
            for part, fresh in zip(old, new, strict=True):
                part[now] = fresh
        unbalanced[now] = np.maximum(unbalanced[now], found.unbalanced)
    return Solution(
        topology, placed, layout, some(loaded, state_of), some(state, state_of), unbalanced[state_of]
    )


def _from(state: State, rows: Integers, other: State) -> State:
    """Return some rows' states to start from; what holds rigid directions from another if they are others."""
    found: State = some(state, rows)
    return found if found.hold.shape == other.hold.shape else replace(found, hold=other.hold)


def _load(
    reality: Reality, topology: Topology, campaign: SimulatedCampaign, placed: Placed, layout: Layout
) -> Load:
    wrench = np.array(campaign.wrench, dtype=np.float64)
    for change in reality.loads:
        wrench = change(campaign, placed, wrench)
    unknown = sorted(set(campaign.load_point.tolist() + campaign.point.tolist()) - set(topology.index))
    if unknown:
        raise BeamstiffError(f"campaign: found the node {unknown[0]!r}, which the robot does not have")
    node = np.array([topology.index[name] for name in campaign.load_point])
    axes = axes_of(reality.machine, campaign.load_point, placed)
    on_tool = (campaign.load_point == reality.machine.tcp)[:, None]
    lever = np.where(on_tool, axes @ np.array(reality.lever), 0.0)
    arm = layout.arms[np.arange(len(node)), node] + lever
    return Load(topology.body[node], arm, wrench)


def _situation(campaign: SimulatedCampaign, placed: Placed, first: Integers, turn: Integers) -> Situation:
    time = np.where(np.isnan(campaign.time[first]), PAUSE * np.arange(len(first)), campaign.time[first])
    time = time - time.min()
    heat = np.where(np.isnan(campaign.temperature[first]), ROOM, campaign.temperature[first])
    lasted = np.diff(time, prepend=time[:1])
    lasted = np.where((turn == 0) | (lasted < 0.0), PAUSE, lasted)
    return Situation({name: value[first] for name, value in placed.values.items()}, time, heat, lasted)


def _noise(campaign: SimulatedCampaign, rng: np.random.Generator) -> Array:
    """Return the noise of the values (N, 6); shared unloaded readings make it equal in part."""
    sigma = np.repeat([campaign.sigma_position, campaign.sigma_rotation], 3)
    noise: Array = rng.standard_normal((len(campaign), 6)) * sigma
    if campaign.shared_unloaded and campaign.kind == "displacement":
        pairs = zip(campaign.pose, campaign.point, strict=True)
        _, group = np.unique([f"{pose} {point}" for pose, point in pairs], return_inverse=True)
        tare = rng.standard_normal((int(group.max()) + 1, 6)) * sigma
        noise = (noise - tare[group]) / np.sqrt(2.0)
    return noise
