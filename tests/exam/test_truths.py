"""What holds of all effects of the simulated machines: where they sit, what they keep, that they repeat."""

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, load_robot
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.designs import Wish, draw_campaign
from beamstiff.exam.forms import AUTHORS, EFFECTS, INSIDE, OUTSIDE, author_of, components, draw_truth, resized
from beamstiff.exam.names import EFFECTS as NAMES
from beamstiff.exam.names import LATER
from beamstiff.exam.parameters import DrawRequest
from beamstiff.exam.robots import exam_robot
from beamstiff.exam.simulate import simulate
from tests.exam.campaigns import campaign_of, drawn, loaded_robot, random_poses, read, without_weight

FORMS = [(effect.name, form) for effect in (*INSIDE, *OUTSIDE) for form in effect.forms]
TRACE = 2e-7  # m, a thousand times the solver's rounding: gravity's preload hides play, for instance
# no potential: what is lost to friction or creep, and what is wrong with loads or readings
LOSSY = {
    "hysteresis", "creep", "load-error", "frame-misalignment", "thermal-drift", "outliers", "tool-offset",
    "sticking-gauge", "moving-stand", "slipping-flange", "elbow-hanger", "loaded-floor", "bedding-in",
}  # fmt: skip
# readings that are off whatever the load, and a drive that goes on giving way under its weight
UNLOADED_TOO = {"thermal-drift", "outliers", "creep", "loaded-floor"}


def machine(name: str, effect: str) -> Robot:
    """Return a robot that can have the effect: with a payload, and for stiff joints with one."""
    return loaded_robot(name, effect == "joint-compliance")


@cache
def small_campaign(name: str, stiff: bool, kind: str) -> tuple[SimulatedCampaign, np.random.Generator, Array]:
    """Return a campaign, the generator as it was left behind, and what a machine without effects reads."""
    rng, robot = np.random.default_rng(6), loaded_robot(name, stiff)
    campaign = draw_campaign(rng, robot, Wish("lean", kind, 6, "true"))
    campaign = replace(campaign, shared_unloaded=False)  # with one load a pose it takes all drift off
    return campaign, rng, simulate(robot, (), campaign, np.random.default_rng(0)).measured


def test_every_effect_of_the_table_has_a_truth_and_several_lie_outside_it() -> None:
    assert sorted(effect.name for effect in INSIDE) == sorted(NAMES)
    assert len(OUTSIDE) >= 4
    assert not {effect.name for effect in OUTSIDE} & set(NAMES)


@pytest.mark.parametrize("name", ["kr240-2", "random-arm", "ir663"])
@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_every_form_is_measured_on_every_robot_and_leaves_a_trace(name: str, effect: str, form: str) -> None:
    robot = machine(name, effect)
    kind = "absolute" if effect in ("geometry-error", "payload-error") else "displacement"
    campaign, rng, without = small_campaign(name, effect == "joint-compliance", kind)
    rng, seen = deepcopy(rng), 0.0
    for _ in range(4):
        truth = draw_truth(rng, robot, effect, 0.9, form=form)
        measured = simulate(robot, (truth,), campaign, np.random.default_rng(0)).measured
        assert not np.isnan(measured).any()
        seen = max(seen, float(np.abs(measured - without)[:, :3].max()))
        if seen > TRACE:
            return
    assert seen > TRACE


@pytest.mark.parametrize("name", ["kr240-2", "ir663"])
@pytest.mark.parametrize(("effect", "form"), [pair for pair in FORMS if pair[0] not in LOSSY])
def test_conservative_effects_leave_the_loaded_machine_reciprocal(name: str, effect: str, form: str) -> None:
    """Where forces have a potential, more of i moves j as more of j moves i, at any load."""
    robot = without_weight(machine(name, effect))
    where = robot if effect != "gravity-compensator" else machine(name, effect)
    if name == "ir663" and effect == "gravity-compensator":
        robot = where.model_copy(update={"beams": where.beams, "masses": ()})
    truth = draw_truth(np.random.default_rng(2), where, effect, 0.7, form=form)
    q = random_poses(robot, np.random.default_rng(7), 1)
    force = np.concatenate([900.0 * np.random.default_rng(8).standard_normal(3), np.zeros(3)])
    small = np.concatenate([2.0 * np.eye(3), np.zeros((3, 3))], axis=1)
    loads = np.concatenate([force + small, force - small])
    found = read(robot, campaign_of(robot, q, loads, time=np.zeros(6)), truth)[:, :3]
    compliance = (found[:3] - found[3:]) / 4.0
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-6 * np.abs(compliance).max())


def test_friction_does_not_leave_it_reciprocal_in_a_cycle() -> None:
    robot = without_weight(load_robot("kr240-2"))
    truth = drawn(robot, "hysteresis", "q2", "iwan")
    q = random_poses(robot, np.random.default_rng(7), 1)
    force = np.array([800.0, 300.0, -900.0, 0, 0, 0])
    found = read(robot, campaign_of(robot, q, force * np.array([[0.5], [1.0], [0.5], [0.0]])), truth)
    assert np.linalg.norm(found[3, :3]) > 1e-6
    assert np.linalg.norm(found[2, :3] - found[0, :3]) > 1e-6


@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_the_same_seed_makes_the_same_effect_and_the_same_rows(effect: str, form: str) -> None:
    robot = machine("kr240-2", effect)
    campaign = draw_campaign(np.random.default_rng(1), robot, Wish("lean", "displacement", 3, "true"))
    rows = []
    for _ in range(2):
        truth = draw_truth(np.random.default_rng(3), robot, effect, form=form)
        rows.append((truth, simulate(robot, (truth,), campaign, np.random.default_rng(4)).measured))
    assert rows[0][0] == rows[1][0]
    np.testing.assert_array_equal(rows[0][1], rows[1][1])
    other = draw_truth(np.random.default_rng(33), robot, effect, form=form)
    assert other != rows[0][0]


@pytest.mark.parametrize(("effect", "form"), FORMS)
def test_another_size_changes_the_size_only(effect: str, form: str) -> None:
    robot = machine("kr240-2", effect)
    for place in components(robot, effect):
        truth = draw_truth(np.random.default_rng(3), robot, effect, component=place, form=form)
        small, large, again = (resized(truth, robot, size, 8) for size in (0.2, 0.8, 0.2))
        assert small == again
        assert small != large
        assert (small.effect, small.component, small.form) == (effect, place, form)
        one, other = small.parameters, large.parameters
        assert set(one) == set(other)
        assert all(one[name] * other[name] >= 0.0 for name in one)  # no sign or direction turns
        assert all(isinstance(value, float) for value in other.values())
        left = []
        for size in (0.2, 0.8):  # nothing more is drawn for a larger one
            rng = np.random.default_rng(8)
            EFFECTS[effect].forms[form].draw(DrawRequest(rng, robot, place, form, size))
            left.append(rng.random())
        assert left[0] == left[1]


@pytest.mark.parametrize(("effect", "form"), [pair for pair in FORMS if pair[0] not in UNLOADED_TOO])
def test_no_load_makes_no_displacement(effect: str, form: str) -> None:
    robot = machine("kr240-2", effect)
    truth = draw_truth(np.random.default_rng(2), robot, effect, 0.7, form=form)
    q = random_poses(robot, np.random.default_rng(7), 2)
    found = read(robot, campaign_of(robot, q, np.zeros((2, 6))), truth)
    np.testing.assert_allclose(found, 0.0, atol=1e-11)


def test_effects_sit_where_they_can() -> None:
    serial, closed = load_robot("kr240-2"), load_robot("ir663")
    assert components(serial, "base-compliance") == [None]
    assert components(serial, "joint-compliance") == []  # all its drives are springs
    assert "q5+q6" in components(serial, "joint-coupling")
    assert "link3" in components(serial, "link-bending")
    assert components(closed, "backlash")
    assert components(serial, "gravity-compensator") == ["q2", "q3"]


def test_what_is_another_effect_by_another_name_is_not_asked() -> None:
    serial, closed = load_robot("kr240-2"), load_robot("ir663")
    assert "link0" not in components(serial, "link-bending")  # stands on the ground: the base
    assert "column" not in components(closed, "link-bending")
    geometry = components(serial, "geometry-error")
    assert {"q2", "q3", "f3.d", "f2.alpha"} <= set(geometry)
    # a turned measuring frame; an offset along the tool; lengths along parallel axes, which add
    assert not {"q1", "q6", "f6.r", "f2.r", "f3.r"} & set(geometry)


def test_what_cannot_be_is_refused_in_one_line() -> None:
    robot = load_robot("kr240-2")
    rng = np.random.default_rng(0)
    with pytest.raises(BeamstiffError, match=r"cannot have the effect 'joint-compliance' anywhere"):
        draw_truth(rng, robot, "joint-compliance")
    with pytest.raises(BeamstiffError, match=r"cannot have the effect 'backlash' at 'q9'"):
        draw_truth(rng, robot, "backlash", component="q9")
    with pytest.raises(BeamstiffError, match=r"unknown effect 'backlsh'.*backlash"):
        draw_truth(rng, robot, "backlsh")
    with pytest.raises(BeamstiffError, match="found the form 'fuzzy'"):
        draw_truth(rng, robot, "backlash", form="fuzzy")


def test_every_author_that_wrote_forms_of_an_effect_is_drawn_as_often() -> None:
    rng = np.random.default_rng(0)
    drawn = [author_of(draw_truth(rng, exam_robot("kr240-2", rng), "backlash", 0.5)) for _ in range(300)]
    authors = range(1, 1 + max(drawn))
    assert len(authors) > 1
    assert [np.mean(np.equal(drawn, author)) for author in authors] == pytest.approx(
        [1 / len(authors)] * len(authors), abs=0.1
    )
    # of outliers the second author wrote none
    drawn = [author_of(draw_truth(rng, exam_robot("kr240-2", rng), "outliers", 0.5)) for _ in range(40)]
    assert set(drawn) == {1, 3, 4}


def test_every_form_of_an_effect_is_drawn() -> None:
    robot, rng = exam_robot("kr240-2", np.random.default_rng(0)), np.random.default_rng(1)
    found = {draw_truth(rng, robot, "backlash", 0.5).form for _ in range(400)}
    assert found == set(EFFECTS["backlash"].forms)


def test_no_author_takes_the_name_of_anothers_form() -> None:
    named = [(form.effect, form.name) for author in AUTHORS for form in author.FORMS]
    assert len(named) == len(set(named))
    assert {effect for effect, _ in named} == set(EFFECTS)
    assert not {name for author in AUTHORS[1:] for name in author.PLACES} & {*NAMES, *LATER}


def test_the_third_author_has_forms_of_every_effect() -> None:
    forms = [len(EFFECTS[name].authors[2]) for name in NAMES]
    assert forms == [1 if name == "outliers" else 2 for name in NAMES]
    assert len(AUTHORS[2].PLACES) == 3


def test_truths_carry_their_label() -> None:
    assert Truth("backlash", "q3", "sharp").label == "backlash:q3"
    assert Truth("base-compliance", None, "block").label == "base-compliance:null"
    assert set(EFFECTS) == {*NAMES, *LATER, *(effect.name for effect in OUTSIDE)}
