"""Loads that act beside the tool or are misread, of all authors: against linear theory."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Robot, load_robot
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.forms.author3.structure import eyes
from tests.exam.campaigns import campaign_of, changed, drawn, random_loads
from tests.exam.kr240 import XYZ, linear, more, serial, tcp_axes, tcp_places, vector


class Machine(NamedTuple):
    """A robot at poses with their axes of the tool (P, 3, 3), and loads (P, S, 6) as read."""

    robot: Robot
    q: Array
    axes: Array
    loads: Array


def moment_of(arm: Array, m: Machine) -> Array:
    """Return the moment of the forces at an arm (P, 3) or (P, S, 3), base frame."""
    force = m.loads[..., :3]
    arm = arm[:, None] if arm.ndim == 2 else arm
    return np.concatenate([np.zeros_like(force), np.cross(arm, force)], axis=-1)


def beside(truth: Truth, m: Machine) -> Array:
    return moment_of(m.axes @ vector(truth), m)


def strap(truth: Truth, m: Machine) -> Array:
    """Return what a load does that hangs below the tool whichever way that is turned."""
    return moment_of(np.tile([0.0, 0.0, -truth.parameters["away"]], (6, 1)), m)


def shackle(truth: Truth, m: Machine) -> Array:
    """Return what an eye does that goes where the load pulls it furthest along its ring."""
    n = vector(truth)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    u = u / np.linalg.norm(u)
    angles = np.linspace(0.0, 2.0 * np.pi, 20001)[:, None]
    ring = truth.parameters["away"] * (np.cos(angles) * u + np.sin(angles) * np.cross(n, u))
    places = [ring @ a.T for a in m.axes]
    furthest = [at[np.argmax(at @ f)] for at, f in zip(places, m.loads[:, 0, :3], strict=True)]
    return moment_of(np.array(furthest), m)


def facing(truth: Truth, m: Machine) -> Array:
    """Return what a load does that is hooked into the eye that faces it."""
    places = eyes(dict(truth.parameters))
    assert np.linalg.norm(places, axis=1)[:4] == pytest.approx(truth.parameters["away"])
    arms = np.zeros_like(m.loads[..., :3])
    for pose, axes in enumerate(m.axes):
        for step, load in enumerate(m.loads[pose]):
            cosines = [(axes @ at) @ load[:3] / np.linalg.norm(at) for at in places]
            arms[pose, step] = axes @ places[int(np.argmax(cosines))]
    return moment_of(arms, m)


def turned(truth: Truth, m: Machine) -> Array:
    R = np.kron(np.eye(2), Rotation.from_rotvec(vector(truth)).as_matrix())
    return np.asarray(m.loads @ R.T - m.loads)


def mixed(truth: Truth) -> Array:
    return np.array([[truth.parameters[a + b] for b in XYZ] for a in XYZ])


def sensor(truth: Truth, m: Machine) -> Array:
    wrong = m.axes @ mixed(truth) @ np.swapaxes(m.axes, -1, -2)
    parts = np.split(m.loads, 2, axis=-1)
    return np.concatenate([np.einsum("pij,psj->psi", wrong, part) for part in parts], axis=-1)


def crosstalk(truth: Truth, m: Machine) -> Array:
    """Return forces taken for moments as no load beside the tool makes them: a lever's would be odd."""
    matrix = mixed(truth)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-15)
    assert np.trace(matrix) == pytest.approx(0.0, abs=1e-12)
    wrong = m.axes @ matrix @ np.swapaxes(m.axes, -1, -2)
    moment = np.einsum("pij,psj->psi", wrong, m.loads[..., :3])
    return np.concatenate([np.zeros_like(moment), moment], axis=-1)


def size(m: Machine) -> Array:
    return np.asarray(np.linalg.norm(m.loads[..., :3], axis=-1, keepdims=True))


def quadratic(truth: Truth, m: Machine) -> Array:
    return np.asarray(truth.parameters["gain"] * size(m) / truth.parameters["reference"] * m.loads)


def pulley(truth: Truth, m: Machine) -> Array:
    """Return less than read while the load grows, more while it shrinks."""
    growing = np.sign(np.diff(size(m), axis=1, prepend=0.0))
    return np.asarray(-truth.parameters["gain"] * growing * m.loads)


def hanger(truth: Truth, m: Machine) -> Array:
    """Return a weight that is there however much hangs on it, but not where nothing does."""
    return np.asarray(truth.parameters["tare"] * m.loads / np.where(size(m) > 0.0, size(m), np.inf))


def push_pull(truth: Truth, m: Machine) -> Array:
    """Return a gain that is the same either way, even in the load, where all axes are loaded far."""
    own = np.einsum("pji,psj->psi", m.axes, m.loads[..., :3])
    wrong = np.einsum("pij,psj->psi", m.axes, np.abs(own) * vector(truth))
    return np.concatenate([wrong, np.zeros_like(wrong)], axis=-1)


def rope(truth: Truth, m: Machine) -> Array:
    """Return a pull towards a pulley that is set out for the middle of the range, and stays."""
    middle = tcp_places(m.robot, np.array([v.limits for v in m.robot.actuated]).mean(axis=1)[None])[0]
    reach, force = np.linalg.norm(middle), m.loads[:, 0, :3]
    way = force / size(m)[:, 0]
    at = middle + reach * vector(truth) + reach / truth.parameters["angle"] * way
    way = at - tcp_places(m.robot, m.q)
    wrong = np.zeros_like(m.loads)
    wrong[:, 0, :3] = size(m)[:, 0] * way / np.linalg.norm(way, axis=1, keepdims=True) - force
    return wrong


def discs(truth: Truth, m: Machine) -> Array:
    """Return the error of the third of six discs, in all states that it hangs in."""
    one = truth.parameters["disc2"] * float(size(m).max()) / 6.0
    hangs = np.arange(7)[:, None] >= 3
    return np.asarray(one * hangs * m.loads / np.where(size(m) > 0.0, size(m), np.inf))


def some(
    factors: Sequence[float], force: float, moments: bool = True, seed: int = 2
) -> Callable[[Array], Array]:
    def loads(axes: Array) -> Array:
        made = random_loads(np.random.default_rng(seed), 6, factors, force=force)
        return made if moments else made * np.repeat([1.0, 0.0], 3)

    return loads


def same_in_all_poses(axes: Array) -> Array:
    made = random_loads(np.random.default_rng(2), 1, np.arange(7) / 6.0, force=20.0)
    return np.tile(120.0 / np.linalg.norm(made[:, -1:, :3], axis=-1, keepdims=True) * made, (6, 1, 1))


def sideways(axes: Array) -> Array:
    return np.tile([15.0, 8.0, 0, 0, 0, 0], (6, 1, 1))


def along_all_axes(axes: Array) -> Array:
    pulled = np.stack([way * 400.0 * axes @ np.ones(3) for way in (1.0, -1.0)], axis=1)
    return np.concatenate([pulled, np.zeros_like(pulled)], axis=-1)


ONE_DISC = {f"disc{i}": 0.12 * (i == 2) for i in range(6)}


@pytest.mark.parametrize(
    ("effect", "form", "size", "changes", "loads", "wrong", "tolerance"),
    [
        ("tool-offset", "wrench", 0.6, {}, some([0.01], 1e3, seed=1), beside, 1e-3),
        ("tool-offset", "shackle", 0.6, {}, some([0.01], 1e3, seed=1), shackle, 2e-2),
        ("tool-offset", "strap", 0.6, {}, sideways, strap, 1e-3),
        ("tool-offset", "eyes", 0.6, {}, some([0.01, -0.01], 1e3, seed=1), facing, 2e-2),
        ("load-error", "direction", 0.05, {}, some([0.3, 1.0, 0.6], 20.0), turned, 1e-3),
        ("load-error", "sensor", 0.05, {}, some([0.3, 1.0, 0.6], 20.0), sensor, 1e-3),
        ("load-error", "quadratic", 0.05, {}, some([0.3, 1.0, 0.6], 20.0), quadratic, 1e-3),
        ("load-error", "pulley", 0.05, {}, some([0.3, 1.0, 0.6], 20.0), pulley, 1e-3),
        ("load-error", "hanger", 0.05, {}, some([0.0, 0.3, 1.0], 20.0, False), hanger, 2e-3),
        ("load-error", "push-pull", 0.05, {}, along_all_axes, push_pull, 2e-2),
        ("load-error", "crosstalk", 0.3, {}, some([0.5, 1.0], 20.0), crosstalk, 1e-3),
        ("load-error", "rope", 0.7, {}, some([1.0], 20.0, False), rope, 2e-3),
        ("load-error", "discs", 0.7, ONE_DISC, same_in_all_poses, discs, 5e-3),
    ],
)
def test_the_machine_moves_by_the_difference_of_the_loads(
    effect: str,
    form: str,
    size: float,
    changes: dict[str, float],
    loads: Callable[[Array], Array],
    wrong: Callable[[Truth, Machine], Array],
    tolerance: float,
) -> None:
    robot, q, C = serial()
    truth = changed(drawn(robot, effect, None, form, size=size), **changes)
    axes = tcp_axes(robot, q)
    machine = Machine(robot, q, axes, loads(axes))
    expected = linear(C, wrong(truth, machine))
    found = more(robot, campaign_of(robot, q, machine.loads), truth)
    np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max())


def test_a_gain_that_differs_from_push_to_pull_is_even_in_small_loads_too() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "load-error", None, "push-pull", size=0.05)
    loads = some([1.0, -1.0], 20.0, False)(tcp_axes(robot, q))
    found = more(robot, campaign_of(robot, q, loads), truth).reshape(6, 2, 6)
    np.testing.assert_allclose(found[:, 0], found[:, 1], atol=2e-3 * np.abs(found).max())


def test_a_sensors_error_holds_no_equal_gain_which_would_be_a_softer_machine() -> None:
    truth = drawn(load_robot("kr240-2"), "load-error", None, "sensor")
    assert np.trace(mixed(truth)) == pytest.approx(0.0, abs=1e-15)


def test_a_strap_that_pulls_straight_down_has_no_lever() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "tool-offset", None, "strap", size=0.6)
    down = np.tile([0, 0, -20.0, 0, 0, 0], (6, 1, 1))
    np.testing.assert_allclose(more(robot, campaign_of(robot, q, down), truth), 0.0, atol=1e-12)


def test_a_reflector_beside_the_tool_swings_with_it() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "target", size=0.6)
    loads = random_loads(np.random.default_rng(1), 6, [0.01])
    away = tcp_axes(robot, q) @ vector(truth, "uvw")
    found = more(robot, campaign_of(robot, q, loads), truth)
    expected = np.cross(linear(C, loads)[:, 3:], away)
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-3 * np.abs(expected).max())
    np.testing.assert_allclose(found[:, 3:], 0.0, atol=1e-14)


def test_a_sling_lies_elsewhere_in_every_pose_but_there_for_all_of_its_loads() -> None:
    robot, q, C = serial()
    truth = drawn(robot, "tool-offset", None, "rehung", size=0.6)
    p = truth.parameters
    loads = np.tile(20.0 * np.eye(3, 6), (6, 1, 1))
    found = more(robot, campaign_of(robot, q, loads), truth).reshape(6, 3, 6)
    places = []
    for pose in range(6):  # the moment of each force, found by the rotation that it adds
        made = np.linalg.solve(C[pose], found[pose].T).T[:, 3:] / 20.0
        np.testing.assert_allclose(made, -made.T, atol=2e-2 * np.abs(made).max())  # that of one arm
        places.append(tcp_axes(robot, q)[pose].T @ np.array([made[1, 2], made[2, 0], made[0, 1]]))
    away = p["scatter"] * p["away"]
    assert np.linalg.norm(np.mean(places, axis=0) - p["away"] * vector(truth)) < 3.0 * away
    assert 0.2 * away < np.std(places, axis=0).max() < 3.0 * away
    later = campaign_of(robot, q[3:], loads[3:], pose=np.repeat(np.arange(3, 6), 3))
    np.testing.assert_allclose(more(robot, later, truth), found[3:].reshape(-1, 6), atol=1e-12)
