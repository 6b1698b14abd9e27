"""A load or a target that sits elsewhere, against a robot that has a node there."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Node, Rigid, Robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from tests.diagnosis.machines import arm_at, at_random, close, kr240, nominal, rows_of, shape_of, unexplained

OFFSET = 0.05


def with_lug(axis: int) -> Robot:
    """Return the KR240-2 with a node beside its tool point, along an axis of the tool."""
    robot = kr240()
    update = {
        "nodes": (*robot.nodes, Node(name="lug", frame="f6", at=tuple(OFFSET * np.eye(3)[axis]))),
        "rigids": (*robot.rigids, Rigid(name="bracket", nodes=["n6b", "lug"])),
    }
    return robot.model_copy(update=update)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("shape", "load_point", "point"),
    [("load", "lug", "n6b"), ("target", "n6b", "lug"), ("load and target together", "lug", "lug")],
)
def test_columns_are_what_a_node_elsewhere_adds(axis: int, shape: str, load_point: str, point: str) -> None:
    rows = at_random(kr240(), 8, seed=axis)
    # what is read is what the target does, its rotation included; to first order in the offset
    lug = replace(rows, load_point=np.full(8, load_point), point=np.full(8, point))
    moved = predict_displacements(with_lug(axis), lug)
    there = nominal(kr240(), rows)
    there = replace(there, measured=moved)
    expected = moved - predict_displacements(kr240(), rows)
    if shape.endswith("together"):  # of the second order is what the offset load turns the offset target by
        turned = predict_displacements(kr240(), rows)[:, 3:]
        there = replace(there, measured=np.concatenate([moved[:, :3], turned], axis=1))
        seen = replace(rows, point=np.full(8, "lug"))
        loaded = replace(rows, load_point=np.full(8, "lug"))
        expected = sum(
            predict_displacements(with_lug(axis), one) - predict_displacements(kr240(), rows)
            for one in (seen, loaded)
        )
    columns = shape_of(there, "tool-offset", None, shape).columns[..., axis]
    if shape == "target":
        np.testing.assert_allclose(columns[:, :3] * OFFSET, expected[:, :3], atol=1e-12)
        assert not columns[:, 3:].any()
    else:
        close(columns * OFFSET, expected)


@pytest.mark.parametrize("axis", range(3))
def test_a_load_far_off_turns_what_moves_a_target_far_off_where_no_rotation_is_read(axis: int) -> None:
    rows = at_random(kr240(), 8, seed=axis)
    lug = replace(rows, load_point=np.full(8, "lug"), point=np.full(8, "lug"))
    there = nominal(kr240(), rows)
    turned = predict_displacements(kr240(), rows)  # under the loads alone, without the dead weight's part
    there = replace(there, used=there.used & (np.arange(6) < 3), predicted=turned)
    shape = shape_of(there, "tool-offset", None, "load and target, far off")
    letter = "xyz"[axis]
    sizes = {f"load_point_{letter}": OFFSET, f"target_{letter}": OFFSET}
    sizes[f"load_{letter}_target_{letter}"] = OFFSET**2
    found = shape.columns @ [sizes.get(item.name, 0.0) for item in shape.parameters]
    expected = predict_displacements(with_lug(axis), lug) - predict_displacements(kr240(), rows)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=1e-12)


def test_what_was_fitted_without_rotations_is_found_again_on_rows_that_read_them() -> None:
    there = nominal(kr240(), at_random(kr240(), 8, seed=1))
    unread = replace(there, used=there.used & (np.arange(6) < 3))
    for other in (replace(there, fit_rows=unread), replace(there, stated={})):
        shape = shape_of(other, "tool-offset", None, "load and target, far off")
        assert not shape.columns[..., 6:].any()  # the rotation that was read holds it


@pytest.mark.parametrize("axis", range(3))
def test_a_target_off_its_seat_is_off_in_absolute_positions(axis: int) -> None:
    q = at_random(kr240(), 6, seed=4).q
    arm = arm_at(q)
    there = nominal(kr240(), rows_of(kr240(), q, np.zeros((6, 6)), position=arm.tip, rotation=0 * arm.tip))
    expected = nominal_pose(with_lug(axis), replace(there.rows, point=np.full(6, "lug")))[0] - arm.tip
    columns = shape_of(there, "tool-offset", None, "target").columns[..., axis]
    np.testing.assert_allclose(columns[:, :3] * OFFSET, expected, atol=1e-12)
    assert not columns[:, 3:].any()
    turned = shape_of(there, "tool-offset", None, "target and its turn").columns[..., 3 + axis]
    np.testing.assert_allclose(turned[:, 3:], arm.tool[:, :, axis], atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_a_target_whose_unloaded_place_is_known_still_moves_with_what_the_load_turns(axis: int) -> None:
    loaded = at_random(kr240(), 6, seed=6)
    read = arm_at(loaded.q).tip + predict_displacements(kr240(), loaded)[:, :3]
    there = nominal(kr240(), rows_of(kr240(), loaded.q, loaded.wrench, position=read))
    lug = replace(loaded, point=np.full(6, "lug"))
    expected = predict_displacements(with_lug(axis), lug) - predict_displacements(kr240(), loaded)
    columns = shape_of(there, "tool-offset", None, "target and its lever").columns[..., 3 + axis]
    np.testing.assert_allclose(columns[:, :3] * OFFSET, expected[:, :3], rtol=2e-2, atol=1e-9)
    assert not columns[:, 3:].any()


def test_what_sits_elsewhere_on_the_machine_does_not_move_with_the_tool() -> None:
    rows = at_random(kr240(), 6, seed=2)
    elsewhere = np.where(np.arange(6) < 3, "n6b", "n4b")
    there = nominal(kr240(), replace(rows, point=elsewhere))
    target = shape_of(there, "tool-offset", None, "target").columns
    assert np.abs(target[:3, :3]).max(axis=(1, 2)).min() > 0
    assert not target[3:].any()
    pushed = nominal(kr240(), replace(rows, load_point=elsewhere))
    load = shape_of(pushed, "tool-offset", None, "load").columns
    assert np.abs(load[:3]).max(axis=(1, 2)).min() > 0
    assert not load[3:].any()


@pytest.mark.parametrize("where", ["", ", in the base frame"])
def test_a_load_that_hangs_on_something_acts_where_its_direction_takes_it(where: str) -> None:
    # half of an arch beside the tool point: the hook lies where the load pulls it to
    rows = at_random(kr240(), 8, seed=4)
    force = rows.wrench[:, :3]
    there = nominal(kr240(), rows)
    axes = np.broadcast_to(np.eye(3), (8, 3, 3)) if where else arm_at(rows.q).tool
    along = np.einsum("nai,na->ni", axes, force / np.linalg.norm(force, axis=1, keepdims=True))
    point = np.einsum("nai,ni->na", axes, along * [0.04, 0.0, -0.02])
    wrench = np.concatenate([np.zeros((8, 3)), np.cross(point, force)], axis=1)
    expected = np.einsum("nab,nb->na", there.response, wrench)
    shape = shape_of(there, "tool-offset", None, f"load that turns after its direction{where}")
    at = {one.name: k for k, one in enumerate(shape.parameters)}
    columns = shape.columns[..., at["load_point_x_by_x"]] * 0.04
    columns = columns - shape.columns[..., at["load_point_z_by_z"]] * 0.02
    close(columns, expected)
    pulled = sum(shape.columns[..., at[f"load_point_{a}_by_{a}"]] for a in "xyz")
    np.testing.assert_allclose(pulled, 0.0, atol=1e-9)  # along its own line a load may act anywhere


def test_a_load_that_keeps_its_side_acts_beside_the_tool_however_that_turns() -> None:
    rows = at_random(kr240(), 8, seed=5)
    name = "load that keeps its side in the base frame"
    shape = shape_of(nominal(kr240(), rows), "tool-offset", None, name)
    for axis in range(3):
        beside = OFFSET * np.eye(3)[axis]
        moment = rows.wrench.copy()
        moment[:, 3:] += np.cross(beside, rows.wrench[:, :3])
        moved, still = (predict_displacements(kr240(), some) for some in (replace(rows, wrench=moment), rows))
        close(shape.columns[..., axis] * OFFSET, moved - still)


def test_a_load_that_is_hooked_on_anew_sits_elsewhere_in_every_posture() -> None:
    q = np.repeat(at_random(kr240(), 5, seed=9).q, 4, axis=0)
    there = nominal(kr240(), rows_of(kr240(), q, at_random(kr240(), 20, seed=10).wrench))
    offset = np.repeat(np.random.default_rng(11).uniform(-OFFSET, OFFSET, (5, 3)), 4, axis=0)
    moment = np.cross(np.einsum("nai,ni->na", arm_at(q).tool, offset), there.rows.wrench[:, :3])
    moved = np.einsum("nab,nb->na", there.response[:, :, 3:], moment)
    shape = shape_of(there, "tool-offset", None, "load, per-posture offset")
    assert unexplained(moved, shape.columns) < 1e-9
    assert sum(not item.posture_specific for item in shape.parameters) == 3
    # of postures that were not measured it knows the common point alone
    elsewhere = replace(nominal(kr240(), at_random(kr240(), 6, seed=12)), fit_rows=there)
    found = shape_of(elsewhere, "tool-offset", None, "load, per-posture offset").columns
    assert found.shape[2] == shape.columns.shape[2]
    assert not found[:, :, 3:].any()
    close(found[:, :, :3], shape_of(elsewhere, "tool-offset", None, "load").columns)


def test_or_whenever_it_pulls_another_way() -> None:
    # three postures, each pulled four ways, weakly and strongly
    q = np.repeat(at_random(kr240(), 3, seed=9).q, 8, axis=0)
    ways = np.repeat(at_random(kr240(), 12, seed=10).wrench, 2, axis=0)
    there = nominal(kr240(), rows_of(kr240(), q, ways * np.tile([1.0, 2.0], 12)[:, None]))
    offset = np.repeat(np.random.default_rng(11).uniform(-OFFSET, OFFSET, (12, 3)), 2, axis=0)
    at = np.einsum("nai,ni->na", arm_at(q).tool, offset)
    moved = np.einsum("nab,nb->na", there.response[:, :, 3:], np.cross(at, there.rows.wrench[:, :3]))
    shape = shape_of(there, "tool-offset", None, "load, per-direction offset")
    assert shape.columns.shape[2] == 3 + 3 * 12
    assert unexplained(moved, shape.columns) < 1e-9
    # where every load pulls another way it could be anything
    alone = nominal(kr240(), rows_of(kr240(), q, at_random(kr240(), 24, seed=13).wrench))
    with pytest.raises(StopIteration):
        shape_of(alone, "tool-offset", None, "load, per-direction offset")


def ways_of(rows: Measurements) -> int:
    there = nominal(kr240(), rows)
    names = {one.name: one for one in EFFECTS["tool-offset"].shapes(there, None)}
    found = names.get("load, per-direction offset")
    return 0 if found is None else found.columns.shape[2] // 3 - 1


def test_ways_to_pull_are_told_as_a_load_cell_reads_them() -> None:
    q = np.repeat(at_random(kr240(), 3, seed=9).q, 12, axis=0)
    once = at_random(kr240(), 12, seed=10).wrench
    pulled = np.repeat(once, 3, axis=0) * np.tile([0.0, 1.0, 2.0], 12)[:, None]  # and let go in between
    read = pulled + np.random.default_rng(2).normal(0, 0.3, pulled.shape)
    assert ways_of(rows_of(kr240(), q, pulled)) == 12
    assert ways_of(rows_of(kr240(), q, read)) == 12
    # pulled one way in every posture it is another in every posture
    one_way = np.repeat(once[:3], 12, axis=0) * np.tile(np.arange(1.0, 13.0), 3)[:, None]
    assert ways_of(rows_of(kr240(), q, one_way)) == 0


def test_a_lever_turns_a_drive_that_nothing_else_turns_by_a_stiffness_that_nobody_knows() -> None:
    """All forces act on the last axis; a lever of 40 mm turns it, and it is half as stiff as was thought."""
    some = at_random(kr240(), 12, seed=3)
    rows = rows_of(
        kr240(), some.q, some.wrench * [1, 1, 1, 0, 0, 0], sigma_position=3e-5, sigma_rotation=5e-5
    )
    soft = with_lug(1).with_parameters({"J6.torsional": 0.5 * kr240().parameter("J6.torsional")})
    lever = replace(rows, load_point=np.full(12, "lug"))
    moved = predict_displacements(soft, lever) - predict_displacements(kr240(), rows)
    there = nominal(kr240(), rows)
    names = {shape.name: shape.columns for shape in EFFECTS["tool-offset"].shapes(there, None)}
    assert unexplained(moved, names["load"]) > 0.1
    assert unexplained(moved, names["load, turning what nothing else does"]) < 1e-6


def test_where_every_drive_shows_none_is_left_free() -> None:
    shapes = EFFECTS["tool-offset"].shapes(nominal(kr240(), at_random(kr240(), 12, seed=3)), None)
    assert "load, turning what nothing else does" not in {shape.name for shape in shapes}
