"""Statically determinate space trusses of struts: forces by joints, displacements by virtual work.

Source: Timoshenko & Young, Theory of Structures, 2nd ed., chs 4 (simple space trusses) and 7 (virtual work).
"""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from beamstiff.robot.description import Robot
from tests.fem.builders import RIGID, displacement, frame, solve

TOLERANCE = 1e-9


def with_a_beam(points: np.ndarray, **parts: object) -> Robot:
    """Return a truss with a beam apart from it, for the TCP needs a rotation."""
    count = len(points)
    aside = [(9.0, 9.0, 9.0), (9.0, 9.0, 10.0)]
    return frame([*points.tolist(), *aside], beams=[(count, count + 1)], fixed=(0, 1, 2, count), **parts)


def tripod(r: float, h: float, k: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness (3,) of three legs of length s to an apex over a circle: found, and closed form.

    With k = EA/s of a leg: 3 k (h/s)^2 down, 3/2 k (r/s)^2 aside.
    """
    angles = 2 * np.pi * np.arange(3) / 3
    feet = np.stack([r * np.cos(angles), r * np.sin(angles), np.zeros(3)], axis=1)
    robot = with_a_beam(np.concatenate([feet, [[0, 0, h]]]), struts=[(at, 3, k) for at in range(3)])
    s2 = r**2 + h**2
    found = [1.0 / displacement(robot, {"n3": np.eye(6)[axis]}, "n3")[axis] for axis in range(3)]
    return np.array(found), k * np.array([1.5 * r**2, 1.5 * r**2, 3 * h**2]) / s2


def test_tripod() -> None:
    found, expected = tripod(0.6, 1.1, 4e7)
    assert found == pytest.approx(expected, rel=TOLERANCE)


def random_truss(seed: int, more: int) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Return a simple space truss: three fixed nodes, and each further one held by three struts."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (3 + more, 3))
    pairs = [(int(i), node) for node in range(3, 3 + more) for i in rng.choice(node, 3, replace=False)]
    return points, pairs


def equilibrium(points: np.ndarray, pairs: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Return A of ``A n = load`` (tensions n on the free nodes), and the lengths of the members."""
    matrix, lengths = np.zeros((len(points), 3, len(pairs))), np.zeros(len(pairs))
    for at, (i, j) in enumerate(pairs):
        along = points[j] - points[i]
        lengths[at] = np.linalg.norm(along)
        matrix[j, :, at], matrix[i, :, at] = along / lengths[at], -along / lengths[at]
    return matrix[3:].reshape(-1, len(pairs)), lengths


@given(seed=st.integers(0, 2**32 - 1), more=st.integers(1, 6), share=st.sampled_from([0.0, 0.0, 0.5, 1.0]))
def test_simple_space_trusses_by_the_method_of_joints(seed: int, more: int, share: float) -> None:
    """Of rigid struts, a share of them all, virtual work has nothing; with all of them, nothing moves."""
    points, pairs = random_truss(seed, more)
    A, lengths = equilibrium(points, pairs)
    assume(np.linalg.cond(A) < 100)
    rng = np.random.default_rng(seed + 1)
    load, EA = rng.normal(size=3 * more) * 1e3, rng.uniform(1e6, 1e8, len(pairs))
    tension, rigid = np.linalg.solve(A, load), rng.random(len(pairs)) < share
    longer = np.where(rigid, 0.0, tension * lengths / EA)
    expected = np.linalg.solve(A.T, longer).reshape(-1, 3)
    struts = [(i, j, RIGID if rigid[at] else EA[at] / lengths[at]) for at, (i, j) in enumerate(pairs)]
    forces = {f"n{3 + at}": [*part, 0, 0, 0] for at, part in enumerate(load.reshape(-1, 3))}
    response = solve(with_a_beam(points, struts=struts), forces)
    found = response.displacement[0, 3 : 3 + more, :3]
    assert np.abs(found - expected).max() <= TOLERANCE * max(np.abs(expected).max(), 1e-12)
    # and the members' energy is n^2 L / 2 EA each
    energy, by_hand = response.element_energy[0, 1:], (tension * longer / 2)[~rigid]
    if not rigid.all():
        assert np.abs(energy[energy != 0.0] - by_hand).max() <= TOLERANCE * by_hand.max()
