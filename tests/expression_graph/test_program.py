"""Programs give what the arithmetic they recorded gives."""

import importlib.util
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.expression_graph.expression import Expression, Op, Recorder, square_root
from beamstiff.expression_graph.graph import WIDTH, ExpressionGraph, compile_graph

WAYS = [False] + [True] * (importlib.util.find_spec("numba") is not None)
compiled = pytest.mark.skipif(len(WAYS) == 1, reason="numba is not installed (extra `fast`)")


def recorded(formula, count: int) -> ExpressionGraph:
    recorder = Recorder()
    outputs = formula(recorder.inputs(count))
    return compile_graph(recorder, count, list(np.asarray(outputs, dtype=object).ravel()))


def messy(x: np.ndarray) -> list:
    """Return all kinds of steps; works on numbers (7, P) and on expressions (7,)."""
    a, b, c, d, e, f, g = x
    twice = a * b + c
    return [
        twice - d * e,
        a * b - c * d,
        -(a + b) * (c - d),
        (twice - twice) + f,
        2.0 - a / (1.0 + b * b),
        3.0 / (2.0 + np.cos(c)) - np.sin(-d),
        np.sqrt(e * e + 1.0) * 0.0 + 0.25 * g,
        -np.sqrt(-(-(f * f) - 2.0)),
        twice * twice,
        a * 1.0 - b * -1.0,
        (a - b) + (b - a),
        1.5 + 0.0 * a,
    ]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("poses", [0, 1, 63, 64, 65, WIDTH - 1, WIDTH + 1, 3000])
def test_all_steps_at_any_number_of_poses(poses: int, way: bool) -> None:
    x = np.random.default_rng(poses).normal(size=(7, poses))
    program = recorded(messy, 7)
    expected = np.array([row * np.ones(poses) for row in messy(x)])
    assert np.abs(program.run(x, way) - expected).max(initial=0.0) <= 1e-14


@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 60))
def test_random_formulas(seed: int, size: int) -> None:
    """Sums, differences and products of what came before, some of them zeros, ones and negatives."""

    def formula(x: np.ndarray) -> list:
        rng = np.random.default_rng(seed)
        pool = [*x, 0.0, 1.0, -1.0, 0.5]
        for _ in range(size):
            p, q = (pool[at] for at in rng.integers(len(pool), size=2))
            pool.append((p + q, p - q, p * q, -p)[rng.integers(4)])
        return pool[7:]

    x = np.random.default_rng(seed).uniform(-1, 1, (3, 5))
    expected = np.array([row * np.ones(5) for row in formula(x)])
    for way in WAYS:
        found = recorded(formula, 3).run(x, way)
        assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()


@compiled
def test_compiled_and_interpreted_are_alike_to_the_last_digits() -> None:
    x = np.random.default_rng(0).normal(size=(7, 2000))
    program = recorded(messy, 7)
    one, other = program.run(x, True), program.run(x, False)
    assert np.abs(one - other).max() <= 1e-15 * np.abs(other).max()
    products = recorded(lambda x: [x[0] * x[1] + x[2], (x[0] - x[1]) / x[2]], 7)
    assert (products.run(x, True) == products.run(x, False)).all()


@compiled
def test_compiled_sine_and_cosine_are_right_to_the_last_digit_but_one() -> None:
    program = recorded(lambda x: [np.sin(x[0]), np.cos(x[0])], 1)
    rng = np.random.default_rng(0)
    near_quarters = np.arange(-500, 500) * (np.pi / 2) * (1 + 1e-15 * rng.normal(size=1000))
    for x in (
        rng.uniform(-7, 7, 10_000),
        rng.uniform(-1e7, 1e7, 10_000),
        near_quarters,
        1e-9 * near_quarters,
    ):
        exact = np.array([np.sin(x.astype(np.longdouble)), np.cos(x.astype(np.longdouble))])
        found = program.run(x[None], True)
        assert (np.abs(found - exact) <= 2 * np.spacing(np.abs(exact.astype(float)))).all()
        assert np.abs((found**2).sum(axis=0) - 1.0).max() <= 1e-15
    odd = np.array([[0.0, -0.0, np.inf, -np.inf, np.nan, 1e300]])
    with np.errstate(invalid="ignore"):
        assert np.array_equal(program.run(odd, True), [np.sin(odd[0]), np.cos(odd[0])], equal_nan=True)
    assert np.signbit(program.run(np.array([[0.0, -0.0]]), True)[0]).tolist() == [False, True]


@pytest.mark.parametrize("way", WAYS)
def test_the_smallest_of_several_is_nan_if_one_is(way: bool) -> None:
    program = recorded(lambda x: [Expression.least(Expression.least(x[0], -x[1]), x[2])], 3)
    x = np.array([[1.0, np.nan, 1.0, 1.0], [2.0, 2.0, np.nan, 2.0], [3.0, 3.0, 3.0, np.nan]])
    assert np.array_equal(program.run(x, way)[0], [-2.0, np.nan, np.nan, np.nan], equal_nan=True)


@pytest.mark.parametrize("way", WAYS)
def test_what_is_no_number_goes_through_without_a_warning(way: bool) -> None:
    program = recorded(lambda x: [1.0 / x[0], square_root(x[0]), x[0] / x[0], square_root(4.0)], 1)
    found = program.run(np.array([[0.0, -1.0]]), way)
    assert np.array_equal(
        found, [[math.inf, -1.0], [0.0, math.nan], [math.nan, 1.0], [2.0, 2.0]], equal_nan=True
    )


def test_known_numbers_cost_nothing() -> None:
    """Zeros, ones and signs fold away, and what occurs twice is done once."""
    assert len(recorded(lambda x: [x[0] * 0.0, 1.0 * x[1] + 0.0, -x[0], x[0] - x[0]], 2).steps) == 0
    assert len(recorded(lambda x: [x[0] * x[1], x[1] * x[0], -x[1] * x[0]], 2).steps) == 1
    assert len(recorded(lambda x: [x[0] * x[1] + x[2], 0.0], 4).steps) == 1  # fused
    assert recorded(lambda x: [x[0] * x[1] - x[2]], 3).steps[0, 0] == Op.SUB_FROM_MUL


def test_no_step_overwrites_what_it_reads() -> None:
    """Such a step would not run in parallel over poses."""

    def formula(x: np.ndarray) -> list:
        for _ in range(40):
            x = np.roll(x, 1) * x - x[::-1]
        return list(x)

    program = recorded(formula, 5)
    operands = {Op.ADD: 2, Op.SUB: 2, Op.MUL: 2, Op.MUL_ADD: 3, Op.MUL_SUB: 3, Op.SUB_FROM_MUL: 3}
    for op, result, *read in program.steps:
        assert result not in read[: operands[Op(op)]]
        assert result >= program.inputs
    assert program.places < 30  # of 200 results: places are used again
