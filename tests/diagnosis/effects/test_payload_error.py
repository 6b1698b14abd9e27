from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Mass, Robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, predict
from beamstiff.model.linear import predict_displacements
from tests.diagnosis.machines import arm_at, at_random, close, elbow, kr240, nominal, rows_of, shape_of

GRAVITY = (1.0, -2.0, -9.5)  # of a machine that stands askew


def carrying(mass: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Robot:
    update = {"masses": (Mass(node="n6b", mass=mass, at=at),), "gravity": GRAVITY}
    return kr240().model_copy(update=update)


@pytest.fixture(scope="module")
def campaign() -> Baseline:
    q = at_random(kr240(), 8, seed=1).q
    arm = arm_at(q)
    vector = Rotation.from_matrix(arm.tool).as_rotvec()
    rows = rows_of(carrying(20.0), q, np.zeros((8, 6)), position=arm.tip, rotation=vector)
    there = nominal(carrying(20.0), rows)
    # with the stiffness of the robot itself, whatever the rows say
    exact = nominal(carrying(20.0), at_random(kr240(), 8, seed=1))
    return replace(there, robot=carrying(20.0), response=exact.response)


def more(campaign: Baseline, robot: Robot) -> np.ndarray:
    return predict(robot, campaign.rows) - predict(carrying(20.0), campaign.rows)


def test_a_heavier_payload_sags_as_the_same_robot_with_that_mass(campaign: Baseline) -> None:
    found = shape_of(campaign, "payload-error", None, "mass").columns[..., 0]
    close(found, more(campaign, carrying(20.5)) / 0.5, 1e-3)  # what is left is the weight's own stiffness


def test_what_a_payload_weighs_too_much_hangs_at_the_centre_that_is_described(campaign: Baseline) -> None:
    at = (0.08, -0.05, 0.1)
    described = replace(campaign, nominal=carrying(20.0, at))
    found = shape_of(described, "payload-error", None, "mass").columns[..., 0]
    heavier = predict(carrying(20.5, at), campaign.rows) - predict(carrying(20.0, at), campaign.rows)
    close(found, heavier / 0.5, 1e-3)


@pytest.mark.parametrize("axis", range(3))
def test_a_centre_of_gravity_further_off_sags_as_that_mass_there(axis: int, campaign: Baseline) -> None:
    at = tuple(0.05 * np.eye(3)[axis])
    found = shape_of(campaign, "payload-error", None, "centre of gravity").columns[..., axis]
    close(found, more(campaign, carrying(20.0, at)) / (20 * 0.05), 1e-3)


def test_no_payload_weighs_less_than_nothing(campaign: Baseline) -> None:
    for shape in EFFECTS["payload-error"].shapes(campaign, None):
        least = {item.name: item.least for item in shape.parameters}
        assert least.pop("mass", -20.0) == -20.0
        assert set(least.values()) <= {-np.inf}


def test_displacements_do_not_show_it() -> None:
    there = nominal(carrying(20.0), at_random(kr240(), 4, seed=2))
    assert EFFECTS["payload-error"].components(there) == []


def test_a_hose_that_pulls_as_a_spring_is_a_force_that_follows_the_tool(campaign: Baseline) -> None:
    shape = shape_of(campaign, "payload-error", None, "something that pulls the more the further it is drawn")
    names = [item.name for item in shape.parameters]
    arm = arm_at(campaign.rows.q)
    for a, b in ((0, 0), (1, 0), (2, 1)):
        force = np.zeros((8, 6))
        force[:, a] = arm.tip[:, b]  # 1 N/m
        pulled = predict_displacements(carrying(20.0), rows_of(kr240(), campaign.rows.q, force))
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
