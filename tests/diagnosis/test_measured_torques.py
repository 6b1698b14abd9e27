"""Measured torques. Truth: derivatives of potential energies by central differences, friction by hand."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import calibrate, diagnose, identify, load_robot
from beamstiff.diagnosis.effects.torque_laws import axis_at
from beamstiff.diagnosis.measured_torques import BESIDE_EFFECTS, Said, measured_torques
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.drive_torques import drive_torques
from beamstiff.model.linear import predict_displacements
from beamstiff.se3 import Array
from benchmarks.torque_study import campaign
from tests.added import added
from tests.diagnosis.machines import arm_at, lift
from tests.diagnosis.weighed_arm import (
    CENTRE,
    MASSES,
    ROBOT,
    TOOL,
    UPPER,
    VARIABLES,
    Energy,
    balancer,
    held,
    postures,
    weights,
)

NOISE, OFFSET, GAIN = 0.01, 0.03, 0.03  # of what a joint holds
COUNT, SEEDS = 40, 50


def readings(
    seed: int, *energies: Energy, friction: float = 0.0, count: int = COUNT, wrench: Array | None = None
) -> Measurements:
    """Return rows with torques to 1 %, offsets and gains to 3 % of what a joint holds; friction likewise."""
    rng = np.random.default_rng(seed)
    q = postures(rng, count)
    torque = sum(held(one, q) for one in energies or (weights(),))
    acts = np.zeros((count, 6)) if wrench is None else wrench
    torque = torque - arm_at(q).torque(acts)
    size = np.sqrt(np.mean(held(weights(), q) ** 2, axis=0)) + 1.0
    way = np.sign(np.diff(q, axis=0, prepend=q[:1]))
    torque = torque * (1 + GAIN * rng.standard_normal(6)) + friction * size * way
    torque += size * (OFFSET * rng.standard_normal(6) + NOISE * rng.standard_normal(q.shape))
    return make_measurements(
        VARIABLES, q, tcp=ROBOT.tcp, position=np.zeros((count, 3)), wrench=acts, torque=torque, source="t.csv"
    )


def named(said: Said) -> set[str]:
    """Return the effects that torques make likely."""
    return {key for key, share in said.given.items() if share > 0.5}


def told(said: Said) -> str:
    return " | ".join((*said.doubts, *said.notes))


def test_statics_of_the_model_are_derivatives_of_the_potential_energy() -> None:
    q = postures(np.random.default_rng(0), COUNT)
    acts = np.random.default_rng(1).standard_normal((COUNT, 6)) * 300.0
    rows = make_measurements(VARIABLES, q, tcp=ROBOT.tcp, position=np.zeros((COUNT, 3)), wrench=acts)
    stated, loads = drive_torques(ROBOT, rows)
    size = np.abs(held(weights(), q)).max()
    np.testing.assert_allclose(sum(one.torque for one in stated), held(weights(), q), atol=1e-6 * size)
    np.testing.assert_allclose(loads, -arm_at(q).torque(acts), atol=1e-9 * size)
    upper = next(one for one in stated if one.frame == "f2")  # 40 kg more, 0.625 m along the arm
    more = held(weights(upper=UPPER + 40.0), q) - held(weights(), q)
    np.testing.assert_allclose(upper.unit @ [40.0, 25.0, 0.0, 0.0], more, atol=1e-6 * size)


def test_the_force_of_a_slide_is_the_weight_that_it_carries() -> None:
    robot = lift()
    rows = make_measurements(
        [one.name for one in robot.actuated], [[0.3, 2.0, 0.2, -0.4]], tcp="tool", position=np.zeros((1, 3))
    )
    stated, _ = drive_torques(robot, rows)
    assert sum(one.torque[0, 1] for one in stated) == pytest.approx(65.0 * 9.81)


@pytest.mark.slow
def test_clean_torques_name_nothing() -> None:
    false = []
    for seed in range(SEEDS):
        said = measured_torques(ROBOT, readings(seed, friction=0.02 * (seed % 3)))
        if said.doubts:
            false.append(seed)
        assert any("agree with weights and loads" in note for note in said.notes) != bool(said.doubts)
    print(f"{len(false)} of {SEEDS} clean campaigns doubted: {false}")
    assert len(false) <= 1


def test_a_payload_is_found_with_its_mass_whatever_gains_offsets_signs_and_friction() -> None:
    away = []
    for seed in range(20):
        rng = np.random.default_rng([1, seed])
        more = rng.choice([-1, 1]) * rng.uniform(20, 50)
        moved = CENTRE + rng.uniform(-0.05, 0.05, 3)
        rows = readings(seed, weights(tool=TOOL + more, centre=moved), friction=0.05)
        said = measured_torques(ROBOT, replace(rows, torque=rows.torque * rng.choice([-1.0, 1.0], 6)))
        assert named(said) == {"payload-error:null"}
        (found,) = re.findall(r"fits with ([\d.e+]+) ± ([\d.]+) kg (more|less)", told(said))
        sign = 1 if found[2] == "more" else -1
        away.append((sign * float(found[0]) - more) / float(found[1]))
        assert said.sure
        (at,) = re.findall(r"centre of this at \(([^)]*)\) mm from the TCP", told(said))
        moment = sign * float(found[0]) * 1e-3 * np.array([float(part) for part in at.split(",")])
        known = 0.2 * TOOL * np.linalg.norm(CENTRE)  # twice the std of the sensors' gains
        np.testing.assert_allclose(moment, (TOOL + more) * moved - TOOL * CENTRE, atol=known)
        if seed < 3:  # whichever way the sensors count
            assert named(measured_torques(ROBOT, rows)) == named(said)
    size = float(np.sqrt(np.mean(np.square(away))))
    print(f"20 payloads, 20 to 50 kg off: RMS error over stated std {size:.2f}")
    assert size < 1.6


def test_a_balancer_is_likely_and_said_to_look_like_another_weight() -> None:
    shares = []
    for seed in range(20):
        rng = np.random.default_rng([2, seed])
        spring = balancer(rng.uniform(2e4, 4e4), rng.uniform(0.0, 0.2))
        said = measured_torques(ROBOT, readings(seed, weights(), spring, friction=0.05))
        shares.append(said.given["gravity-compensator:q2"])
        assert named(said) <= {"gravity-compensator:q2"}
        assert "looks alike" in told(said) or "or an equal weight" in told(said)
    print(
        f"balancers: probability {np.quantile(shares, [0.0, 0.5]).round(2)} (least, median), before it .015"
    )
    assert min(shares) > 0.1
    assert np.median(shares) > 0.5


def test_a_link_of_another_weight_is_no_payload_and_hardly_a_balancer() -> None:
    for seed in range(20):
        said = measured_torques(ROBOT, readings(seed, weights(upper=1.25 * UPPER)))
        assert not named(said)
        assert said.given["gravity-compensator:q2"] < 0.15
        assert "what hangs on frame f" in told(said)


def test_wrong_loads_are_told_from_a_wrong_payload() -> None:
    rng = np.random.default_rng(4)
    acts = np.concatenate([rng.standard_normal((COUNT, 3)) * 2000.0, np.zeros((COUNT, 3))], axis=1)
    for seed in range(5):
        rows = readings(seed, wrench=1.1 * acts)  # of a cell that reads a tenth too little
        said = measured_torques(ROBOT, replace(rows, wrench=acts))
        assert named(said) == {"load-error:null"}
        (gain,) = re.findall(r"\(gain ([\d.]+), ", told(said))
        assert float(gain) == pytest.approx(0.1, abs=0.03)
        assert not named(measured_torques(ROBOT, replace(rows, wrench=1.1 * acts)))


def test_friction_is_told_by_joint_and_makes_lost_motion_a_little_likelier() -> None:
    rows = readings(0, friction=0.05)
    only = rows.torque.copy()
    only[:, [0, 1, 3, 4, 5]] = readings(0).torque[:, [0, 1, 3, 4, 5]]
    said = measured_torques(ROBOT, replace(rows, torque=only))
    (note,) = (note for note in said.notes if "friction" in note)
    (size,) = re.findall(r"direction of the last motion, q3 ([\d.]+) N\*m$", note)
    assert float(size) == pytest.approx(0.05 * np.sqrt(np.mean(held(weights(), rows.q)[:, 2] ** 2)), rel=0.2)
    assert said.given["approach-direction:q3"] == 0.2
    assert not said.doubts


def changed(change: Callable[[Array], None]) -> Measurements:
    rows = readings(0, weights(tool=TOOL + 40.0))
    change(rows.torque)
    return rows


def equal(torque: Array) -> None:
    torque[:, 1] = 7.0


def unread(torque: Array) -> None:
    torque[9:, 1] = np.nan


def other_side(torque: Array) -> None:
    torque /= 150.0


def millimetres(torque: Array) -> None:
    torque[:, 1] *= 1e3


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (equal, "tau_q2 is not used: all readings are equal"),
        (unread, "tau_q2 is not used: found 9 readings at rest, expected 10"),
        (other_side, "tau_q2 is not used: it changes 0.00"),
        (millimetres, "tau_q2 is not used: it changes 1e+03 times as much"),
    ],
)
def test_readings_that_say_nothing_are_left_out_and_why(change: Callable[[Array], None], why: str) -> None:
    said = measured_torques(ROBOT, changed(change))
    assert why in told(said)
    assert "tau_q1 is not used: weight and loads make it hold the same everywhere" in told(said)


def test_a_joint_without_a_sign_of_its_own_is_refused_where_others_differ() -> None:
    rows = readings(0)
    rows.torque[:, 1] = np.random.default_rng(0).standard_normal(COUNT) * 5e3
    assert "q2 is not used" not in told(measured_torques(ROBOT, rows))  # its sign is that of the others
    rows.torque[:, 2] *= -1.0
    assert "tau_q2 is not used: its sign cannot be found: correlation" in told(measured_torques(ROBOT, rows))


def test_nothing_is_said_without_weights_readings_or_beside_effects() -> None:
    assert measured_torques(ROBOT, replace(readings(0), torque=np.full((COUNT, 6), np.nan))) == Said()
    bare = ROBOT.model_copy(update={"masses": MASSES[3:]})
    assert "states no weight of the links" in told(measured_torques(bare, readings(0)))
    slack = added("backlash:q2", "flank within 0.03", {"torque": 2000.0}, half_width=1e-4)
    loose = ROBOT.model_copy(update={"effects": (slack,)})
    assert measured_torques(loose, readings(0)).notes == (BESIDE_EFFECTS,)


@pytest.mark.slow
def test_positions_are_judged_by_what_the_torques_say() -> None:
    rows = campaign(2, "balancer")
    unread = replace(rows, torque=np.full_like(rows.torque, np.nan))
    found, without = (diagnose(ROBOT, one) for one in (rows, unread))
    assert (found.verdict.effect, found.verdict.component) == ("gravity-compensator", "q2")
    assert without.verdict.effect == "angle-curve"
    assert any("torques differ from those of the stated weights" in note for note in found.notes)
    assert not any("torques" in note for note in without.notes)


def test_where_stiffness_is_sought_torques_that_contradict_are_noted() -> None:
    rows = campaign(0, "payload")
    fits = [calibrate(ROBOT, rows, folds=0, compliances=some).notes for some in ((), ["J2.torsional"])]
    named = [any("payload-error, which fits" in note for note in notes) for notes in fits]
    assert named == [False, True]
    acts = np.random.default_rng(0).standard_normal((COUNT, 6)) * [900, 900, 900, 0, 0, 0]
    for energy, doubted in ((weights(), False), (weights(tool=TOOL + 40.0), True)):
        read = readings(0, energy, wrench=acts)
        moved = predict_displacements(ROBOT, read)
        table = replace(read, kind="displacement", displacement=moved, sigma=np.full_like(moved, 1e-5))
        notes = identify(ROBOT, table, folds=0).notes
        assert any("payload-error, which fits with" in note for note in notes) == doubted
        assert any("measured torques" in note for note in notes) == doubted  # agreement goes without saying


def test_a_closed_loop_is_held_as_its_structure_says() -> None:
    """Truth: equilibrium of the elastic structure (`fem`), not virtual work."""
    robot = load_robot("palletizer")
    q = np.random.default_rng(0).uniform([-1, -0.3, 0, -1], [1, 0.7, 0.6, 1], (6, 4))
    acts = np.random.default_rng(1).standard_normal((6, 6)) * 500.0
    variables = [one.name for one in robot.actuated]
    rows = make_measurements(variables, q, tcp=robot.tcp, wrench=acts, position=np.zeros((6, 3)))
    stated, loads = drive_torques(robot, rows)
    baseline = fit_baseline(robot, rows, keep=())
    for at, name in enumerate(variables):
        axis = axis_at(baseline, name)
        for own, passed in ((loads[:, at], axis.load), (sum(one.torque[:, at] for one in stated), axis.dead)):
            scale = np.abs(axis.load).max()
            sign = -1.0 if np.sum(axis.load * loads[:, at]) < 0.0 else 1.0
            np.testing.assert_allclose(sign * own, passed, atol=1e-6 * scale)
