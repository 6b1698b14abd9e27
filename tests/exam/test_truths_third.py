"""What holds of all of the third author's forms: they repeat, keep to their size, and need a load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.exam.campaign import Truth
from beamstiff.exam.designs import Wish, draw_campaign
from beamstiff.exam.effect import DrawRequest
from beamstiff.exam.forms import INSIDE, author3
from beamstiff.exam.names import EFFECTS as NAMES
from beamstiff.exam.robots import exam_robot, with_payload, with_stiff_drive
from beamstiff.robot.description import Robot
from tests.exam.campaigns import campaign_of, random_poses, without_weight
from tests.exam.third import EFFECTS, FORMS, drawn, read

# no potential: friction, and what is wrong with loads or readings
LOSSY = {
    "hysteresis", "load-error", "frame-misalignment", "thermal-drift", "outliers", "tool-offset",
    "slipping-flange", "sticking-gauge", "moving-stand",
}  # fmt: skip
UNLOADED_TOO = {"thermal-drift", "outliers"}


def machine(name: str, effect: str) -> Robot:
    """Return a robot that can have the effect: with a payload, and for stiff joints with one."""
    rng = np.random.default_rng(5)
    robot = with_payload(exam_robot(name, rng), 60.0, (0.02, 0.0, 0.1))
    return with_stiff_drive(robot, rng) if effect == "joint-compliance" else robot


def some(robot: Robot, effect: str, form: str, seed: int = 2, size: float = 0.7) -> Truth:
    places = list(EFFECTS[effect].places(robot))
    return drawn(robot, effect, places[seed % len(places)], form, seed, size)


def test_every_effect_of_the_table_has_new_forms_and_three_lie_outside_it() -> None:
    inside = {effect.name for effect in author3.EFFECTS}
    outside = {effect.name for effect in author3.OUTSIDE}
    assert inside == set(NAMES)
    assert len(outside) == 3
    assert not outside & set(NAMES)
    known = {effect.name: set(effect.forms) for effect in INSIDE}
    for name in inside:
        new = set(EFFECTS[name].forms)
        assert len(new) == (1 if name == "outliers" else 2)
        # none by a name that another author's form has, before and after they are registered
        assert not new & known[name] or new <= known[name]


@pytest.mark.parametrize("name", ["kr240-2", "random-arm", "ir663"])
@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_every_form_can_be_measured_and_leaves_a_trace(name: str, effect: str, form: str) -> None:
    robot = machine(name, effect)
    kind = "absolute" if effect in ("geometry-error", "payload-error") else "displacement"
    campaign = draw_campaign(np.random.default_rng(6), robot, Wish("lean", kind, 6, "true"))  # type: ignore[arg-type]
    campaign = replace(campaign, shared_unloaded=False)
    if effect == "load-error":  # one level of load on a scale shows no more than its gain
        campaign = replace(campaign, wrench=campaign.wrench * np.linspace(0.2, 1.0, len(campaign))[:, None])
    seen = 0.0
    for seed in range(4):
        found = read(robot, campaign, some(robot, effect, form, seed, 0.9))
        assert np.isfinite(found).all()
        seen = max(seen, float(np.abs(found - read(robot, campaign))[:, :3].max()))
    assert seen > 2e-7


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
@pytest.mark.parametrize(("effect", "form"), [pair for pair in FORMS if pair[0] not in LOSSY])
def test_conservative_effects_leave_the_loaded_machine_reciprocal(name: str, effect: str, form: str) -> None:
    """Where forces have a potential, more of i moves j as more of j moves i, at any load."""
    where = machine(name, effect)
    robot = without_weight(where)
    if name == "ir663" and effect == "gravity-compensator":
        robot = where.model_copy(update={"masses": ()})
    truth = some(where, effect, form)
    q = random_poses(robot, np.random.default_rng(7), 1)
    force = np.concatenate([900.0 * np.random.default_rng(8).standard_normal(3), np.zeros(3)])
    small = np.concatenate([2.0 * np.eye(3), np.zeros((3, 3))], axis=1)
    loads = np.concatenate([force + small, force - small])
    found = read(robot, campaign_of(robot, q, loads, time=np.zeros(6)), truth)[:, :3]
    compliance = (found[:3] - found[3:]) / 4.0
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-6 * np.abs(compliance).max())


@pytest.mark.parametrize(("effect", "form"), [pair for pair in FORMS if pair[0] not in UNLOADED_TOO])
def test_no_load_makes_no_displacement(effect: str, form: str) -> None:
    robot = machine("kr240-2", effect)
    q = random_poses(robot, np.random.default_rng(7), 2)
    found = read(robot, campaign_of(robot, q, np.zeros((2, 6))), some(robot, effect, form))
    np.testing.assert_allclose(found, 0.0, atol=1e-11)


@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_the_same_seed_makes_the_same_effect_and_the_same_rows(effect: str, form: str) -> None:
    robot = machine("kr240-2", effect)
    campaign = draw_campaign(np.random.default_rng(1), robot, Wish("lean", "displacement", 3, "true"))
    first, again, other = (some(robot, effect, form, seed) for seed in (3, 3, 33))
    assert first == again
    assert first != other
    np.testing.assert_array_equal(read(robot, campaign, first), read(robot, campaign, again))


@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_another_size_changes_the_size_only(effect: str, form: str) -> None:
    robot = machine("kr240-2", effect)
    for place in EFFECTS[effect].places(robot):
        drawn_ones, left = [], []
        for size in (0.2, 0.8, 0.2):
            rng = np.random.default_rng(8)
            drawn_ones.append(EFFECTS[effect].draw(DrawRequest(rng, robot, place, form, size)))
            left.append(rng.random())
        small, large, again = drawn_ones
        assert small == again
        assert small != large
        assert set(small) == set(large)
        assert left[0] == left[1]  # nothing more is drawn for a larger one
        ratios = [large[k] / small[k] for k in small if large[k] != small[k]]
        assert all(ratio > 0.0 for ratio in ratios)  # no sign or direction turns
        assert all(isinstance(value, float) for value in large.values())
