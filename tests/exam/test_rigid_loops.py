"""The machines of `benchmarks.rigid_loops`: a rigid four-bar and its stiff twin move alike."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.exam.designs import Wish, draw_campaign
from beamstiff.exam.forms import draw_truth
from beamstiff.exam.simulate import simulate
from benchmarks.rigid_loops import EFFECTS, elastic_twin, rigid_four_bar


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_rigid_four_bar_and_its_stiff_twin_move_alike_under_every_law(effect: str) -> None:
    rng = np.random.default_rng(0)
    rigid, twin = rigid_four_bar(), elastic_twin(1e4)
    campaign = draw_campaign(rng, rigid, Wish("rich", "displacement", 3, "true"))
    quiet = replace(campaign, sigma_position=0.0, sigma_rotation=0.0)
    truth = draw_truth(rng, rigid, effect, 0.5)
    moved = [
        simulate(robot, (truth,), quiet, np.random.default_rng(1)).displacement for robot in (rigid, twin)
    ]
    without = simulate(rigid, (), quiet, np.random.default_rng(1)).displacement
    position = np.array([one[:, :3] for one in (*moved, without)])
    assert np.abs(position[0] - position[1]).max() < 0.01 * np.abs(position[0] - position[2]).max()
