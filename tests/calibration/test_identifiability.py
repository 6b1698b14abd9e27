"""The minimal identifiable set against what is known of chains; linear combinations against their columns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff import Frame, Node, Robot, Variable
from beamstiff.calibration.error_jacobian import build_geometry
from beamstiff.calibration.identifiability import Identifiability, identifiability
from beamstiff.calibration.parameters import Parameter, choose_parameters, known_parameters
from beamstiff.se3 import Array
from tests.calibration.machines import SIGMA, measured, serial, within


def seen(
    robot: Robot, q: Array, turned: bool, last: tuple[str, ...] = (), noticed: float = 0.0
) -> tuple[Identifiability, Array, tuple[Parameter, ...]]:
    rows = measured(robot, q, turned=turned)
    known = known_parameters(robot, [robot.tcp], turned)
    parameters = choose_parameters(robot, known, None, (), last)
    _, jacobian = build_geometry(robot, rows, parameters).jacobian(np.zeros(len(parameters)))
    weighed = (jacobian if turned else jacobian[:, :3]).reshape(-1, len(parameters)) / SIGMA
    return identifiability(weighed, parameters, noticed), weighed, parameters


@pytest.mark.parametrize(("turned", "count"), [(True, 30), (False, 27)])
def test_a_chain_of_six_revolute_joints_has_four_parameters_a_joint_and_the_two_ends(
    turned: bool, count: int
) -> None:
    # Everett and Hsu 1988: 4 R + 2 P + 6 from poses; from a point, the tool's orientation is not seen
    found, _, _ = seen(serial(), within(serial(), 60, seed=1), turned)
    assert len(found.identified) == found.exact_rank == count
    # of all six frames only the second, whose axis is parallel to the next one, needs Hayati's beta
    assert [name for name in found.identified if name.endswith((".beta", ".b", ".gamma"))] == ["f2.beta"]


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), joints=st.integers(3, 7), sliding=st.integers(0, 1))
def test_any_chain_has_four_parameters_a_turning_joint_and_two_a_sliding_one(
    seed: int, joints: int, sliding: int
) -> None:
    rng = np.random.default_rng(seed)
    slides = [at < sliding for at in range(joints)]
    names = [f"v{at}" for at in range(joints)]
    frames = [
        Frame(
            name=f"f{at}",
            parent="base" if at == 0 else f"f{at - 1}",
            alpha=rng.uniform(0.5, 2.5),
            d=rng.uniform(0.2, 1.0),
            **(
                {"r": names[at], "theta": 0.3}
                if slides[at]
                else {"theta": names[at], "r": rng.uniform(0.2, 1.0)}
            ),
        )
        for at in range(joints)
    ]
    chain = Robot(
        name="chain",
        variables=[
            Variable(name=name, type="prismatic" if slide else "revolute", limits=(-1.0, 1.0))
            for name, slide in zip(names, slides, strict=True)
        ],
        frames=frames,
        nodes=[Node(name="tool", frame=frames[-1].name, at=(0.1, 0.2, 0.3))],
        fixed=["tool"],
        tcp="tool",
    )
    found, _, _ = seen(chain, within(chain, 60, seed=1), True)
    assert found.exact_rank == 4 * (joints - sliding) + 2 * sliding + 6
    assert len(found.identified) == found.exact_rank


def test_dependent_columns_are_the_combinations_that_are_printed() -> None:
    found, columns, parameters = seen(serial(), within(serial(), 60, seed=2), True)
    at = {item.name: number for number, item in enumerate(parameters)}
    assert set(found.dependent) | set(found.identified) | set(found.silent) == set(at)
    for name, like in found.dependent.items():
        made = sum((factor * columns[:, at[one]] for one, factor in like.items()), np.zeros(len(columns)))
        # coefficients below a thousandth are not printed
        assert np.abs(made - columns[:, at[name]]).max() < 5e-3 * np.abs(columns[:, at[name]]).max(), name
    assert found.dependent["f3.r"] == pytest.approx({"f2.r": 1.0})
    assert found.dependent["q1"] == pytest.approx({"base.rz": -1.0})  # A1 counts clockwise


def test_what_comes_last_is_held_and_the_others_are_kept() -> None:
    first, _, _ = seen(serial(), within(serial(), 60, seed=3), False)
    assert "f2.r" in first.identified
    other, _, _ = seen(serial(), within(serial(), 60, seed=3), False, last=("f2.r", "base.rz"))
    assert {"f3.r", "q1"} <= set(other.identified)
    assert not {"f2.r", "base.rz"} & set(other.identified)
    assert len(other.identified) == len(first.identified)


def test_a_parameter_that_moves_nothing_is_silent() -> None:
    robot = serial().model_copy(update={"tcp": "n6b"})  # on the last axis
    found, _, _ = seen(robot, within(robot, 40, seed=4), False)
    assert {"q6", "f6.beta", "f6.alpha"} & set(found.silent) == {"q6"}


def test_a_column_must_stand_out_of_the_noise_by_what_it_adds() -> None:
    rng = np.random.default_rng(0)
    one, two = rng.standard_normal((2, 50))
    one, two = one / np.linalg.norm(one), two - (two @ one) / (one @ one) * one
    columns = np.stack([one * 5e3, one * 4e3 + two / np.linalg.norm(two) * 800], axis=1)
    parameters = tuple(Parameter(name, "frame", "m", 1e-3, 2) for name in ("a", "b"))
    found = identifiability(columns, parameters)  # 1 mm of b shows 0.8 times the noise beside a
    assert found.identified == ("a",)
    assert found.adds == pytest.approx([5.0, 0.8])
    assert found.dependent == {"b": {"a": pytest.approx(0.8)}}
    assert identifiability(columns, parameters, noticed=0.7).identified == ("a", "b")


def test_a_reflector_that_only_errors_of_angles_would_show_is_held() -> None:
    # a level tool: base and reflector move the point alike, but for what two errors of angles do as well
    base, first, second, own = np.linalg.qr(np.random.default_rng(3).standard_normal((60, 4)))[0].T
    truly = 1e4 * base
    columns = [truly, truly + 9 * first + 9 * second + 0.3 * own, 2e4 * first, 2e4 * second]
    sizes, ranks, groups = (0.1, 0.1, 1e-3, 1e-3), (0, 0, 2, 2), ("base", "target", "frame", "frame")
    parameters = tuple(
        Parameter(name, group, "m", size, rank)
        for name, group, size, rank in zip(
            ("base.z", "r1.z", "f2.d", "f3.d"), groups, sizes, ranks, strict=True
        )
    )
    found = identifiability(np.stack(columns, -1) / sizes, parameters)
    assert len({"base.z", "r1.z"} & {*found.identified}) == 1
    assert {"f2.d", "f3.d"} < {*found.identified}
    # and with the reflector's place shown by itself, both are
    columns[1] = columns[1] + 3 * own
    assert len(identifiability(np.stack(columns, -1) / sizes, parameters).identified) == 4
