"""Serial robots with rigid links: C = J diag(1/k) J^T, and with joints that give way in six directions
C = sum J_i C_i J_i^T.

Sources: Salisbury, Active stiffness control of a manipulator in Cartesian coordinates, CDC 1980; Khalil &
Dombre, Modeling, Identification and Control of Robots (2002), section 3.2 (frames) and ch. 15. Here J comes
from the frames' axes, multiplied out anew.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, Frame, Joint, Node, Rigid, Robot, Variable
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.robot.kinematics import posture, twist_jacobian
from tests.fem.builders import FREE, stiffness

TOLERANCE = 1e-10
# axial, radial, torsional or tilting: kind of each of the six directions, first axis along the joint
KINDS = (0, 1, 1, 2, 3, 3)


def serial_robot(
    parameters: np.ndarray,
    prismatic: np.ndarray,
    values: np.ndarray,
    tool: np.ndarray,
    turned_round: bool = False,
) -> Robot:
    """Return a chain of rigid links; rows of `parameters` are (alpha, d, theta, r), of `values` kinds."""
    count = len(parameters)
    variables, frames, joints = [], [], []
    nodes, rigids = [Node(name="ground")], []
    for at, (alpha, d, theta, r) in enumerate(parameters):
        name = f"q{at + 1}"
        variables.append(Variable(name=name, type="prismatic" if prismatic[at] else "revolute"))
        moving = {"theta": float(theta), "r": name} if prismatic[at] else {"theta": name, "r": float(r)}
        parent = f"f{at}" if at else "base"
        frames.append(Frame(name=f"f{at + 1}", parent=parent, alpha=float(alpha), d=float(d), **moving))
        # both sides of the joint lie in its frame: of one that slides, too, which is where they meet
        nodes += [Node(name=f"a{at + 1}", frame=f"f{at + 1}"), Node(name=f"b{at + 1}", frame=f"f{at + 1}")]
        rigids.append((f"b{at}" if at else "ground", f"a{at + 1}"))
        ends = (f"b{at + 1}", f"a{at + 1}") if turned_round else (f"a{at + 1}", f"b{at + 1}")
        own = {"frame": f"f{at + 1}", "variable": name, "stiffness": stiffness(*values[at])}
        joints.append(Joint(name=f"J{at + 1}", nodes=ends, **own))
    nodes.append(Node(name="tool", frame=f"f{count}", at=tuple(tool)))
    rigids.append((f"b{count}", "tool"))
    return Robot(
        name="serial",
        variables=variables,
        frames=frames,
        nodes=nodes,
        rigids=[Rigid(name=f"{i}-{j}", nodes=(i, j)) for i, j in rigids],
        joints=joints,
        fixed=["ground"],
        tcp="tool",
    )


def multiplied_out(
    parameters: np.ndarray, prismatic: np.ndarray, q: np.ndarray, tool: np.ndarray
) -> np.ndarray:
    """Return the frames (n, 3, 4) at one pose and the tool (3,), from the elementary motions."""
    T, frames = np.eye(4), []
    for (alpha, d, theta, r), slides, value in zip(parameters, prismatic, q, strict=True):
        theta, r = (theta, value) if slides else (value, r)
        ca, sa, ct, s_t = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
        first = np.array([[1, 0, 0, d], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        second = np.array([[ct, -s_t, 0, 0], [s_t, ct, 0, 0], [0, 0, 1, r], [0, 0, 0, 1]])
        T = T @ first @ second
        frames.append(T)
    return np.array(frames), T[:3, :3] @ tool + T[:3, 3]


def six_directions(frame: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return J_i (6, 6): the tool's twist for unit motion of the joint along and about its z, x, y axes."""
    z, x, y = frame[:3, 2], frame[:3, 0], frame[:3, 1]
    arm = point - frame[:3, 3]
    columns = [np.concatenate([axis, np.zeros(3)]) for axis in (z, x, y)]
    columns += [np.concatenate([np.cross(axis, arm), axis]) for axis in (z, x, y)]
    return np.array(columns).T


def drawn(seed: int, joints: int = 6, poses: int = 3) -> tuple[np.ndarray, ...]:
    """Return random (parameters, prismatic, tool, q, rng)."""
    rng = np.random.default_rng(seed)
    parameters = rng.uniform(-1.5, 1.5, (joints, 4))
    prismatic = rng.random(joints) < 0.3
    return parameters, prismatic, rng.uniform(-0.5, 0.5, 3), rng.uniform(-1.5, 1.5, (poses, joints)), rng


def largest_error(found: np.ndarray, expected: np.ndarray) -> float:
    """Return the error of compliances (P, 6, 6), by their largest translation, coupling and rotation."""
    blocks = [(..., slice(3 * i, 3 * i + 3), slice(3 * j, 3 * j + 3)) for i in (0, 1) for j in (0, 1)]
    sizes = [np.abs(expected[at]).max() or 1.0 for at in blocks]  # sliding joints alone turn nothing
    errors = [np.abs(found[at] - expected[at]).max() for at in blocks]
    return float(np.max(np.divide(errors, sizes)))


def compliance_of(robot: Robot, q: np.ndarray) -> tuple[Structure, np.ndarray]:
    structure = compile_structure(robot)
    return structure, tcp_compliance(structure, posture(structure.kinematics, q))


@given(seed=st.integers(0, 2**32 - 1), turned_round=st.booleans())
def test_drive_springs_alone(seed: int, turned_round: bool) -> None:
    parameters, prismatic, tool, q, rng = drawn(seed)
    k = 10.0 ** rng.uniform(4, 8, 6)
    values = np.full((6, 4), np.inf)
    values[np.arange(6), np.where(prismatic, 0, 2)] = k
    structure, C = compliance_of(serial_robot(parameters, prismatic, values, tool, turned_round), q)
    assert structure.unknowns.count == 6
    J = twist_jacobian(structure.kinematics, posture(structure.kinematics, q), "tool")
    assert largest_error(C, J @ np.diag(1 / k) @ J.swapaxes(-1, -2)) <= TOLERANCE
    for pose in range(len(q)):
        frames, point = multiplied_out(parameters, prismatic, q[pose], tool)
        columns = [six_directions(frames[at], point)[:, 0 if prismatic[at] else 3] for at in range(6)]
        by_hand = sum(np.outer(column, column) / k[at] for at, column in enumerate(columns))
        assert largest_error(C[pose], by_hand) <= TOLERANCE


@given(seed=st.integers(0, 2**32 - 1), turned_round=st.booleans())
def test_joints_that_give_way_in_six_directions(seed: int, turned_round: bool) -> None:
    parameters, prismatic, tool, q, rng = drawn(seed, joints=4)
    values = 10.0 ** rng.uniform(4, 9, (4, 4))
    values[rng.random((4, 4)) < 0.4] = np.inf
    values[0, 0] = 1e6  # something gives way
    values[0, 3] = 1e6
    _, C = compliance_of(serial_robot(parameters, prismatic, values, tool, turned_round), q)
    for pose in range(len(q)):
        frames, point = multiplied_out(parameters, prismatic, q[pose], tool)
        by_hand = np.zeros((6, 6))
        for at in range(4):
            J = six_directions(frames[at], point)
            by_hand += J @ np.diag(1 / values[at, KINDS]) @ J.T
        assert largest_error(C[pose], by_hand) <= TOLERANCE


@given(seed=st.integers(0, 2**32 - 1), turned_round=st.booleans(), heavy=st.booleans())
def test_torques_are_the_transposed_jacobian_of_a_wrench(seed: int, turned_round: bool, heavy: bool) -> None:
    """tau = J^T w, in all directions that give way."""
    parameters, prismatic, tool, q, rng = drawn(seed, joints=4, poses=2)
    values = 10.0 ** rng.uniform(4, 9, (4, 4))
    values[rng.random((4, 4)) < 0.5] = np.inf
    if heavy:
        values[1] = np.inf  # a joint that is rigid in all directions
    structure = compile_structure(serial_robot(parameters, prismatic, values, tool, turned_round))
    wrench = rng.normal(size=6) * 100
    loads = nodal_loads(structure, 2, {"tool": wrench})
    response = respond(structure, posture(structure.kinematics, q), loads)
    sign = -1.0 if turned_round else 1.0
    for pose in range(2):
        frames, point = multiplied_out(parameters, prismatic, q[pose], tool)
        for at in range(4):
            expected = sign * six_directions(frames[at], point).T @ wrench
            size = np.abs(expected).max()
            finite = np.isfinite(values[at, KINDS])
            spring = np.where(finite, values[at, KINDS], 0.0) * response.joint_displacement[pose, at]
            along = finite & (np.array(KINDS) % 2 == 0)
            assert np.abs(spring - expected)[along].max(initial=0.0) <= 1e-8 * size
            for across in ([1, 2], [4, 5]):  # any two axes: compare sizes
                if finite[across].all():
                    gap = np.linalg.norm(spring[across]) - np.linalg.norm(expected[across])
                    assert abs(gap) <= 1e-8 * size


def test_a_free_direction_of_a_serial_robot_is_a_mechanism_in_that_direction() -> None:
    parameters, _, tool, q, _ = drawn(1)
    values = np.full((6, 4), np.inf)
    values[:, 2] = 1e6
    values[3, 2] = FREE
    robot = serial_robot(parameters, np.zeros(6, dtype=bool), values, tool)
    with pytest.raises(BeamstiffError, match=r"'serial' is a mechanism at pose 0: .* through J4\.torsional"):
        compliance_of(robot, q)
