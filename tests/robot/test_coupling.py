from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import BeamstiffError, Frame, Loop, Node, Rigid, Robot, Variable
from beamstiff.robot import coupling as module
from beamstiff.robot.coupling import coupling, frame_expressions, variable_kinds


def machine(variables: list[Variable], frames: list[Frame] | None = None) -> Robot:
    passive = any(variable.passive for variable in variables)
    return Robot(
        name="machine",
        variables=variables,
        frames=frames or [],
        loops=[Loop(name="loop", a="a", b="b", constrain="position")] if passive else [],
        nodes=[Node(name="a"), Node(name="b")],
        rigids=[Rigid(name="link", nodes=("a", "b"))],
        fixed=["a"],
        tcp="b",
    )


def test_free_variables_are_the_actuated_ones_and_then_the_passive_ones() -> None:
    found = coupling(
        machine(
            [
                Variable(name="th", type="revolute", passive=True),
                Variable(name="q2", type="revolute"),
                Variable(name="follows", equals="2*q2 - th + 90 deg"),
                Variable(name="s1", type="prismatic"),
            ]
        )
    )
    assert found.names == ("th", "q2", "follows", "s1")
    assert found.free == ("q2", "s1", "th")
    assert found.actuated == 2
    np.testing.assert_array_equal(found.matrix, [[0, 0, 1], [1, 0, 0], [2, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose(found.offset, [0, 0, np.pi / 2, 0], rtol=1e-15)


def test_a_coupled_variable_is_of_the_kind_it_follows_or_that_it_declares() -> None:
    robot = machine(
        [
            Variable(name="turns", equals="-q"),
            Variable(name="also", equals="turns"),
            Variable(name="q", type="revolute"),
            Variable(name="s", type="prismatic"),
            Variable(name="slides", equals="0.5*s"),
            Variable(name="screw", type="prismatic", equals="5 mm/rad * q"),
            Variable(name="still", equals=0.25),
        ]
    )
    assert variable_kinds(robot) == {
        "turns": "angle",
        "also": "angle",
        "q": "angle",
        "s": "length",
        "slides": "length",
        "screw": "length",
        "still": "angle",
    }
    np.testing.assert_allclose(coupling(robot).matrix[5], [0.005, 0.0])


@given(st.lists(st.floats(-3, 3), min_size=1, max_size=30), st.randoms(use_true_random=False))
def test_chains_of_coupled_variables_multiply(ratios: list[float], random: object) -> None:
    variables = [Variable(name="q0", type="revolute")] + [
        Variable(name=f"q{at}", equals=f"{ratio!r}*q{at - 1} + 1") for at, ratio in enumerate(ratios, start=1)
    ]
    random.shuffle(variables)
    found = coupling(machine(variables))
    for at in range(len(ratios) + 1):
        factor, offset = 1.0, 0.0
        for ratio in ratios[:at]:
            factor, offset = ratio * factor, ratio * offset + 1.0
        row = found.names.index(f"q{at}")
        np.testing.assert_allclose(found.matrix[row], [factor], rtol=1e-12, atol=1e-300)
        np.testing.assert_allclose(found.offset[row], offset, rtol=1e-9, atol=1e-12)


def test_a_chain_may_be_longer_than_python_likes_to_recurse() -> None:
    variables = [Variable(name=f"v{at}", equals=f"v{at + 1}") for at in range(3000)]
    found = coupling(machine([*variables, Variable(name="v3000", type="revolute")]))
    np.testing.assert_array_equal(found.matrix, np.ones((3001, 1)))


@pytest.mark.parametrize("length", [1, 2, 5000])
def test_a_circle_is_named(length: int) -> None:
    variables = [Variable(name=f"v{at}", equals=f"v{(at + 1) % length}") for at in range(length)]
    with pytest.raises(
        BeamstiffError, match=r"variables\[\d+\]\.equals: 'v\d+' is coupled to itself: v\d+ -> v"
    ):
        machine(variables)


def test_a_chain_of_frames_may_be_long_and_a_circle_of_them_is_named() -> None:
    frames = [Frame(name=f"f{at}", parent=f"f{at - 1}" if at else "base") for at in range(3000)]
    assert len(machine([], frames[::-1]).frames) == 3000
    with pytest.raises(
        BeamstiffError, match=r"frames\[\d+\]\.parent: cycle of frames: f\d+ -> .* -> \.\.\. -> f\d+"
    ):
        machine([], [Frame(name="f0", parent="f2999"), *frames[1:]])


def test_frames_have_an_expression_for_each_of_their_parameters() -> None:
    robot = machine(
        [Variable(name="q", type="revolute"), Variable(name="s", type="prismatic")],
        [Frame(name="f", theta="q - 90 deg", r="885 mm", d="s", alpha=0.5)],
    )
    expressions = frame_expressions(robot)["f"]
    assert list(expressions) == ["gamma", "b", "alpha", "d", "theta", "r", "beta"]
    assert expressions["theta"].coefficients == {"q": 1.0}
    assert expressions["theta"].constant == pytest.approx(-np.pi / 2, rel=1e-15)
    assert expressions["d"].coefficients == {"s": 1.0}
    assert (expressions["r"].constant, expressions["alpha"].constant) == (0.885, 0.5)
    assert expressions["gamma"].constant == expressions["beta"].constant == 0.0


def test_what_a_long_chain_of_coupled_variables_costs_grows_with_its_length() -> None:
    def cost(links: int) -> int:
        """Return how many expressions are searched for variables while each asks for the kinds of all."""
        chain = [Variable(name="v0", type="prismatic")]
        chain += [Variable(name=f"v{k}", equals=f"v{k - 1}") for k in range(1, links)]
        with mock.patch.object(module, "_used_variables", wraps=module._used_variables) as searched:
            robot = Robot(name="chain", variables=chain, nodes=[{"name": "n"}], fixed=["n"], tcp="n")
            for variable in chain:
                assert variable_kinds(robot)[variable.name] == "length"
        return searched.call_count

    assert cost(600) <= 2 * cost(300)
