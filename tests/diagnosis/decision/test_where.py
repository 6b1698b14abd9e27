from dataclasses import replace

import numpy as np
import pytest

from beamstiff.diagnosis.decision.where import where
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.held_out.explained import explanations
from tests.diagnosis.machines import at_random, elbow, nominal, rows_of
from tests.diagnosis.planted import diagnosed, plan

PLACES = {
    "link_bending": {"link2", "link1", "q2", "q3"},  # a link and the bearings at its ends do much the same
    "base_compliance": {"base", "link0", "link1", "q1"},  # and what stands on it
    "backlash": {"q3"},
    "hysteresis": {"q3"},
    "actuator_lever": {"q2"},
}
QUICK = ("link_bending", "hysteresis")  # of structure and drive; the others by `make slow`


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in PLACES]
)
def test_the_place_of_the_effect_has_the_largest_share(name: str) -> None:
    shares = diagnosed(name).where["components"]
    assert shares[0]["component"] in PLACES[name]
    assert sum(item["share"] for item in shares if item["component"] in PLACES[name]) > 0.5


@pytest.mark.parametrize("name", list(PLACES))
def test_what_a_sure_cause_explains_is_at_its_place(name: str) -> None:
    found = diagnosed(name)
    effect, verdict = EFFECTS[found.verdict.effect], found.verdict
    (place,) = effect.places(verdict.component)
    share = {item["component"]: item["share"] for item in found.where["components"]}[place]
    assert share >= verdict.probability * verdict.shrink.explained_fraction - 1e-9


def test_two_causes_share_the_gap_by_what_each_moves() -> None:
    there = diagnosed("backlash")
    (fit,) = there.fits[:1]
    own = fit.shapes[0]
    other = replace(
        own, hypothesis=replace(own.hypothesis, effect="hardening", component="q2")
    )  # as large as the first
    pair = replace(fit, shapes=(own, other), theta=np.tile(fit.theta[: own.hypothesis.sizes.size], 2))
    (found,) = explanations(there.linear, [there.verdict], there.verdict, [pair])
    assert found.probability == there.verdict.probability
    half = 0.5 * there.verdict.shrink.explained_fraction
    assert dict(found.share) == pytest.approx({"q3": half, "q2": half})


def test_no_cause_leaves_less_than_what_is_said_no_cause_can() -> None:
    for name in (None, *PLACES):
        found = diagnosed(name)
        left = [one.shrink.after for one in found.candidates if one.shrink is not None]
        assert found.ceiling <= min(found.rms, *left)


@pytest.mark.parametrize("name", [None, *PLACES])
def test_shares_are_sorted_and_lie_in_their_intervals(name: str | None) -> None:
    shares = [item["share"] for item in diagnosed(name).where["components"]]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) <= 1 + 1e-9
    for item in diagnosed(name).where["components"]:
        low, high = item["interval"]
        assert 0 <= low <= item["share"] <= high <= 1


def test_the_gap_is_split_by_direction_load_and_time() -> None:
    found = diagnosed("backlash")
    there, where = found.baseline, found.where
    gap = 1e3 * there.gap[:, :3]
    assert where["directions"] == pytest.approx(dict(zip("xyz", np.sqrt((gap**2).mean(axis=0)), strict=True)))
    size = np.linalg.norm(gap, axis=1)
    force = np.linalg.norm(there.rows.wrench[:, :3], axis=1)
    first = next(iter(where["loads"].items()))
    low, high = (float(value) for value in first[0].removesuffix(" N").split(" to "))
    some = (force > low - 1) & (force < high + 1)
    assert first[1] == pytest.approx(np.sqrt((size[some] ** 2).mean()))
    assert set(where["history"]) == {"loading", "unloading"}
    assert len(where["time"]) == 3
    assert set(where["joints"]) == {f"q{k}" for k in range(1, 7)}


def test_the_gap_is_split_by_where_the_tool_was() -> None:
    found = diagnosed("backlash")
    there, tip = found.baseline, plan().arm.tip
    size = 1e6 * (there.gap[:, :3] ** 2).sum(axis=1)
    assert set(found.where["regions"]) == set("xyz")
    for k, axis in enumerate("xyz"):
        thirds = [name.removesuffix(" m").split(" to ") for name in found.where["regions"][axis]]
        for (low, high), rms in zip(thirds, found.where["regions"][axis].values(), strict=True):
            some = (tip[:, k] > float(low) - 1e-3) & (tip[:, k] < float(high) + 1e-3)
            assert rms == pytest.approx(np.sqrt(size[some].mean()))


def test_the_worst_postures_come_first() -> None:
    found = diagnosed("link_bending")
    rms = [item["rms_mm"] for item in found.where["poses"]]
    assert rms == sorted(rms, reverse=True)
    size = 1e6 * (found.baseline.gap[:, :3] ** 2).sum(axis=1)
    whole = [np.sqrt(size[found.baseline.rows.pose == pose].mean()) for pose in range(10)]
    assert rms[0] == pytest.approx(max(whole))
    assert found.where["poses"][0]["pose"] == int(np.argmax(whole))


def test_a_drift_shows_in_time() -> None:
    values = list(diagnosed("thermal_drift").where["time"].values())
    assert max(values) > 1.2 * min(values)


def test_times_of_two_tables_are_of_two_clocks() -> None:
    rows = at_random(elbow(), 12, seed=1, time=np.tile(10.0 * np.arange(6), 2))
    rows = replace(rows, run=np.repeat([0, 1], 6), sources=("a.csv", "b.csv"))
    there = nominal(elbow(), rows)
    seen = replace(there, measured=np.repeat([1e-3, 2e-3], 6)[:, None] * np.ones(6) + there.predicted)
    found = where(seen, seen.used, [])["time"]
    thirds = ("0 to 10", "20 to 30", "40 to 50")
    assert list(found) == [f"{name}.csv: {part} s" for name in "ab" for part in thirds]
    assert list(found.values()) == pytest.approx(np.sqrt(3) * np.repeat([1.0, 2.0], 3))  # mm


def test_thirds_of_what_hardly_varies_have_names_of_their_own() -> None:
    q = np.repeat([[1.23401, 0.5], [1.23402, 0.5], [1.23403, 0.5]], 4, axis=0)
    rows = at_random(elbow(), 12, seed=1, time=1.7e9 + 5.0 * np.arange(12))  # seconds since 1970
    there = nominal(elbow(), replace(rows, q=q))
    found = where(there, there.used, [])
    assert set(found["joints"]["q1"]) == {"1.23401", "1.23402", "1.23403"}
    assert "q2" not in found["joints"]
    assert len(found["time"]) == 3


def test_loads_that_differ_by_rounding_are_one_level() -> None:
    wrench = np.tile([300.0, 0, 0, 0, 0, 0], (6, 1))
    wrench[::2, 0] += 1e-11
    there = nominal(elbow(), rows_of(elbow(), at_random(elbow(), 6, seed=1).q, wrench))
    assert list(where(there, there.used, [])["loads"]) == ["300 N"]
