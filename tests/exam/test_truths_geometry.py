"""Wrong geometry and payload, of all authors: against the library's kinematics of another robot."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from beamstiff import compile_structure, load_robot
from beamstiff.exam.campaign import Array
from beamstiff.exam.robots import with_payload
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.robot.kinematics import compile_kinematics, posture
from tests.exam.campaigns import campaign_of, changed, drawn, random_loads, random_poses, read, without_weight
from tests.exam.kr240 import STILL, more, seen_at, serial, tcp_axes, tcp_places, vector, with_errors

Parameters = Mapping[str, float]


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
@pytest.mark.parametrize("form", ["single", "eccentric", "crooked", "oval"])
def test_an_encoders_error_moves_the_tool_as_the_angle_does(name: str, form: str) -> None:
    robot = without_weight(load_robot(name))
    variable = robot.actuated[1]
    q = random_poses(robot, np.random.default_rng(22), 5)
    truth = drawn(robot, "geometry-error", variable.name, form)
    p, angle, moved = truth.parameters, q[:, 1], q.copy()
    wave = {
        "single": 0.0,
        "eccentric": p.get("runout", 0.0) * np.sin(angle + p.get("phase", 0.0)),
        "crooked": p.get("scale", 0.0) * (angle - np.mean(variable.limits)),
        "oval": p.get("oval", 0.0) * np.sin(2.0 * angle + p.get("phase", 0.0)),
    }[form]
    moved[:, 1] += p["error"] + wave
    if form in ("eccentric", "oval"):  # an offset first of all
        assert max(p.get("runout", 0.0), p.get("oval", 0.0)) < abs(p["error"])
    tolerance = 1e-10 if form == "single" else 1e-9
    np.testing.assert_allclose(seen_at(robot, q, truth), tcp_places(robot, moved), atol=tolerance)


@pytest.mark.parametrize("component", ["f3.d", "f2.alpha", "f4.r"])
def test_an_error_of_a_frame_moves_the_tool_as_the_library_moves_it(component: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", component, "single")
    found = seen_at(robot, q, truth)
    expected = tcp_places(with_errors(robot, {component: truth.parameters["error"]}), q)
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert np.abs(found - tcp_places(robot, q)).max() > 1e-4


@pytest.mark.parametrize("form", ["eccentric", "crooked", "tolerances"])
def test_a_frames_error_comes_with_far_smaller_ones(form: str) -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", "f3.d", form)
    p = dict(truth.parameters)
    error, runout, phase = p.pop("error"), p.pop("runout", 0.0), p.pop("phase", 0.0)
    errors = {"f3.d": error} | {name if "." in name else f"f3.{name}": value for name, value in p.items()}
    moved = q + np.array([p.get(v.name, 0.0) for v in robot.actuated])
    moved[:, 2] += runout * np.sin(q[:, 2] + phase)
    found = seen_at(robot, q, truth)
    np.testing.assert_allclose(found, tcp_places(with_errors(robot, errors), moved), atol=1e-9)
    only = drawn(robot, "geometry-error", "f3.d", "single")
    assert only.parameters["error"] == pytest.approx(error)
    alone = seen_at(robot, q, only)
    rest, named = np.abs(found - alone).max(), np.abs(alone - tcp_places(robot, q)).max()
    assert 0.0 < rest < (0.8 if form == "tolerances" else 0.7) * named


def test_geometry_hardly_shows_in_displacement() -> None:
    robot, q, _ = serial()
    truth = drawn(robot, "geometry-error", "f3.d", "single")
    loads = random_loads(np.random.default_rng(0), 6, [1.0])
    seen = np.abs(more(robot, campaign_of(robot, q, loads), truth)[:, :3]).max()
    absolute = np.abs(more(robot, campaign_of(robot, q, loads, kind="absolute"), truth)[:, :3]).max()
    assert seen < 1e-2 * absolute


# --- payload


@pytest.mark.parametrize("form", ["mass", "centre", "both"])
def test_a_wrong_payload_is_another_payload(form: str) -> None:
    robot = with_payload(load_robot("kr240-2"), 100.0, (0.05, 0.0, 0.1))
    truth = drawn(robot, "payload-error", None, form)
    mass, away = truth.parameters["mass"], vector(truth)
    carried = next(m for m in robot.masses if m.node == robot.tcp)
    at = tuple((np.array(carried.at) + away).tolist())
    other = carried.model_copy(update={"mass": carried.mass + mass, "at": at})
    masses = (*(m for m in robot.masses if m.node != robot.tcp), other)
    q = random_poses(robot, np.random.default_rng(23), 4)
    campaign = campaign_of(robot, q, STILL, kind="absolute")
    expected = read(robot.model_copy(update={"masses": masses}), campaign)
    np.testing.assert_allclose(read(robot, campaign, truth), expected, atol=1e-12)
    # and by linear theory: the weight's difference on the unloaded machine's compliance
    C = tcp_compliance(compile_structure(robot), posture(compile_kinematics(robot), q))
    axes, g = tcp_axes(robot, q), np.array(robot.gravity)
    moment = [m.mass * np.cross(axes @ np.array(m.at), g) for m in (other, carried)]
    wrench = np.concatenate([np.tile(mass * g, (4, 1)), moment[0] - moment[1]], axis=1)
    linear = np.einsum("pij,pj->pi", C, wrench)[:, :3]
    np.testing.assert_allclose(more(robot, campaign, truth)[:, :3], linear, atol=0.03 * np.abs(linear).max())


def hose(p: Parameters, axis: Array, down: Array, height: float) -> tuple[float, Array]:
    """Return what the tool has lifted of a hose."""
    return max(p["per_metre"] * (height - p["low"]), 0.0), np.zeros(3)


def slid(p: Parameters, axis: Array, down: Array, height: float) -> tuple[float, Array]:
    return p["mass"], (p["away"] + p["slides"] * float(axis @ down)) * axis


def run(along: float, p: Parameters) -> float:
    return float(p["half"] * along / np.hypot(along, p["tilt"]))


def rolled(p: Parameters, axis: Array, down: Array, height: float) -> tuple[float, Array]:
    return p["mass"], (p["along"] + run(axis @ down, p)) * axis


def flowed(p: Parameters, axis: Array, down: Array, height: float) -> tuple[float, Array]:
    """Return where a liquid's middle is: each of the two ways across by itself."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across = across / np.linalg.norm(across)
    sides = (across, np.cross(axis, across))
    return p["mass"], sum((run(side @ down, p) * side for side in sides), p["along"] * axis)


@pytest.mark.parametrize(
    ("form", "changes", "there", "tolerance"),
    [
        ("hose", {"x": 1.0, "y": 0.0, "z": 0.0}, hose, 0.0),
        ("loose", {"mass": 10.0}, slid, 2e-3),
        ("rolling", {"mass": 10.0}, rolled, 3e-3),
        ("liquid", {"mass": 10.0}, flowed, 3e-3),
    ],
)
def test_what_moves_at_the_tool_weighs_where_it_has_gone(
    form: str,
    changes: dict[str, float],
    there: Callable[[Parameters, Array, Array, float], tuple[float, Array]],
    tolerance: float,
) -> None:
    robot = with_payload(load_robot("kr240-2"), 50.0, (0.05, 0.0, 0.1))
    truth = changed(drawn(robot, "payload-error", None, form), **changes)
    q = random_poses(robot, np.random.default_rng(23), 4)
    down = tcp_axes(robot, q).transpose(0, 2, 1) @ np.array(robot.gravity) / 9.81
    for pose, way, height in zip(q, down, tcp_places(robot, q)[:, 2], strict=True):
        mass, at = there(truth.parameters, vector(truth), way, float(height))
        campaign = campaign_of(robot, pose[None], STILL, kind="absolute")
        expected = read(with_payload(robot, mass, tuple(at.tolist())), campaign)
        added = np.abs(expected - read(robot, campaign)).max()
        np.testing.assert_allclose(read(robot, campaign, truth), expected, atol=tolerance * added + 1e-12)
