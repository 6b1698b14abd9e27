"""Robots of many unknowns: the sparse way gives what dense matrices give, and refuses what they refuse."""

import numpy as np
import pytest
from hypothesis import event, example, given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, Rigid, Robot, compile_structure, posture
from beamstiff.fem import condensation, static_response
from beamstiff.fem.condensation import Condensed, Port, condense, tcp_compliance
from beamstiff.fem.constraints import has_constraints
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.robot.reader import load_robot
from benchmarks.lattice import slender, tip
from tests.fem.builders import FREE, at_rest, frame, relative_error, robot_of
from tests.fem.random_frames import machine_frame
from tests.fem.test_identities import FIRM


def sparsely(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (condensation, static_response):
        monkeypatch.setattr(module, "MANY_UNKNOWNS", 0)


def alike(one: Condensed, other: Condensed) -> float:
    names = ("port_stiffness", "port_map", "clamped", "port_dead")
    worst = max(relative_error(getattr(one, name), getattr(other, name)) for name in names)
    # where the weight hangs on what is fixed, the rest is rounding: against what a newton does at least
    newton = np.abs(other.clamped).max(initial=0.0)
    size = max(np.abs(other.clamped_dead).max(initial=0.0), newton, 1e-20)
    return max(worst, float(np.abs(one.clamped_dead - other.clamped_dead).max(initial=0.0) / size))


@given(seed=st.integers(0, 2**32 - 1), more=st.integers(2, 7), loops=st.integers(0, 3))
@example(seed=5718, more=4, loops=1)  # all of its weight hangs on what is fixed
def test_random_machines_both_ways(seed: int, more: int, loops: int) -> None:
    made = machine_frame(seed, more, loops, rigid_loops=False)
    robot = made.robot()
    structure = compile_structure(robot)
    if has_constraints(structure) or made.reference().softness() <= FIRM:
        event("left alone")
        return
    rest = at_rest(structure)
    observed = [robot.tcp, f"n{made.turning()[0]}"]
    loads = nodal_loads(structure, 1, {robot.tcp: np.arange(1.0, 7.0)})
    dense = condense(structure, rest, observed), respond(structure, rest, loads, gravity=True)
    with pytest.MonkeyPatch.context() as patched:
        sparsely(patched)
        found = condense(structure, rest, observed), respond(structure, rest, loads, gravity=True)
    assert alike(found[0], dense[0]) <= 1e-8
    assert relative_error(found[1].displacement, dense[1].displacement) <= 1e-8


@pytest.mark.parametrize("name", ["ir663", "gantry", "kr240-2"])
def test_ports_and_poses_both_ways(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot(name)
    structure = compile_structure(robot)
    q = [np.mean(variable.limits or (-0.4, 0.6)) for variable in robot.actuated]
    poses = posture(structure.kinematics, np.array([q, np.multiply(q, 1.05)]))
    joint = next(at for at, item in enumerate(robot.joints) if 0 < item.stiffness.torsional < np.inf)
    ports = [Port(f"{robot.joints[joint].name}.torsional", "joint", joint, 3)]
    dense = condense(structure, poses, [robot.tcp], ports)
    sparsely(monkeypatch)
    assert alike(condense(structure, poses, [robot.tcp], ports), dense) <= 1e-8


def lattice_robot(dofs: float) -> tuple[Robot, int]:
    made = slender(dofs)
    return robot_of(made), tip(made)


def test_a_robot_of_six_thousand_unknowns_obeys_betti_and_clapeyron() -> None:
    robot, _ = lattice_robot(6000)
    structure = compile_structure(robot)
    assert structure.unknowns.count == 6000
    C = tcp_compliance(structure, at_rest(structure))[0]
    unit = respond(structure, at_rest(structure), nodal_loads(structure, 1, {robot.tcp: np.eye(6)[1]}))
    assert unit.displacement[0, structure.kinematics.node_index[robot.tcp]] == pytest.approx(
        C[:, 1], rel=1e-9
    )
    assert float(sum(share[0] for share in unit.energy_shares().values())) == pytest.approx(1.0)


def test_a_mechanism_in_a_large_robot_is_named() -> None:
    """A lever on a free hinge at the far end, among three thousand unknowns."""
    robot, end = lattice_robot(1500)
    grown = robot.model_copy(
        update={
            "nodes": (
                *robot.nodes,
                robot.nodes[end].model_copy(update={"name": "pin"}),
                robot.nodes[end].model_copy(update={"name": "lever", "at": (9.0, 0.0, 0.0)}),
            ),
            "rigids": (Rigid(name="arm", nodes=("pin", "lever")),),
            "joints": (_hinge(f"n{end}"),),
            "tcp": "lever",
        }
    )
    structure = compile_structure(grown)
    assert structure.unknowns.count > condensation.MANY_UNKNOWNS
    with pytest.raises(
        BeamstiffError, match=r"is a mechanism: node 'lever' .* freely, through hinge\.torsional"
    ):
        tcp_compliance(structure, at_rest(structure))


def _hinge(end: str) -> object:
    made = frame([(0, 0, 0), (0, 0, 0)], joints=[(0, 1, (0, 0, 1), (1e8, 1e8, FREE, 1e8))]).joints[0]
    return made.model_copy(update={"name": "hinge", "nodes": (end, "pin")})


def test_many_poses_of_a_large_robot_one_after_another() -> None:
    robot, _ = lattice_robot(1500)
    structure = compile_structure(robot)
    C = tcp_compliance(structure, at_rest(structure).only(np.zeros(2, dtype=np.int64)))
    assert (C[0] == C[1]).all()
