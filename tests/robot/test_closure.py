"""Closed loops, against closed forms of the papers and textbooks; branches; what cannot close."""

import re

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from beamstiff import BeamstiffError, Frame, Loop, Node, Robot
from beamstiff.robot.closure import GRID, assembly_doubts, close_loops
from beamstiff.robot.frames import Kinematics
from beamstiff.robot.kinematics import compile_kinematics, posture, posture_at, twist_jacobian
from beamstiff.robot.loops import loop_equations, loop_system, recorded
from beamstiff.robot.reader import load_robot
from tests.robot.machines import (
    BENNETT,
    D3,
    D9,
    D10,
    D11,
    KAPPA2,
    L12,
    L32,
    LAMBDA2,
    bennett,
    four_bar,
    four_bar_points,
    four_bar_th3,
    ir663,
    machine,
    revolute,
    screw_driven_ir663,
    slider_crank,
    slider_crank_theta2,
    telescope,
)

Array = NDArray[np.float64]

LOW, HIGH = np.radians([-180, -40, 20]), np.radians([180, 50, 75])
FOUR_BAR = ir663()


def value(kinematics: Kinematics, values: Array, name: str) -> Array:
    """Return one variable at every pose."""
    return values[:, kinematics.coupling.names.index(name)]


def apart(a: Array, b: Array) -> Array:
    """Return how far angles differ, whole turns aside."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def gap_between(kinematics: Kinematics, q: Array, a: str, b: str) -> float:
    """Return the largest distance of two nodes, m."""
    places = posture(kinematics, q).node_positions
    a_at, b_at = (kinematics.node_index[name] for name in (a, b))
    return float(np.linalg.norm(places[:, a_at] - places[:, b_at], axis=1).max())


@pytest.mark.parametrize(
    ("robot", "branch"),
    [
        (FOUR_BAR, 1),
        (ir663(a="f11", b="f10"), 1),
        (ir663(a="p10", b="p11"), 1),
        (ir663(constrain="plane"), 1),
        (ir663(a="p11", b="f10", constrain="plane"), 1),
        (ir663(constrain="pose", th10=-2.0), 1),
        (ir663(th3=-2.7, th9=-1.0), -1),
    ],
    ids=["position", "ends swapped", "nodes", "plane", "node in plane", "pose", "other guess"],
)
def test_four_bar_angle_is_the_corrected_closed_form(robot: Robot, branch: int) -> None:
    q = np.random.default_rng(0).uniform(LOW, HIGH, (2000, 3))
    kinematics = compile_kinematics(robot)
    th3 = value(kinematics, posture(kinematics, q).values, "th3")
    # the paper's x3 points along the lever, 90 deg from frame 3 of its table 1
    assert apart(th3 + np.pi / 2, four_bar_th3(q[:, 1], q[:, 2], branch)).max() < 1e-12
    assert gap_between(kinematics, q, "p10", "p11") < 1e-12


@pytest.mark.parametrize(("phi", "psi", "branch"), [(3.0, -2.7, 1), (-0.6, 2.7, -1)])
def test_slider_crank_angle_is_the_corrected_closed_form(phi: float, psi: float, branch: int) -> None:
    screw = np.random.default_rng(0).uniform(L32 - L12 + 0.01, L12 + L32 - 0.01, 2000)
    kinematics = compile_kinematics(slider_crank(phi, psi))
    values = posture(kinematics, screw[:, None]).values
    theta2, crank = value(kinematics, values, "theta2"), value(kinematics, values, "phi")
    assert apart(theta2, slider_crank_theta2(screw, branch)).max() < 1e-12
    assert apart(theta2, KAPPA2 - crank + np.pi / 2).max() < 1e-12
    # law of cosines: the angle between the crank and the pivot, which lies at pi + (pi/2 - lambda2)
    expected = (L12**2 + L32**2 - screw**2) / (2 * L12 * L32)
    assert np.abs(np.cos(crank - (np.pi + np.pi / 2 - LAMBDA2)) - expected).max() < 1e-12


def test_three_loops_at_once() -> None:
    """Both screws follow the law of cosines, and the four-bar between them its closed form."""
    kinematics = compile_kinematics(screw_driven_ir663())
    q = np.random.default_rng(0).uniform([0.7, 0.75], [1.1, 0.95], (3000, 2))
    values, closed, _ = close_loops(kinematics, q, strict=False)
    assert closed.mean() > 0.9
    q2, q8, th3 = (value(kinematics, values[closed], name) for name in ("q2", "q8", "th3"))
    crank = 0.4**2 + 0.8**2 + 2 * 0.4 * 0.8 * np.sin(q2)
    assert np.abs(crank - q[closed, 0] ** 2).max() < 1e-12
    crank = 0.3**2 + 0.7**2 + 2 * 0.3 * 0.7 * np.cos(q8)
    assert np.abs(crank - q[closed, 1] ** 2).max() < 1e-12
    # each screw keeps to its side of its dead centre
    assert (np.abs(q2) < np.pi / 2).all()
    assert ((q8 > 0) & (q8 < np.pi)).all()
    assert apart(th3 + np.pi / 2, four_bar_th3(q2, q8, branch=1)).max() < 1e-12
    # the rest cannot close: the crank and the arm are too far apart
    q2 = np.arcsin((q[~closed, 0] ** 2 - 0.4**2 - 0.8**2) / (2 * 0.4 * 0.8))
    q8 = np.arccos((q[~closed, 1] ** 2 - 0.3**2 - 0.7**2) / (2 * 0.3 * 0.7))
    distance = np.linalg.norm(np.subtract(*four_bar_points(q2, q8)), axis=1)
    assert (distance > D10 + D11).all()


@pytest.mark.parametrize(("phi", "psi", "branch"), [(3.0, -2.7, 1), (-0.6, 2.7, -1)])
def test_loops_that_were_nearly_closed_close_in_their_branch(phi: float, psi: float, branch: int) -> None:
    screw = np.linspace(L32 - L12 + 0.02, L12 + L32 - 0.02, 50)
    kinematics = compile_kinematics(slider_crank(phi, psi))
    before = close_loops(kinematics, screw[:, None] - 2e-3).values
    theta2 = value(kinematics, close_loops(kinematics, screw[:, None], near=before).values, "theta2")
    assert apart(theta2, slider_crank_theta2(screw, branch)).max() < 1e-12


def test_a_loop_in_space_that_only_moves_by_its_proportions() -> None:
    """Bennett 1903: opposite angles are alike, and tan(q1/2) tan(t2/2) = sin((b+a)/2) / sin((b-a)/2)."""
    _, alpha, beta = BENNETT
    expected = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (500, 1))
    q1, t2, t3, t4 = posture(compile_kinematics(bennett([-2.0, 0.0, -3.0])), q).values.T
    assert np.abs(np.tan(q1 / 2) * np.tan(t2 / 2) / expected - 1.0).max() < 1e-11
    assert apart(q1, -t3).max() < 1e-12
    assert apart(t2, -t4).max() < 1e-12


@settings(max_examples=12)
@given(st.tuples(*[st.floats(0.2, 2.0)] * 4), st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.floats(-3.0, 3.0))
def test_random_four_bars_in_random_planes_close_or_cannot(
    lengths: tuple[float, ...], plane: tuple[float, ...], q1: float
) -> None:
    """A four-bar (crank, coupler, rocker, ground) closes where the triangle on its diagonal does."""
    crank, coupler, rocker, ground = lengths
    frame = Frame(name="plane", gamma=plane[0], alpha=plane[1], theta=plane[2], r=0.3)
    robot = four_bar(crank, rocker, (1.0, 2.0), coupler, ground, frame)
    try:
        kinematics = compile_kinematics(robot)
    except BeamstiffError as error:  # has its own test
        assume("equally near" not in str(error))
        raise
    diagonal = np.hypot(ground - crank * np.cos(q1), crank * np.sin(q1))
    slack = min(coupler + rocker - diagonal, diagonal - abs(coupler - rocker))
    values, (closed,), _ = close_loops(kinematics, np.array([[q1]]), strict=False)
    assert closed or slack < 1e-6
    if slack < -1e-6:
        assert not closed
    if closed:
        places = posture_at(kinematics, values).node_positions[0, 1:]
        assert np.linalg.norm(places[0] - places[1]) < 1e-11


def test_the_branch_never_flips_over_ten_thousand_poses() -> None:
    # further than the limits, where many poses do not close and the coupler and the lever nearly align
    q = np.random.default_rng(1).uniform(
        np.radians([-180, -60, -20]), np.radians([180, 120, 140]), (10_000, 3)
    )
    p3, p9 = four_bar_points(q[:, 1], q[:, 2])
    distance = np.linalg.norm(p3 - p9, axis=1)
    possible = (distance < D10 + D11) & (distance > D11 - D10)
    kinematics = compile_kinematics(FOUR_BAR)
    values, closed, reasons = close_loops(kinematics, q, strict=False)
    assert 0.5 < possible.mean() < 0.95
    assert (closed == possible).all()
    assert [bool(reason) for reason in reasons] == (~closed).tolist()
    assert np.isnan(value(kinematics, values, "th3")[~closed]).all()
    assert np.isfinite(values[closed]).all()
    th3 = value(kinematics, values, "th3")[closed]
    expected = four_bar_th3(q[closed, 1], q[closed, 2], branch=1)
    other = four_bar_th3(q[closed, 1], q[closed, 2], branch=-1)
    # the square root of the closed form itself loses digits where the branches meet
    assert (apart(th3 + np.pi / 2, expected) < 1e-12 / np.minimum(1.0, apart(expected, other))).all()


def test_the_branch_holds_along_a_path_that_nearly_folds_the_lever_on_the_coupler() -> None:
    # past the end of what closes, at 1e-6 of the length from the folded posture
    q8 = np.linspace(0.6, 1.1, 401)
    nearly = (D11 - D10) * (1 + 1e-6 + 0.5 * (q8 - 0.85) ** 2)
    # |P3 - P9|^2 = D3^2 + D9^2 - 2 D3 D9 sin(q2 - q8)
    q2 = q8 + np.arcsin((D3**2 + D9**2 - nearly**2) / (2 * D3 * D9))
    path = np.stack([np.zeros_like(q8), q2, q8], axis=1)
    p3, p9 = four_bar_points(q2, q8)
    assert np.abs(np.linalg.norm(p3 - p9, axis=1) - nearly).max() < 1e-12
    kinematics = compile_kinematics(FOUR_BAR)
    th3 = value(kinematics, posture(kinematics, path).values, "th3") + np.pi / 2
    expected, other = (four_bar_th3(q2, q8, branch=branch) for branch in (1, -1))
    assert 1e-3 < apart(expected, other).min() < 1e-2
    assert (apart(th3, expected) < 1e-8 * apart(expected, other)).all()


def test_a_pose_that_cannot_close_is_named_with_what_remains() -> None:
    kinematics = compile_kinematics(FOUR_BAR)
    q = np.tile([0.3, 0.1, 0.8], (20, 1))
    q[17] = [0.3, 1.2, 0.2]
    with pytest.raises(BeamstiffError) as error:
        posture(kinematics, q)
    message = str(error.value)
    assert "\n" not in message
    start = "loop 'four_bar' cannot close at q2 = 1.2 rad, q8 = 0.2 rad (pose 17): "
    assert message.startswith(start)
    found = re.fullmatch(r"([\d.]+) mm remain between 'f10' and 'f11'", message.removeprefix(start))
    assert found
    # no posture of the passive joints comes closer: P3 and P9 are too near for coupler and lever, or too far
    distance = np.linalg.norm(np.subtract(*four_bar_points(q[17:18, 1], q[17:18, 2])))
    remains = max(D11 - D10 - distance, distance - D10 - D11)
    assert float(found[1]) == pytest.approx(1e3 * remains, rel=0.05)


def test_of_several_loops_the_open_one_is_named() -> None:
    kinematics = compile_kinematics(screw_driven_ir663())
    with pytest.raises(BeamstiffError, match=r"loop 'screw8' cannot close .*between 'e8' and 'nut8'"):
        posture(kinematics, {"r2": 0.9, "r8": 1.05})
    with pytest.raises(BeamstiffError, match=r"loop 'screw2' cannot close .*between 'e2' and 'nut2'"):
        posture(kinematics, {"r2": 1.5, "r8": 0.85})


def test_an_open_pose_loop_tells_its_gap_in_both_units() -> None:
    kinematics = compile_kinematics(ir663(constrain="pose", th10=-2.0))
    with pytest.raises(BeamstiffError, match=r"[\d.]+ mm and [\d.e-]+ rad remain"):
        posture(kinematics, {"q2": 1.2, "q8": 0.2})


def test_a_dead_centre_leaves_the_passive_joints_undetermined() -> None:
    kinematics = compile_kinematics(slider_crank())
    for off in (0.0, 1e-15, 1e-13):
        with pytest.raises(
            BeamstiffError,
            match=r"loop 'slider_crank' leaves .*phi.* undetermined at screw = 1.25 m \(pose 1\)",
        ):
            posture(kinematics, [[1.0], [L12 + L32 - off]])
    twist_jacobian(kinematics, posture(kinematics, [L12 + L32 - 1e-8]), "tool")


def test_a_universal_joint_in_line_with_its_leg_is_no_dead_centre() -> None:
    """Turning about the leg moves nothing: its angles are anything, the posture is good."""
    robot = machine(
        [revolute("q"), *(revolute(name, passive=True) for name in "uvw")],
        [
            Frame(name="drive", theta="q"),
            Frame(name="first", theta="u"),
            Frame(name="second", parent="first", alpha="v", theta="w"),
        ],
        tool=("second", (0.3, 0, 0)),
        loops=[Loop(name="spherical", a="drive", b="second", constrain="pose")],
        nodes=[],
    )
    q = np.array([[0.0], [0.3], [-2.0]])
    closure = close_loops(compile_kinematics(robot), q)
    assert closure.closed.all()
    assert np.abs(closure.values[:, 1] + closure.values[:, 3] - q[:, 0]).max() < 1e-9


def test_a_passive_variable_that_no_loop_determines_is_refused() -> None:
    robot = machine(
        [
            revolute("q1"),
            revolute("t2", passive=True),
            revolute("t3", passive=True),
            revolute("idle", passive=True),
        ],
        [
            Frame(name="crank", theta="q1"),
            Frame(name="coupler", parent="crank", d=0.3, theta="t2"),
            Frame(name="rocker", d=1.0, theta="t3"),
            Frame(name="wheel", parent="rocker", d=0.5, theta="idle"),
        ],
        tool=("wheel", (0.1, 0, 0)),
        loops=[Loop(name="four_bar", a="end", b="wheel", constrain="position")],
        nodes=[Node(name="end", frame="coupler", at=(0.9, 0, 0))],
    )
    with pytest.raises(
        BeamstiffError, match="the passive variables idle are not determined by its loops four_bar"
    ):
        compile_kinematics(robot)


def test_a_loop_that_holds_an_actuated_joint_is_refused() -> None:
    values = posture(compile_kinematics(FOUR_BAR), [0.0, 0.1, 0.8]).values
    # the same posture of the same linkage, but with th9 called actuated
    variables = [
        variable.model_copy(update={"passive": False}) if variable.name == "th9" else variable
        for variable in FOUR_BAR.variables
    ]
    held = compile_kinematics(FOUR_BAR.model_copy(update={"variables": tuple(variables)}))
    with pytest.raises(BeamstiffError, match="loop 'four_bar' holds the actuated variable 'th9'"):
        twist_jacobian(held, posture_at(held, values), "tool")


def test_prismatic_passive_joints_close_too() -> None:
    """A passive slide and hinge measure the distance and bearing of a hand moved in polar coordinates."""
    kinematics = compile_kinematics(telescope())
    q = np.random.default_rng(5).uniform([-1.0, -0.5], [1.0, 0.5], (100, 2))
    values = posture(kinematics, q).values
    x, y = (q[:, 1] + 2) * np.cos(q[:, 0]) - 0.7, (q[:, 1] + 2) * np.sin(q[:, 0])
    assert np.abs(value(kinematics, values, "slide") - np.hypot(x, y)).max() < 1e-12
    assert apart(value(kinematics, values, "bearing"), np.arctan2(y, x)).max() < 1e-12


def test_a_guess_that_newton_does_not_close_from_still_finds_its_assembly() -> None:
    # crank and screw nearly in line, pointing away from one another: no small turn of either shortens the gap
    straight = float(np.pi / 2 - LAMBDA2)
    for side in (1, -1):
        kinematics = compile_kinematics(slider_crank(straight + 0.2 * side, psi=-2.9 * side))
        screw = np.linspace(0.6, 1.2, 50)
        phi = value(kinematics, posture(kinematics, screw[:, None]).values, "phi")
        theta2 = value(kinematics, posture(kinematics, screw[:, None]).values, "theta2")
        either = [apart(theta2, slider_crank_theta2(screw, branch)).max() for branch in (1, -1)]
        assert min(either) < 1e-12
        assert (np.sin(phi - straight) * side > 0).all()


@pytest.mark.parametrize("side", [1, -1])
def test_the_assembly_is_the_one_that_comes_nearest_to_the_guess_at_any_posture(side: int) -> None:
    # circles that cut: the end of the coupler, left (1) or right (-1) of the way from crank to rocker's axis
    def closed(q: float) -> tuple[float, float]:
        crank = 0.5 * np.exp(1j * q)
        way = 1.0 - crank
        along = (1.0**2 - 0.8**2 + abs(way) ** 2) / (2 * abs(way))
        end = crank + way / abs(way) * (along + 1j * side * np.sqrt(1.0 - along**2))
        return float(np.angle((end - crank) / np.exp(1j * q))), float(np.angle(end - 1.0))

    for q in np.radians([-150, -70, 60, 170]):
        p, r = closed(q)
        kinematics = compile_kinematics(four_bar(0.5, 0.8, (p + np.radians(6.0), r - np.radians(5.0))))
        for at in np.linspace(-3.0, 3.0, 13):
            found = posture(kinematics, np.array([[at]])).values[0]
            assert apart(found[1:], np.array(closed(float(at)))).max() < 1e-9


def test_a_rival_near_the_guess_is_a_doubt_and_a_far_guess_too_but_not_a_good_one() -> None:
    assert assembly_doubts(compile_kinematics(load_robot("ir663"))) == ()
    near = assembly_doubts(compile_kinematics(slider_crank(float(np.pi / 2 - LAMBDA2) + 0.2, psi=-2.9)))
    assert len(near) == 1
    assert "another assembly is near the guesses too, at phi" in near[0]


def test_the_branch_is_found_where_the_drives_without_limits_do_not_close_at_their_zero() -> None:
    # at r2 = r8 = 0 the screws cannot close
    robot = screw_driven_ir663()
    variables = [variable.model_copy(update={"limits": None}) for variable in robot.variables]
    kinematics = compile_kinematics(robot.model_copy(update={"variables": tuple(variables)}))
    q = np.random.default_rng(0).uniform([0.75, 0.76], [1.05, 0.94], (200, 2))
    expected = posture(compile_kinematics(robot), q).values
    assert np.abs(posture(kinematics, q).values - expected).max() < 1e-12


def test_a_rhombus_closes_beside_its_change_point() -> None:
    """Equal links, the crank nearly on the ground: both passive joints turn about nearly one point."""
    kinematics = compile_kinematics(four_bar(1.0, 1.0, (-1.0, 1.0)))
    places = posture(kinematics, np.array([[1e-6], [1e-4], [1e-2], [0.3]])).node_positions[:, 1:]
    assert np.linalg.norm(places[:, 0] - places[:, 1], axis=1).max() < 1e-11


@pytest.mark.parametrize("name", ["ir663", "ir663-screws", "tripod"])
def test_many_poses_close_as_few_do(name: str) -> None:
    """Many start from a grid and by equations written down, few from the assembly: the same postures."""
    kinematics = compile_kinematics(load_robot(name))
    limits = np.array([variable.limits for variable in kinematics.robot.actuated])
    q = np.random.default_rng(5).uniform(*limits.T, (GRID, len(limits)))
    q[7] = limits[:, 1] + np.ptp(limits, axis=1)  # outside
    together = close_loops(kinematics, q, strict=False)
    apart = [close_loops(kinematics, part, strict=False) for part in np.split(q, 2)]
    assert together.closed.tolist() == [*apart[0].closed, *apart[1].closed]
    expected = np.concatenate([part.values for part in apart])
    turned = np.where(kinematics.prismatic, 0.0, 2 * np.pi)
    away = together.values - expected
    away -= turned * np.round(away / np.where(turned > 0, turned, 1.0))
    assert np.nanmax(np.abs(away)) <= 1e-11
    assert (np.isnan(together.values) == np.isnan(expected)).all()


def test_equations_written_down_are_the_equations() -> None:
    for name in ("ir663", "ir663-screws", "tripod"):
        system = loop_system(compile_kinematics(load_robot(name)))
        free = np.random.default_rng(2).normal(size=(9, len(system.scale)))
        written = recorded(system)
        assert written.program is not None
        for found, expected in zip(loop_equations(written, free), loop_equations(system, free), strict=True):
            assert np.abs(found - expected).max() <= 1e-14
