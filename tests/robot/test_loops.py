"""The closure equations of open loops by finite differences; branches kept where they nearly meet."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from beamstiff.robot.closure import closure_rates
from beamstiff.robot.continuation import continuation
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.loops import loop_equations, loop_system, rotation_vector_rate
from beamstiff.robot.newton import least_squares
from beamstiff.se3 import rotation_from_vector, vector_from_rotation
from tests.robot.machines import (
    D3,
    D9,
    D10,
    D11,
    bennett,
    four_bar_th3,
    ir663,
    screw_driven_ir663,
    slider_crank,
    telescope,
)

Array = NDArray[np.float64]


@pytest.mark.parametrize(
    "robot",
    [
        ir663(),
        ir663(constrain="pose", th10=-2.0),
        ir663(a="p11", b="f10", constrain="plane"),
        slider_crank(),
        screw_driven_ir663(),
        bennett([-2.0, 0.0, -3.0]),
        telescope(),
    ],
    ids=["position", "pose", "plane", "slider-crank", "three loops", "in space", "telescope"],
)
def test_derivatives_hold_where_loops_are_wide_open(robot: Robot) -> None:
    system = loop_system(compile_kinematics(robot))
    # turns of the ends against one another stay below half a turn, where a rotation vector jumps
    free = np.random.default_rng(0).uniform(-0.7, 0.7, (50, len(system.scale)))
    step = 1e-4
    _, jacobian = loop_equations(system, free)
    for column, scale in enumerate(system.scale):
        change = np.zeros(len(system.scale))
        change[column] = step * scale

        def gaps(steps: float, change: Array = change) -> Array:
            return loop_equations(system, free + steps * change)[0]

        difference = (8 * (gaps(1) - gaps(-1)) - (gaps(2) - gaps(-2))) / (12 * step)
        assert np.abs(difference - jacobian[:, :, column]).max() < 1e-9


vectors = st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array)


@given(vectors, vectors)
@example(np.array([6e-3, -4e-3, 3e-3]), np.array([1.0, 2.0, -1.5]))
@example(np.array([1e-2, 1e-3, 0.0]), np.array([1.0, 2.0, -1.5]))
def test_rate_of_a_rotation_vector(vector: Array, spin: Array) -> None:
    step = 1e-4

    def after(time: float) -> Array:
        return vector_from_rotation(rotation_from_vector(time * spin) @ rotation_from_vector(vector))

    difference = (8 * (after(step) - after(-step)) - (after(2 * step) - after(-2 * step))) / (12 * step)
    assert np.abs(difference - rotation_vector_rate(vector) @ spin).max() < 1e-8


def test_least_squares_is_that_of_numpy() -> None:
    random = np.random.default_rng(0)
    matrix, right = random.normal(size=(20, 7, 4)), random.normal(size=(20, 7))
    damping = random.uniform(0, 1, 20)
    found, damped = least_squares(matrix, right), least_squares(matrix, right, damping)
    for pose in range(20):
        expected = np.linalg.lstsq(matrix[pose], right[pose], rcond=None)[0]
        assert np.abs(found[pose] - expected).max() < 1e-13
        more = np.concatenate([matrix[pose], damping[pose] * np.eye(4)])
        expected = np.linalg.lstsq(more, np.concatenate([right[pose], np.zeros(4)]), rcond=None)[0]
        assert np.abs(damped[pose] - expected).max() < 1e-13


def test_rates_of_slides_are_in_metres() -> None:
    """The slide's length is the distance hand to post: its rates are those of a distance."""
    kinematics = compile_kinematics(telescope())
    q = np.random.default_rng(5).uniform([-1.0, -0.5], [1.0, 0.5], (100, 2))
    at = posture(kinematics, q)
    bearing, slide = closure_rates(kinematics, at.values, at.transforms).swapaxes(0, 1)
    r = q[:, 1] + 2
    x, y = r * np.cos(q[:, 0]) - 0.7, r * np.sin(q[:, 0])
    distance = np.hypot(x, y)
    assert np.abs(slide[:, 0] - 0.7 * r * np.sin(q[:, 0]) / distance).max() < 1e-12
    assert np.abs(slide[:, 1] - (x * np.cos(q[:, 0]) + y * np.sin(q[:, 0])) / distance).max() < 1e-12
    assert np.abs(bearing[:, 1] - (x * np.sin(q[:, 0]) - y * np.cos(q[:, 0])) / distance**2).max() < 1e-12


def on_its_branch(th3: Array, q: Array, lever: float = D10) -> bool:
    """Return whether angles are nearer to the closed form's first branch than to its other one."""
    right, wrong = (
        np.abs(np.sin(0.5 * (th3 + np.pi / 2 - four_bar_th3(q[:, 1], q[:, 2], branch, lever))))
        for branch in (1, -1)
    )
    return bool((right < wrong).all())


def test_continuation_keeps_the_branch_up_to_where_branches_nearly_meet() -> None:
    kinematics = compile_kinematics(ir663())
    assembly = kinematics.assembly
    random = np.random.default_rng(0)
    q8 = random.uniform(0.4, 1.2, 2000)
    # the lever folded onto the coupler but for a little
    nearly = (D11 - D10) * (1 + 10 ** random.uniform(-7, -2, 2000))
    q2 = q8 + np.arcsin((D3**2 + D9**2 - nearly**2) / (2 * D3 * D9))
    target = np.stack([np.zeros(2000), q2, q8], axis=1)
    origin = np.repeat(assembly.free[None], 2000, axis=0)
    free, arrived = continuation(loop_system(kinematics), assembly, origin, target)
    # some give up just before the fold; closing in full gets there by other means
    assert arrived.mean() > 0.8
    assert on_its_branch(free[arrived, 3], target[arrived])
    assert on_its_branch(posture(kinematics, target).values[:, 3], target)


def test_continuation_does_not_flip_where_a_line_leaps_over_what_cannot_close() -> None:
    """A lever so long that only a narrow band of poses cannot close: beyond it, both branches go on."""
    lever = D11 - (D3 - D9) - 1e-4
    kinematics = compile_kinematics(ir663(lever=lever))
    assembly = kinematics.assembly
    assert assembly is not None
    # sin(q2 - q8) > 1 - 3e-4 cannot close; the lines lead from one side of it to the other
    random = np.random.default_rng(0)
    q8, across = random.uniform(0.4, 1.2, 500), random.uniform(0.1, 0.8, 500)
    before, after = (
        np.stack([np.zeros(500), q8 + np.pi / 2 + side * across, q8], axis=1) for side in (-1, 1)
    )
    start = posture(kinematics, before).values
    free, arrived = continuation(loop_system(kinematics), assembly, start, after)
    assert on_its_branch(free[arrived, 3], after[arrived], lever)
    assert on_its_branch(posture(kinematics, after).values[:, 3], after, lever)
