"""The tool on a cantilever: exact elastica, small deflections, friction, and where there is no answer."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.corotational import at_ratio, contact, straight, under_load
from beamstiff.errors import BeamstiffError
from beamstiff.se3 import Array, transform
from benchmarks.elastica import follower_tip


@pytest.mark.parametrize("friction", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("load", [0.05, 0.5, 2.0, 5.0, 8.0])
def test_the_corotational_beam_is_the_elastica(load: float, friction: float) -> None:
    bent = under_load(straight(), load, friction)
    np.testing.assert_allclose(bent.nodes[-1], follower_tip(load, friction), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("load", "friction"), [(0.5, 0.0), (3.0, 0.2)])
def test_the_elastica_solves_its_differential_equation(load: float, friction: float) -> None:
    x, y, slope = follower_tip(load, friction)
    pull = load * np.hypot(1.0, friction)
    toward = slope + np.pi / 2 - np.arctan(friction)

    def rates(_: float, state: Array) -> list[float]:
        theta, curvature, *_ = state
        return [curvature, pull * np.sin(theta - toward), np.cos(theta), np.sin(theta)]

    back = solve_ivp(rates, (1.0, 0.0), [slope, 0.0, x, y], rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(back[[0, 2, 3]], 0.0, atol=1e-9)


def test_elements_converge_with_their_fourth_power() -> None:
    exact = np.array(follower_tip(3.0))
    errors = [np.abs(under_load(straight(n), 3.0).nodes[-1] - exact).max() for n in (4, 8, 16)]
    assert errors[0] / errors[1] > 12
    assert errors[1] / errors[2] > 12


@pytest.mark.parametrize("friction", [-0.2, 0.0, 0.2])
def test_the_table_is_the_beam_itself(friction: float) -> None:
    for ratio in (0.01, 0.137, 0.4, 0.77):
        beam = under_load(straight(), 3 * ratio * 0.5, friction)
        direct = at_ratio(beam, ratio, friction)
        found = contact(np.array([1.0]), np.array([ratio]), friction)
        x, _, slope = direct.nodes[-1]
        np.testing.assert_allclose(found.length, 1 / x, rtol=1e-8)
        np.testing.assert_allclose(found.normal * found.length**2, direct.load, rtol=1e-8)
        np.testing.assert_allclose(found.slope, slope, rtol=1e-7)


def test_both_theories_agree_where_deflections_are_small() -> None:
    found = contact(np.array([0.5]), np.array([1e-6]))
    np.testing.assert_allclose(found.normal, 3 * 1e-6 / 0.5**3, rtol=1e-6)
    np.testing.assert_allclose(found.slope, 1.5 * 1e-6 / 0.5, rtol=1e-6)


def along(x: Array, depth: Array, turn: Array | None = None) -> tuple[Cantilever, ToolPath]:
    """Return the beam of the paper somewhere in space, and a path on it."""
    clamp = transform(np.eye(3) if turn is None else turn, np.array([1.0, -0.3, 0.8]))
    local = np.tile(np.eye(4), (len(x), 1, 1))
    local[:, 0, 3], local[:, 2, 3] = x, -np.asarray(depth)
    names = tuple(f"P{at}" for at in range(len(x)))
    path = ToolPath("p", names, np.arange(len(x)), clamp @ local, np.zeros(len(x), dtype=np.bool_))
    return Cantilever(0.585, 0.05, 0.014, 69e9, clamp), path


def with_(beam: Cantilever, **change: object) -> Cantilever:
    from dataclasses import replace

    return replace(beam, **change)


def test_euler_and_bernoullis_force() -> None:
    beam, path = along(np.array([0.4]), np.array([0.025]))
    force = with_(beam, method="euler-bernoulli").wrench(path.poses, path)[0]
    inertia = 0.05 * 0.014**3 / 12
    np.testing.assert_allclose(force, [0, 0, 3 * 69e9 * inertia * 0.025 / 0.4**3, 0, 0, 0])


def test_the_incremental_force_is_normal_to_the_beam_and_keeps_the_moment_at_the_clamp() -> None:
    beam, path = along(np.array([0.385]), np.array([0.025]))
    fx, _, fz = beam.wrench(path.poses, path)[0, :3]
    found = contact(np.array([0.385]), np.array([0.025]))
    assert np.tan(found.slope[0]) == pytest.approx(fx / fz, rel=1e-12)
    # the beam's tip energy: work done by the force over all deflections is the strain energy, its derivative
    # by the deflection (the tool moves square to the undeformed beam) the vertical force
    h = 1e-6
    energies = [strain_energy(beam, 0.385, 0.025 + step) for step in (-h, h)]
    assert (energies[1] - energies[0]) / (2 * h) == pytest.approx(fz, rel=1e-5)
    across = [strain_energy(beam, 0.385 + step, 0.025) for step in (-h, h)]
    assert -(across[1] - across[0]) / (2 * h) == pytest.approx(fx, rel=1e-4)


def strain_energy(beam: Cantilever, x: float, depth: float) -> float:
    """Return the bending energy of the exact elastica under the tool, by integrating its curvature."""
    found = contact(np.array([x]), np.array([depth]))
    length, load = found.length[0], found.normal[0] * found.length[0] ** 2
    _, _, slope = follower_tip(load)
    toward = slope + np.pi / 2

    def rates(_: float, state: Array) -> list[float]:
        theta, curvature, _ = state
        return [curvature, load * np.sin(theta - toward), 0.5 * curvature**2]

    energy = -solve_ivp(rates, (1.0, 0.0), [slope, 0.0, 0.0], rtol=1e-12, atol=1e-14).y[2, -1]
    return float(energy * beam.bending_stiffness / length)


def test_friction_points_against_the_way_the_tool_came() -> None:
    beam, path = along(np.array([0.5, 0.45, 0.45, 0.48]), np.full(4, 0.02))
    free = beam.wrench(path.poses, path)
    rough = with_(beam, method="euler-bernoulli", friction=0.2).wrench(path.poses, path)
    np.testing.assert_allclose(rough[:, 0] / rough[:, 2], [0.0, 0.2, 0.0, -0.2], atol=1e-12)
    large = with_(beam, friction=0.2).wrench(path.poses, path)
    # on the bent beam the force stands at the angle of friction to the normal
    angle = np.arctan2(large[:, 0], large[:, 2])
    slope = np.arctan2(free[:, 0], free[:, 2])
    np.testing.assert_allclose(angle - slope, np.arctan([0.0, 0.2, 0.0, -0.2]), atol=2e-3)


def test_a_turned_beam_turns_its_forces() -> None:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec([0.3, -1.0, 0.7]).as_matrix()
    upright, path = along(np.array([0.5, 0.4]), np.array([0.01, 0.025]))
    turned, other = along(np.array([0.5, 0.4]), np.array([0.01, 0.025]), turn)
    force = upright.wrench(path.poses, path)[:, :3]
    np.testing.assert_allclose(turned.wrench(other.poses, other)[:, :3], force @ turn.T, rtol=1e-11)


def test_above_the_beam_nothing_acts() -> None:
    beam, path = along(np.array([0.4, 2.0]), np.array([-1e-3, -0.5]))
    assert not beam.wrench(path.poses, path).any()


@pytest.mark.parametrize(
    ("x", "depth", "message"),
    [
        (0.6, 0.01, "P0: the tool is beyond the free end"),
        (0.585, 0.025, "P0: the tool slips off the beam: it would touch at 585.6 mm of 585 mm"),
        (-0.1, 0.01, "P0: the tool is behind the clamp"),
        (0.1, 0.09, "P0: the tool bends the beam too far"),
    ],
)
def test_where_there_is_no_beam_there_is_no_force(x: float, depth: float, message: str) -> None:
    beam, path = along(np.array([x]), np.array([depth]))
    with pytest.raises(BeamstiffError, match=message):
        beam.wrench(path.poses, path)


def test_beside_the_beam_is_refused() -> None:
    beam, path = along(np.array([0.4]), np.array([0.01]))
    tool = path.poses.copy()
    tool[:, 1, 3] += 0.03
    with pytest.raises(BeamstiffError, match="is beside the beam, at x 400, y 30"):
        beam.wrench(tool, path)
