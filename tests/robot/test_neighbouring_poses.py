"""A planar platform on three legs (3-RPR) that changes its assembly without a singular posture between.

Lengths of Innocenti and Parenti-Castelli 1998, a tenth of them in metres. The truth is the platform's pose,
from which the lengths of the legs follow; a way of poses leads from one to another at the same lengths.
"""

import numpy as np

from beamstiff import Frame, Loop, Node, Robot
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture_at
from tests.robot.machines import Array, machine, prismatic, revolute

FEET = np.array([[0.0, 0.0], [1.591, 0.0], [0.0, 1.0]])
SIDES = 1.704, 1.654, 2.084  # of the platform: 1-2, 1-3, 2-3
ALONG = (SIDES[0] ** 2 + SIDES[1] ** 2 - SIDES[2] ** 2) / (2 * SIDES[0])
HEADS = np.array([[0.0, 0.0], [SIDES[0], 0.0], [ALONG, np.sqrt(SIDES[1] ** 2 - ALONG**2)]])
# x, y, angle of the platform: from the first by the second nearly to a posture with the legs of the first
WAY = np.array([[0.828, 2.029, -2.074], [-0.402, 0.290, -0.258], [-1.172, -1.588, 0.413]])


def legs(poses: Array) -> Array:
    """Return the ways along the legs (P, 3, 2) at poses (P, 3) of the platform."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    return poses[:, None, :2] + np.einsum("pij,kj->pki", turn, HEADS) - FEET


def determinant(poses: Array) -> Array:
    """Return the determinant of the legs' lines, (P,): zero where the platform moves with all legs held."""
    ways = legs(poses)
    arm = ways + FEET - poses[:, None, :2]
    moment = arm[..., 0] * ways[..., 1] - arm[..., 1] * ways[..., 0]
    lines = np.concatenate([ways, moment[..., None]], -1) / np.linalg.norm(ways, axis=2)[..., None]
    return np.linalg.det(lines)


def platform(first: Array) -> Robot:
    """Return the platform with the guesses of a pose (3,)."""
    angles = np.arctan2(*legs(first[None])[0].T[::-1])
    variables = [prismatic(f"s{leg}", limits=(0.05, 4.0)) for leg in range(3)]
    variables += [revolute(f"a{leg}", passive=True, guess=float(angle)) for leg, angle in enumerate(angles)]
    variables.append(revolute("turn", passive=True, guess=float(first[2] - angles[0])))
    frames = []
    for leg, foot in enumerate(FEET):
        at = float(np.arctan2(foot[1], foot[0]))
        frames += [
            Frame(name=f"foot{leg}", gamma=at, d=float(np.linalg.norm(foot))),
            Frame(name=f"leg{leg}", parent=f"foot{leg}", gamma=-at, theta=f"a{leg}"),
            Frame(name=f"end{leg}", parent=f"leg{leg}", d=f"s{leg}"),
        ]
    frames.append(Frame(name="platform", parent="end0", theta="turn"))
    nodes = [Node(name=f"head{leg}", frame="platform", at=(*HEADS[leg].tolist(), 0.0)) for leg in (1, 2)]
    loops = [Loop(name=f"leg{leg}", a=f"end{leg}", b=f"head{leg}", constrain="plane") for leg in (1, 2)]
    return machine(variables, frames, tool=("platform", (0.0, 0.0, 0.0)), loops=loops, nodes=nodes)


def test_poses_along_a_way_are_closed_as_their_neighbours_where_no_singular_posture_parts_them() -> None:
    poses = np.stack([np.interp(np.linspace(0, 2, 500), [0, 1, 2], column) for column in WAY.T], axis=1)
    assert determinant(poses).max() < -0.3  # the same sign all along
    kinematics = compile_kinematics(platform(poses[0]))
    q = np.linalg.norm(legs(poses), axis=2)

    def off(lengths: Array, truth: Array) -> Array:
        values = close_loops(kinematics, lengths).values
        found = pose_of(kinematics, posture_at(kinematics, values), "tool")[:, :2, 3]
        return np.linalg.norm(found - truth[:, :2], axis=1)

    assert off(q, poses).max() < 1e-9
    mixed = np.random.default_rng(0).permutation(500)
    assert off(q[mixed], poses[mixed]).max() < 1e-9
    # by itself the last one is closed otherwise: nothing says which way the legs went
    assert off(q[-1:], poses[-1:])[0] > 0.5
