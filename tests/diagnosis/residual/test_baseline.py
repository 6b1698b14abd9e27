from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Mass, Node, Rigid, load_robot
from beamstiff.diagnosis.residual.baseline import (
    POSITION_NOISE,
    ROTATION_NOISE,
    at_rows,
    fit_baseline,
    fitted_names,
    predict,
)
from beamstiff.model.linear import predict_displacements
from tests.diagnosis.machines import arm_at, at_random, close, elbow, kr240, rows_of

REAL = dict(zip(kr240().identify, [3e6, 8e6, 4.5e6, 5e5, 7.5e5, 4e5], strict=True))


def test_the_stiffness_of_a_sound_machine_is_found_and_nothing_is_left() -> None:
    rows = at_random(kr240(), 20, seed=1)
    real = kr240().with_parameters(REAL)
    found = fit_baseline(kr240(), replace(rows, displacement=predict(real, rows)))
    for name, value in REAL.items():
        assert found.robot.parameter(name) == pytest.approx(value, rel=1e-5)
    np.testing.assert_allclose(found.gap, 0, atol=1e-8)
    assert found.nominal is kr240()


def test_a_loaded_machine_is_taken_for_what_it_is() -> None:
    # the stiffness of the loaded machine is in the prediction, or its share would look like an effect
    rows = at_random(kr240(), 20, seed=1)
    rows = replace(rows, wrench=3 * rows.wrench)
    loaded, linear = predict_displacements(kr240(), rows, preload=True), predict_displacements(kr240(), rows)
    assert np.abs(loaded - linear).max() > 1e-6
    found = fit_baseline(kr240(), replace(rows, displacement=loaded))
    np.testing.assert_allclose(found.gap, 0, atol=1e-9)


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
def test_the_tangent_is_the_derivative_by_the_compliances(name: str) -> None:
    robot = load_robot(name)
    rows = at_random(robot, 5, seed=2, reach=0.4)
    if name == "ir663":
        rows = rows_of(robot, rows.q, rows.wrench * [1, 0, 1, 0, 1, 0])
    found = fit_baseline(robot, replace(rows, displacement=predict_displacements(robot, rows)))
    for at, parameter in enumerate(found.fitted):
        compliance = 1 / found.robot.parameter(parameter)
        low, high = (
            predict_displacements(found.robot.with_parameters({parameter: 1 / c}), rows)
            for c in (0.999 * compliance, 1.001 * compliance)
        )
        close(found.tangent[..., at], (high - low) / (0.002 * compliance), 1e-4)


def test_a_drive_that_turns_the_point_alone_keeps_its_stiffness() -> None:
    """Its axis meets the point but for rounding, which says nothing of its compliance."""
    arm = kr240()
    frame = next(node.frame for node in arm.nodes if node.name == "n6b")
    tool = Node(name="tool", frame=frame, at=(1e-13, 0, 0.1))
    flange = Rigid(name="flange", nodes=("n6b", "tool"))
    more = {"nodes": (*arm.nodes, tool), "rigids": (*arm.rigids, flange), "tcp": "tool"}
    robot = arm.model_copy(update=more)
    rows = at_random(robot, 20, seed=1)
    seen = predict(robot.with_parameters(REAL), rows)
    seen[:, 3:] = np.nan
    found = fit_baseline(robot, replace(rows, displacement=seen))
    last = found.fitted.index("J6.torsional")
    assert not found.tangent[:, :3, last].any()
    assert found.tangent[:, 3:, last].any()
    assert found.robot.parameter("J6.torsional") == pytest.approx(robot.parameter("J6.torsional"), rel=1e-6)


def test_the_response_is_the_compliance_between_load_and_point() -> None:
    robot = elbow(tilting=1e6)
    rows = rows_of(robot, [0.3, 0.7], np.ones((2, 6)), load_point=["tip", "end"], point=["end", "tip"])
    found = fit_baseline(robot, replace(rows, displacement=predict(robot, rows)))
    wrench = np.random.default_rng(3).standard_normal((2, 6))
    moved = predict_displacements(robot, replace(rows, wrench=wrench))
    np.testing.assert_allclose((found.response @ wrench[..., None])[..., 0], moved, rtol=1e-9, atol=1e-15)
    # the one way as the other, by reciprocity
    np.testing.assert_allclose(found.response[0], found.response[1].T, rtol=1e-9, atol=1e-15)


def test_absolute_poses_count_as_deviations_from_the_nominal_ones() -> None:
    q = at_random(kr240(), 6, seed=4).q
    arm = arm_at(q)
    off = np.array([1e-3, -2e-3, 5e-4])
    turned = Rotation.from_rotvec([1e-3, 2e-3, -1e-3]) * Rotation.from_matrix(arm.tool)
    rows = rows_of(kr240(), q, np.zeros((6, 6)), position=arm.tip + off, rotation=turned.as_rotvec())
    found = fit_baseline(kr240(), rows)
    assert found.absolute
    np.testing.assert_allclose(found.measured, np.tile([*off, 1e-3, 2e-3, -1e-3], (6, 1)), atol=1e-12)


def test_dead_weight_bends_absolute_poses_and_not_displacements() -> None:
    robot = kr240().model_copy(update={"masses": (Mass(node="n6b", mass=80.0),)})
    rows = at_random(kr240(), 4, seed=5)
    absolute = rows_of(robot, rows.q, rows.wrench, position=arm_at(rows.q).tip)
    both, loaded = predict(robot, absolute), predict(robot, rows)
    weight = np.tile([0, 0, -80 * 9.81, 0, 0, 0], (4, 1))
    close(both - loaded, predict_displacements(robot, replace(rows, wrench=weight)), 3e-3)


def test_what_is_fitted_is_what_the_robot_says_else_its_own_springs() -> None:
    assert fitted_names(kr240()) == kr240().identify
    robot = elbow(tilting=1e6).model_copy(update={"identify": ()})
    assert fitted_names(robot) == ("J1.torsional", "J2.torsional")
    assert fitted_names(elbow(torsional="rigid").model_copy(update={"identify": ()})) == ("J1.torsional",)


def test_a_robot_without_springs_predicts_no_deflection() -> None:
    rigid = elbow().with_parameters({"J1.torsional": np.inf, "J2.torsional": np.inf})
    rigid = rigid.model_copy(update={"identify": ()})
    found = fit_baseline(rigid, at_random(rigid, 3, seed=6))
    assert found.tangent.shape == (3, 6, 0)
    assert not found.predicted.any()
    assert not found.response.any()


def test_where_a_table_states_no_noise_a_usual_one_is_begun_with() -> None:
    found = fit_baseline(elbow(), at_random(elbow(), 3, seed=7))
    assert not found.claimed
    np.testing.assert_allclose(found.sigma, np.tile(np.repeat([POSITION_NOISE, ROTATION_NOISE], 3), (3, 1)))
    stated = fit_baseline(elbow(), at_random(elbow(), 3, seed=7, sigma_position=1e-4))
    assert stated.claimed
    np.testing.assert_allclose(stated.sigma[:, :3], 1e-4)


def test_other_rows_are_seen_with_the_stiffness_that_was_fitted() -> None:
    rows = at_random(kr240(), 20, seed=1)
    real = kr240().with_parameters(REAL)
    found = fit_baseline(kr240(), replace(rows, displacement=predict(real, rows)))
    other = at_random(kr240(), 5, seed=8)
    there = at_rows(found, other)
    close(there.predicted, predict(real, other), 1e-6)
    assert there.fit is found
    assert found.fit is found
