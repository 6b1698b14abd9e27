"""What changed between two campaigns: against least squares written down again, and planted changes."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

import beamstiff
from beamstiff import BeamstiffError, Robot, compare_runs
from beamstiff.diagnosis.changes import campaign_fit, compare_fits, holm
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import rotation_from_vector

SIGMA = 2e-5
POSTURES = np.random.default_rng(5).uniform([-1, 0.3, -2, -1, 0.3, -1], [1, 1.5, -1, 1, 1.2, 1], (60, 6))


def moved(robot: Robot, seed: int, sigma: float | None = SIGMA) -> Measurements:
    """Return displacements of a machine from its compliance at the tool, half of the postures a seed."""
    random = np.random.default_rng(seed)
    q = POSTURES[seed % 2 :: 2]
    force = random.normal(size=(len(q), 3))
    wrench = np.concatenate(
        [2000 * force / np.linalg.norm(force, axis=1)[:, None], np.zeros((30, 3))], axis=1
    )
    read = np.einsum("nij,nj->ni", beamstiff.tcp_compliance(robot, q), wrench)[:, :3]
    read += random.normal(0, SIGMA, read.shape)
    names = [one.name for one in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, wrench=wrench, displacement=read, sigma_position=sigma)


def placed(
    robot: Robot, seed: int, zero: float = 0.0, tool: float = 0.0, payload: float = 0.0
) -> Measurements:
    """Return positions in a frame of the campaign's own: forward kinematics, and the payload's deflection."""
    random = np.random.default_rng(seed)
    q = random.uniform([-1, -2, 0.5, -1, 0.3, -1], [1, -1, 2, 1, 1.2, 1], (60, 6))
    real = q + np.array([0, 0, zero, 0, 0, 0])
    tcp = beamstiff.forward_kinematics(robot, real)
    weight = np.array([0, 0, -9.81 * payload, 0, 0, 0])
    at = tcp[:, :3, 3] + tool * tcp[:, :3, 0] + (beamstiff.tcp_compliance(robot, real) @ weight)[:, :3]
    at = at @ rotation_from_vector(random.normal(size=3)).T + random.normal(size=3)
    names = [one.name for one in robot.actuated]
    at += random.normal(0, SIGMA, at.shape)
    return make_measurements(names, q, tcp=robot.tcp, position=at, sigma_position=SIGMA)


def test_the_statistic_is_the_likelihood_ratio_of_two_sets_of_parameters_against_one() -> None:
    random = np.random.default_rng(0)
    columns = [random.normal(size=(n, 4)) for n in (30, 50)]
    seen = [one @ [1.0, 2.0, 3.0, 4.0 + k] + random.normal(size=len(one)) for k, one in enumerate(columns)]

    def squares(matrix: Any, right: Any) -> float:
        return float(np.linalg.lstsq(matrix, right)[1][0])

    # the fourth column is nuisance: each campaign has one of its own
    (ca, cb), (ya, yb) = columns, seen
    own = np.block([[ca[:, 3:], np.zeros((30, 1))], [np.zeros((50, 1)), cb[:, 3:]]])
    together = np.column_stack([np.concatenate([ca[:, :3], cb[:, :3]]), own])
    ratio = squares(together, np.concatenate(seen)) - squares(ca, ya) - squares(cb, yb)
    fits = [campaign_fit(y, c, np.zeros(3), 3, True) for c, y in zip(columns, seen, strict=True)]
    assert all(fit.freedom is None for fit in fits)  # the noise is 1, as stated
    found = compare_fits(list("abc"), ["m"] * 3, np.full(3, np.inf), fits[0], fits[1], 0.05)
    assert found.statistic == pytest.approx(ratio, rel=1e-9)
    assert found.p == pytest.approx(stats.chi2.sf(ratio, 3))
    np.testing.assert_allclose(fits[0].values, np.linalg.lstsq(ca, ya)[0][:3])


def test_scatter_that_no_noise_is_stated_for_makes_it_an_f_test() -> None:
    random = np.random.default_rng(1)
    columns = random.normal(size=(40, 2))
    fits = [
        campaign_fit(columns @ [1.0, 2.0] + 7 * random.normal(size=40), columns, np.zeros(2), 2, False)
        for _ in range(2)
    ]
    found = compare_fits(["a", "b"], ["m"] * 2, np.full(2, np.inf), fits[0], fits[1], 0.05)
    scale = [fit.noise**2 for fit in fits]
    assert min(scale) > 20
    assert found.freedom == (2, 38)
    inverse = columns.T @ columns / sum(scale)
    change = fits[1].values - fits[0].values
    assert found.statistic == pytest.approx(change @ inverse @ change / 2)
    assert found.p == pytest.approx(stats.f.sf(found.statistic, 2, 38))


def test_what_one_campaign_does_not_determine_is_not_compared() -> None:
    random = np.random.default_rng(2)
    both, blind = random.normal(size=(20, 2)), random.normal(size=(20, 2)) * [1, 0]
    fits = [campaign_fit(one.sum(axis=1), one, np.zeros(2), 2, True) for one in (both, blind)]
    found = compare_fits(["a", "b"], ["m"] * 2, np.full(2, np.inf), fits[0], fits[1], 0.05)
    assert [one.name for one in found.changes] == ["a"]
    assert found.not_compared == ("b",)
    with pytest.raises(BeamstiffError, match="no parameter is determined by both"):
        compare_fits(
            ["a", "b"],
            ["m"] * 2,
            np.full(2, np.inf),
            fits[1],
            campaign_fit(both[:, 1], both * [0, 1], np.zeros(2), 2, True),
            0.05,
        )


def test_holms_example() -> None:
    """Four p-values, adjusted by hand: 4 p_1, then the larger of that and 3 p_2, and so on."""
    np.testing.assert_allclose(holm(np.array([0.04, 0.01, 0.03, 0.005])), [0.06, 0.03, 0.06, 0.02])


def test_a_softer_spring_is_named_with_its_compliance() -> None:
    robot = beamstiff.load_robot("kr240-2")
    stiff = robot.parameter("J2.torsional")
    softer = robot.with_parameters({"J2.torsional": 0.7 * stiff})
    found = compare_runs(robot, moved(robot, 0), moved(softer, 1))
    assert found.changed
    assert [one.name for one in found.changes if one.changed] == ["1/J2.torsional"]
    one = next(one for one in found.changes if one.changed)
    assert abs(one.a - 1 / stiff) < 4 * one.std
    assert abs(one.change - (1 / 0.7 - 1) / stiff) < 4 * one.std
    assert found.to_dict()["test"] == "wald-chi-square"
    assert found.not_compared == ("1/J6.torsional",)  # forces at a point of axis 6 never load it


def test_a_zero_a_tool_and_a_payload_that_changed_are_named_though_the_tracker_moved() -> None:
    payload = AddedEffect(effect="payload-error", shape="mass", parameters={"mass": "100 kg"})
    robot = beamstiff.load_robot("kr500")
    known = robot.model_copy(update={"effects": (payload,)})
    before = placed(robot, 0, payload=100.0)

    def named(later: Measurements) -> dict[str, float]:
        found = compare_runs(known, before, later, ["base", "offsets", "target"])
        return {one.name: one.change for one in found.changes if one.changed}

    assert named(placed(robot, 1, payload=100.0)) == {}
    assert named(placed(robot, 2, zero=5e-4, payload=100.0)) == {"q3": pytest.approx(5e-4, rel=0.1)}
    tool = named(placed(robot, 3, tool=3e-4, payload=100.0))
    assert np.linalg.norm(list(tool.values())) == pytest.approx(3e-4, rel=0.1)
    assert {name.partition(".")[0] for name in tool} == {robot.tcp}
    assert named(placed(robot, 4, payload=200.0)) == {"payload-error:null": pytest.approx(1.0, rel=0.2)}


def test_what_does_not_go_together_is_refused() -> None:
    robot = beamstiff.load_robot("kr240-2")
    rows, other = moved(robot, 0), placed(robot, 0)
    with pytest.raises(BeamstiffError, match="expected the same kind"):
        compare_runs(robot, rows, other)
    with pytest.raises(BeamstiffError, match="compliances: is of absolute positions"):
        compare_runs(robot, rows, rows, compliances=["J2.torsional"])
    with pytest.raises(BeamstiffError, match="level: found 2"):
        compare_runs(robot, rows, rows, level=2)
