"""The control for crowded machines: what a plain forward regression names in rows of the simulator."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.diagnosis.control_regression import plain_bic
from beamstiff.diagnosis.control_stepwise import PlainStepwise, plain_stepwise
from beamstiff.exam.blind import unmeasured
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.crowded.blind import true_closing
from beamstiff.exam.designs import Wish, draw_campaign, draw_crowded
from beamstiff.exam.simulate import simulate
from beamstiff.measure.table import Measurements
from tests.exam.campaigns import drawn, without_weight

CURVE = Truth("angle-curve", "q2", "order", {"amplitude": 5e-4, "order": 1.0, "phase": 0.3, "second": 0.0})
LOST = Truth("approach-direction", "q1", "flank", {"half": 1e-4, "first": 1.0, "way": 1.0})
Campaigns = tuple[SimulatedCampaign, SimulatedCampaign]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("kr240-2")


@pytest.fixture(scope="module")
def campaigns(robot: Robot) -> Campaigns:
    return draw_crowded(np.random.default_rng(1), robot, "absolute", 1000.0, (robot.tcp,))


def rows(robot: Robot, campaign: SimulatedCampaign, *truths: Truth) -> Measurements:
    return simulate(robot, truths, campaign, np.random.default_rng(2))


def names(found: PlainStepwise) -> list[str]:
    return [f"{one['effect']}:{one['component']}" for one in found.to_dict()["causes"]]


def test_causes_are_named_in_the_order_of_their_size_and_close_what_they_say(
    robot: Robot, campaigns: Campaigns
) -> None:
    campaign, fresh = campaigns
    found = plain_stepwise(robot, rows(robot, campaign, LOST, CURVE))
    causes = found.to_dict()["causes"]
    assert names(found)[:2] == ["angle-curve:q2", "approach-direction:q1"]
    assert causes[0]["closes"] > causes[1]["closes"] > 0.01
    truth = rows(robot, replace(fresh, claimed_position=None), LOST, CURVE).position
    closed = true_closing(truth, "absolute", found.predict_shift(unmeasured(robot, fresh)))
    assert closed == pytest.approx(sum(one["closes"] for one in causes), abs=0.02)
    noise = np.sqrt(3.0) * 1e3 * campaign.sigma_position
    assert found.to_dict()["remainder"]["rms_mm"] == pytest.approx(noise, rel=0.2)


def test_nothing_is_named_where_nothing_is(robot: Robot, campaigns: Campaigns) -> None:
    found = plain_stepwise(robot, rows(robot, campaigns[0]))
    assert names(found) == []
    assert found.to_dict()["verdict"]["effect"] == "none"


def test_what_is_withheld_is_not_named(robot: Robot, campaigns: Campaigns) -> None:
    found = plain_stepwise(robot, rows(robot, campaigns[0], CURVE), ("angle-curve",))
    assert names(found)
    assert not any(name.startswith("angle-curve") for name in names(found))


def measured(*truths: Truth) -> tuple[Robot, Measurements]:
    robot = without_weight(load_robot("kr240-2"))
    rng = np.random.default_rng(5)
    campaign = draw_campaign(rng, robot, Wish("rich", "displacement", 6, "true"))
    campaign = dataclasses.replace(campaign, shared_unloaded=False)
    return robot, simulate(robot, truths, campaign, rng)


def test_a_plain_regression_names_what_is_glaring() -> None:
    robot = load_robot("kr240-2")
    for truth in (
        drawn(robot, "base-compliance", None, "block", size=1.0),
        drawn(robot, "link-bending", "link1", "tapered", size=1.0),
    ):
        assert plain_bic(*measured(truth)) == truth.label


def test_what_is_withheld_it_does_not_name() -> None:
    truth = drawn(load_robot("kr240-2"), "base-compliance", None, "block", size=1.0)
    named = plain_bic(*measured(truth), ("base-compliance",))
    assert not named.startswith(("base-compliance", "none"))
