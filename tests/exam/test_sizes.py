"""How large a gap is, checked on campaigns of another program, and sizes drawn for it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff import load_robot, read_measurements
from beamstiff.exam.cases import Exam, draw_case
from beamstiff.exam.designs import Wish, draw_campaign, planned
from beamstiff.exam.forms import draw_truth
from beamstiff.exam.simulate import draw_stiffness
from beamstiff.exam.sizes import draw_gap, linear_fit, size_for, sized, some_poses, true_rows, whitened_gap


def explained(values: np.ndarray, basis: np.ndarray) -> np.ndarray:
    return np.asarray(basis @ np.linalg.lstsq(basis, values, rcond=1e-12)[0])


def test_gap_over_noise_is_what_another_programs_labels_call_so(shared_path: Callable[[str], Path]) -> None:
    """From its noisy rows: what a fit leaves, less the share of it that the noise is expected to make."""
    folder = shared_path("practice")
    labels: dict[str, dict[str, Any]] = json.loads((folder / "labels.json").read_text())
    asked = {
        name: label
        for name, label in labels.items()
        # outliers are no part of its gap, and of absolute rows it takes the gap before any fit
        if label["effect"] != "outliers" and label.get("kind") != "pose" and label["gap_over_noise"] > 1.0
    }
    assert len(asked) >= 15
    for name, label in asked.items():
        robot = load_robot(folder / f"{label['robot']}.yaml")
        rows = read_measurements(folder / f"{name}.csv", robot)
        machine = robot.with_parameters(dict(zip(robot.identify, label["true_k"], strict=True)))
        fit = linear_fit(robot, machine, planned(np.random.default_rng(0), rows, (3e-5, 5e-5)))
        known = ~np.isnan(fit.still)
        values = ((rows.measured - fit.still) * fit.weight)[known]
        basis = (fit.basis * fit.weight[:, None])[known]
        left = values - explained(values, basis)
        count, fitted = basis.shape
        gap = np.sqrt((left @ left - (count - fitted)) / count)
        # noise: the sum of squares scatters by 2 n + 4 n gap^2
        scatter = np.sqrt(2.0 * count + 4.0 * count * gap**2) / count / (2.0 * gap)
        assert abs(gap - label["gap_over_noise"]) < 3.0 * scatter, (name, label["effect"])


def test_the_fit_takes_what_compliances_explain_and_leaves_the_rest() -> None:
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(1)
    campaign = draw_campaign(rng, robot, Wish("rich", "displacement", 6, "true"))
    fit = linear_fit(robot, robot, campaign)
    softer = robot.with_parameters({name: 0.97 * robot.parameter(name) for name in robot.identify})
    change = true_rows(softer, (), campaign) - fit.still
    values, basis = (change * fit.weight).reshape(-1), (fit.basis * fit.weight[:, None]).reshape(-1, 6)
    left = values - explained(values, basis)
    assert np.abs(left).max() < 2e-3 * np.abs(values).max()
    assert whitened_gap(campaign, fit.residual((draw_truth(rng, robot, "base-compliance", 0.7),))) > 1.0


@pytest.mark.parametrize("wanted", [0.05, 0.3, 1.0, 5.0])
def test_a_size_is_found_for_a_gap(wanted: float) -> None:
    for gap_of in (
        lambda s: 0.01 * 1000.0**s,
        lambda s: 0.02 * 10.0 ** (3.5 * s**2),
        lambda s: 0.03 + 8.0 * s**2,
    ):
        _, gap = size_for(gap_of, wanted)
        assert abs(np.log(gap / wanted)) < 0.3


def test_where_no_size_leaves_the_gap_the_nearest_stands() -> None:
    assert size_for(lambda s: 0.1 * s, 5.0) == (1.0, 0.1)
    assert size_for(lambda s: 50.0 + s, 5.0)[0] == 0.0
    size, gap = size_for(lambda s: 2.0 * np.exp(-50.0 * (s - 0.6) ** 2), 5.0)  # sticks beyond
    assert gap > 1.0
    assert 0.4 < size < 0.8
    assert size_for(lambda s: np.inf if s > 0.3 else 1.0, 1.0) == (0.25, 1.0)


def test_gaps_are_drawn_over_the_whole_range() -> None:
    rng = np.random.default_rng(2)
    drawn = np.array([draw_gap(rng, "single") for _ in range(2000)])
    assert drawn.min() < 0.1
    assert drawn.max() > 5.5
    assert 0.07 < np.mean(drawn < 0.3) < 0.13
    np.testing.assert_allclose(np.mean(drawn > 1.0), 0.9 * np.log(6.0) / np.log(20.0), atol=0.04)
    assert min(draw_gap(rng, "pair") for _ in range(500)) >= 1.2


def test_effects_that_hardly_show_are_drawn_anew_and_pairs_stay_apart() -> None:
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(3)
    machine = robot.with_parameters(draw_stiffness(rng, robot))
    campaign = draw_campaign(rng, robot, Wish("rich", "displacement", 6, "true"))
    truths = (
        draw_truth(rng, robot, "link-bending", component="link5"),
        draw_truth(rng, robot, "bearing-tilt", component="q2"),
    )
    for _ in range(3):
        found = sized(rng, robot, machine, campaign, truths, "pair")
        assert [one.truth.effect for one in found] == ["link-bending", "bearing-tilt"]
        assert len({one.truth.component for one in found}) == 2
        assert all(0.0 <= one.size <= 1.0 for one in found)


def test_some_poses_are_whole_poses_over_the_whole_campaign() -> None:
    robot = load_robot("kr240-2")
    campaign = draw_campaign(np.random.default_rng(4), robot, Wish("rich", "displacement", 3, "true"))
    part = some_poses(campaign, 5)
    assert set(part.pose) < set(campaign.pose)
    assert {0, campaign.pose.max()} <= set(part.pose)
    for pose in set(part.pose):
        assert (part.pose == pose).sum() == (campaign.pose == pose).sum()
    assert some_poses(part, 5) is part


@pytest.mark.slow
def test_drawn_sizes_leave_gaps_between_hardly_seen_and_glaring() -> None:
    exam = Exam(seed=19, shares={"single": 1}, robots=("kr240-2",), lean=0.0)
    gaps = []
    for case in range(0, 18, 2):  # every second effect of the table once
        drawn = draw_case(exam, case)
        fit = linear_fit(drawn.robot, drawn.machine, drawn.campaign)
        gaps.append(whitened_gap(drawn.campaign, fit.residual(drawn.truths)))
    assert 0.2 < np.mean(np.array(gaps) >= 1.0) < 0.8
    assert max(gaps) < 15.0
    assert np.mean(np.array(gaps) < 0.03) < 0.2
