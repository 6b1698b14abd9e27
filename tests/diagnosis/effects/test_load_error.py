"""Errors of the load against the same machine under the load that really acted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Mass, Robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.load_error import rising
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, predict
from beamstiff.model.linear import predict_displacements
from beamstiff.se3 import Array
from tests.diagnosis.machines import arm_at, at_random, close, elbow, kr240, nominal, rows_of, shape_of

SMALL = 1e-6


@pytest.fixture(scope="module")
def campaign() -> Baseline:
    return nominal(kr240(), at_random(kr240(), 8, seed=1))


def under(campaign: Baseline, wrench: Array) -> Array:
    """Return what a wrench that is off by SMALL of an error does more than that written down, per error."""
    rows = campaign.rows
    more = replace(rows, wrench=wrench)
    return (predict_displacements(kr240(), more) - predict_displacements(kr240(), rows)) / SMALL


def turned(wrench: Array, vectors: Array) -> Array:
    turn = Rotation.from_rotvec(vectors)
    return np.concatenate([turn.apply(wrench[:, :3]), turn.apply(wrench[:, 3:])], axis=1)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("tool", [False, True], ids=["base", "tool"])
def test_a_load_pulled_askew(axis: int, tool: bool, campaign: Baseline) -> None:
    rows = campaign.rows
    axes = arm_at(rows.q).tool if tool else np.tile(np.eye(3), (8, 1, 1))
    expected = under(campaign, turned(rows.wrench, SMALL * axes[:, :, axis]))
    name = "direction in the tool" if tool else "direction"
    close(shape_of(campaign, "load-error", None, name).columns[..., axis], expected, 1e-5)


def test_a_cable_that_comes_from_another_place_than_was_written_down(campaign: Baseline) -> None:
    rows = campaign.rows
    size = np.linalg.norm(rows.wrench[:, :3], axis=1, keepdims=True)
    tip, far = arm_at(rows.q).tip, 4.0
    pulley = tip + far * rows.wrench[:, :3] / size
    off = SMALL * np.array([0.3, -1.0, 0.5])
    way = pulley + off - tip
    acting = rows.wrench.copy()
    acting[:, :3] = size * way / np.linalg.norm(way, axis=1, keepdims=True)
    moved = under(campaign, acting)
    columns = shape_of(campaign, "load-error", None, "pulled from elsewhere").columns
    close(columns[..., :3] @ (off / SMALL / far), moved, 1e-4)
    # a place that is off by as much more as the tool is farther
    for k in range(3):
        close(columns[..., 3 + 3 * k : 6 + 3 * k], columns[..., :3] * tip[:, None, None, k], 1e-9)


def read_by_a_cell(campaign: Baseline, axes: Array, a: int, b: int) -> Array:
    """Return what a cell moves, per unit, that feels along one of its axes some of the load along another."""
    gain = np.eye(3)
    gain[a, b] += SMALL
    acts = axes @ gain @ axes.swapaxes(1, 2) @ campaign.rows.wrench.reshape(-1, 2, 3).swapaxes(1, 2)
    return under(campaign, acts.swapaxes(1, 2).reshape(-1, 6))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("tool", [False, True], ids=["base", "tool"])
def test_a_cell_with_another_gain_on_one_axis(axis: int, tool: bool, campaign: Baseline) -> None:
    axes = arm_at(campaign.rows.q).tool if tool else np.tile(np.eye(3), (8, 1, 1))
    name = "gain by axis of the tool" if tool else "gain by axis"
    found = shape_of(campaign, "load-error", None, name).columns[..., axis]
    close(found, read_by_a_cell(campaign, axes, axis, axis), 1e-5)


@pytest.mark.parametrize(("a", "b"), [(0, 0), (0, 2), (2, 1)])
def test_a_cell_whose_axis_feels_another(a: int, b: int, campaign: Baseline) -> None:
    found = shape_of(campaign, "load-error", None, "cross-talk of the cell").columns[..., 3 * a + b]
    close(found, read_by_a_cell(campaign, arm_at(campaign.rows.q).tool, a, b), 1e-5)


def test_a_cell_that_is_not_linear_reads_more_the_larger_the_load(campaign: Baseline) -> None:
    force = np.linalg.norm(campaign.rows.wrench[:, :3], axis=1, keepdims=True)
    acts = campaign.rows.wrench * (1 + SMALL * force / force.max())
    close(shape_of(campaign, "load-error", None, "nonlinear").columns[..., 0], under(campaign, acts), 1e-5)


def test_a_tare_pulls_in_every_loaded_row_alike() -> None:
    wrench = np.concatenate([at_random(kr240(), 4, seed=2).wrench, np.zeros((1, 6))])
    rows = rows_of(kr240(), at_random(kr240(), 5, seed=3).q, wrench)
    there = nominal(kr240(), rows)
    tare = np.where(np.arange(5)[:, None] < 4, np.eye(6)[2], 0.0)
    expected = predict_displacements(kr240(), replace(rows, wrench=tare))
    close(shape_of(there, "load-error", None, "tare").columns[..., 2], expected)


def test_a_pulley_adds_to_a_rising_load_and_takes_from_a_falling_one() -> None:
    wrench = np.array([0.5, 1.0, 0.5, -0.5, -1.0, -0.5])[:, None] * [300.0, 900, 100, 0, 0, 0]
    rows = rows_of(elbow(), [0.3, 0.8], wrench, pose=np.zeros(6, int), step=np.arange(6))
    there = nominal(elbow(), rows)
    assert rising(there).tolist() == [1, 1, -1, 1, 1, -1]
    expected = predict_displacements(elbow(), rows) * rising(there)[:, None]
    close(shape_of(there, "load-error", None, "pulley friction").columns[..., 0], expected)


def test_a_state_that_is_read_again_or_at_another_reflector_was_reached_the_same_way() -> None:
    share = np.repeat([0.5, 1.0, 0.5, 0.0, -0.5], 2)
    order = {"pose": np.zeros(10, int), "step": np.repeat(np.arange(5), 2), "point": ["tip", "end"] * 5}
    rows = rows_of(elbow(), [0.3, 0.8], share[:, None] * [300.0, 900, 100, 0, 0, 0], **order)
    assert rising(nominal(elbow(), rows)).tolist() == [1, 1, 1, 1, -1, -1, -1, -1, 1, 1]


def test_without_steps_or_with_rising_loads_only_no_pulley_is_tried() -> None:
    wrench = np.array([[0.0, 100, 0, 0, 0, 0], [0, 200, 0, 0, 0, 0], [0, 100, 0, 0, 0, 0]])
    for step in (None, [0, 1, 2]):
        rows = rows_of(elbow(), [0, 0], wrench[: 3 if step is None else 2], step=step and step[:2])
        names = {one.name for one in EFFECTS["load-error"].shapes(nominal(elbow(), rows), None)}
        assert "pulley friction" not in names
        assert "direction" in names


def test_rows_without_a_load_cannot_have_it_misread() -> None:
    rows = rows_of(elbow(), [0, 0], np.zeros((2, 6)))
    assert EFFECTS["load-error"].components(nominal(elbow(), rows)) == []


GRAVITY = (1.0, -2.0, -9.5)  # of a machine that stands askew


def carrying(mass: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Robot:
    update = {"masses": (Mass(node="n6b", mass=mass, at=at),), "gravity": GRAVITY}
    return kr240().model_copy(update=update)


@pytest.fixture(scope="module")
def carried() -> Baseline:
    q = at_random(kr240(), 8, seed=1).q
    arm = arm_at(q)
    vector = Rotation.from_matrix(arm.tool).as_rotvec()
    rows = rows_of(carrying(20.0), q, np.zeros((8, 6)), position=arm.tip, rotation=vector)
    there = nominal(carrying(20.0), rows)
    # with the stiffness of the robot itself, whatever the rows say
    exact = nominal(carrying(20.0), at_random(kr240(), 8, seed=1))
    return replace(there, robot=carrying(20.0), response=exact.response)


def more(carried: Baseline, robot: Robot) -> np.ndarray:
    return predict(robot, carried.rows) - predict(carrying(20.0), carried.rows)


def test_a_heavier_payload_sags_as_the_same_robot_with_that_mass(carried: Baseline) -> None:
    found = shape_of(carried, "payload-error", None, "mass").columns[..., 0]
    close(found, more(carried, carrying(20.5)) / 0.5, 1e-3)  # what is left is the weight's own stiffness


def test_what_a_payload_weighs_too_much_hangs_at_the_centre_that_is_described(carried: Baseline) -> None:
    at = (0.08, -0.05, 0.1)
    described = replace(carried, nominal=carrying(20.0, at))
    found = shape_of(described, "payload-error", None, "mass").columns[..., 0]
    heavier = predict(carrying(20.5, at), carried.rows) - predict(carrying(20.0, at), carried.rows)
    close(found, heavier / 0.5, 1e-3)


@pytest.mark.parametrize("axis", range(3))
def test_a_centre_of_gravity_further_off_sags_as_that_mass_there(axis: int, carried: Baseline) -> None:
    at = tuple(0.05 * np.eye(3)[axis])
    found = shape_of(carried, "payload-error", None, "centre of gravity").columns[..., axis]
    close(found, more(carried, carrying(20.0, at)) / (20 * 0.05), 1e-3)


def test_no_payload_weighs_less_than_nothing(carried: Baseline) -> None:
    for shape in EFFECTS["payload-error"].shapes(carried, None):
        least = {item.name: item.least for item in shape.parameters}
        assert least.pop("mass", -20.0) == -20.0
        assert set(least.values()) <= {-np.inf}


def test_displacements_do_not_show_it() -> None:
    there = nominal(carrying(20.0), at_random(kr240(), 4, seed=2))
    assert EFFECTS["payload-error"].components(there) == []


def test_a_hose_that_pulls_as_a_spring_is_a_force_that_follows_the_tool(carried: Baseline) -> None:
    shape = shape_of(carried, "payload-error", None, "something that pulls the more the further it is drawn")
    names = [item.name for item in shape.parameters]
    arm = arm_at(carried.rows.q)
    for a, b in ((0, 0), (1, 0), (2, 1)):
        force = np.zeros((8, 6))
        force[:, a] = arm.tip[:, b]  # 1 N/m
        pulled = predict_displacements(carrying(20.0), rows_of(kr240(), carried.rows.q, force))
        close(shape.columns[..., names.index(f"pull_{'xyz'[a]}_by_{'xyz'[b]}")], pulled, 1e-6)


def test_it_hangs_at_the_tcp_wherever_the_load_acts() -> None:
    machine = elbow(mass=20.0, gravity=(0.0, -9.81, 0.0))
    q = at_random(machine, 6, seed=1).q
    where = {"position": np.zeros((6, 3)), "rotation": np.zeros((6, 3)), "load_point": ["end"] * 6}
    rows = rows_of(machine, q, np.zeros((6, 6)), **where)
    there = fit_baseline(machine, rows, keep=())
    heavier = machine.model_copy(update={"masses": (Mass(node="tip", mass=20.5),)})
    moved = predict(heavier, rows) - predict(machine, rows)
    close(shape_of(there, "payload-error", None, "mass").columns[..., 0], moved / 0.5, 1e-2)
