from itertools import product

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.exam.designs import Wish, draw_campaign, draw_fresh, largest_force, planned
from beamstiff.exam.robots import ROBOTS, exam_robot, random_arm, with_payload
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.table import make_measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot as load_any
from beamstiff.robot.writer import robot_to_yaml


def wishes() -> list[Wish]:
    return [
        Wish(design, data, readings, "true")
        for design, data, readings in product(("rich", "lean"), ("displacement", "absolute"), (3, 6))
    ]


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("wish", wishes(), ids=lambda w: f"{w.design}-{w.data}-{w.readings}")
def test_every_campaign_lies_within_limits_and_closes_its_loops(name: str, wish: Wish) -> None:
    rng = np.random.default_rng(4)
    robot = exam_robot(name, rng)
    campaign = draw_campaign(rng, robot, wish)
    for drawn in (campaign, draw_fresh(rng, robot, campaign)):
        low, high = np.array([variable.limits for variable in robot.actuated]).T
        assert ((drawn.q >= low) & (drawn.q <= high)).all()
        posture(compile_kinematics(robot), drawn.q)  # raises where a loop stays open
        assert (np.diff(drawn.time) >= 0).all()
        assert drawn.kind == wish.data
        assert drawn.rotations == (wish.readings == 6)
    assert len(campaign) == 10 if wish.design == "lean" else 36 <= len(campaign) <= 700


def test_the_noise_is_what_an_instrument_has_and_the_claim_what_was_wished() -> None:
    robot = load_robot("kr240-2")
    for seed, (claim, factor) in enumerate((("true", 1.0), ("half", 0.5), ("twice", 2.0), ("absent", None))):
        rng = np.random.default_rng(seed)
        campaign = draw_campaign(rng, robot, Wish("rich", "displacement", 6, claim))
        assert 2e-5 <= campaign.sigma_position <= 5e-5
        assert 2e-5 <= campaign.sigma_rotation <= 1e-4
        if factor is None:
            assert campaign.claimed_position is None
            assert campaign.claimed_rotation is None
        else:
            assert campaign.claimed_position == factor * campaign.sigma_position
            assert campaign.claimed_rotation == factor * campaign.sigma_rotation


def test_rich_campaigns_repeat_states_load_both_ways_and_come_back() -> None:
    robot = load_robot("kr240-2")
    signs, repeated = set(), []
    for seed in range(30):
        campaign = draw_campaign(np.random.default_rng(seed), robot, Wish("rich", "displacement", 6, "true"))
        first = campaign.point == robot.tcp
        pose = campaign.pose[first] == 0
        wrench = campaign.wrench[first][pose]
        repeated.append((wrench[-1] == wrench[-2]).all())
        along = wrench[:, :3] @ wrench[0, :3]
        signs |= {bool((along < 0).any()), "back" if (np.diff(along[:3]) < 0).any() else "up"}
        assert 12 <= len(np.unique(campaign.pose)) <= 24
    assert all(repeated)
    assert signs == {True, False, "back", "up"}


def test_the_loads_move_the_tool_by_about_a_millimetre() -> None:
    rng = np.random.default_rng(0)
    for name in ("kr240-2", "kr500", "ir663"):
        assert 300 < largest_force(load_robot(name), rng) < 4000


def test_a_random_arm_is_a_robot_like_any_other() -> None:
    arms = [random_arm(np.random.default_rng(seed)) for seed in range(20)]
    for arm in arms:
        assert 0.4 < np.linalg.norm([arm.frames[2].d, arm.frames[3].r]) < 2.2
        assert all(3e3 < arm.parameter(name) < 1e8 for name in arm.identify)
    assert len({arm.parameter("J2.torsional") for arm in arms}) == 20


def test_a_random_arm_survives_its_file(tmp_path) -> None:
    arm = with_payload(random_arm(np.random.default_rng(5)), 40.0, (0.0, 0.05, 0.1))
    (tmp_path / "arm.yaml").write_text(robot_to_yaml(arm), encoding="utf-8")
    assert load_any(tmp_path / "arm.yaml") == arm


def test_a_plan_of_the_user_is_measured_as_it_is_laid_out() -> None:
    robot = load_robot("kr240-2")
    drawn = draw_campaign(np.random.default_rng(1), robot, Wish("rich", "displacement", 6, "true"))
    table = make_measurements(
        [variable.name for variable in robot.actuated],
        drawn.q,
        tcp=robot.tcp,
        wrench=drawn.wrench,
        pose=drawn.pose,
        sigma_position=4e-5,
        sigma_rotation=6e-5,
    )
    plan = parse_measurements(measurements_to_csv(table, robot), robot, require_measured=False)
    campaign = planned(np.random.default_rng(0), plan, (1.0, 1.0))
    np.testing.assert_array_equal(campaign.q, drawn.q)
    np.testing.assert_array_equal(campaign.wrench, drawn.wrench)
    np.testing.assert_array_equal(campaign.pose, drawn.pose)
    np.testing.assert_array_equal(campaign.step, drawn.step)  # counted anew: the plan has none
    assert (campaign.sigma_position, campaign.sigma_rotation, campaign.rotations) == (4e-5, 6e-5, True)


def test_a_plan_without_noise_gets_the_assumed_one_and_no_rotations() -> None:
    robot = load_robot("kr240-2")
    plan = make_measurements([v.name for v in robot.actuated], np.zeros((3, 6)), tcp=robot.tcp)
    campaign = planned(np.random.default_rng(0), plan, (3e-5, 5e-5))
    assert (campaign.sigma_position, campaign.claimed_position, campaign.rotations) == (3e-5, 3e-5, False)
    assert campaign.claimed_rotation is None
