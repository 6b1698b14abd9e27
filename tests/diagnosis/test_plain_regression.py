import dataclasses

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.diagnosis.plain_regression import plain_bic
from beamstiff.exam.campaign import Truth
from beamstiff.exam.designs import Wish, draw_campaign
from beamstiff.exam.simulate import simulate
from beamstiff.measure.table import Measurements
from tests.exam.campaigns import drawn, without_weight


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
