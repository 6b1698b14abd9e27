"""Encoders behind the gears in `calibrate`. Truth: weights wind the drives up by virtual work."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import calibrate
from beamstiff.calibration.result import Calibration
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from tests.identification.test_wind_up import ROBOT as UNLOADED
from tests.identification.test_wind_up import ROBOT_VARIABLES, TRUE, only

WEIGHTS = {"n3b": 400.0, "n5b": 150.0, "tool": 300.0}  # kg
ROBOT = type(UNLOADED).model_validate(
    {key: getattr(UNLOADED, key) for key in type(UNLOADED).model_fields}
    | {"masses": [{"node": node, "mass": mass} for node, mass in WEIGHTS.items()]}
)
SPRINGS = ("J2.torsional", "J3.torsional", "J4.torsional", "J5.torsional", "J6.torsional")
TOOL, ENCODER, SEEDS = 3e-5, 1e-5, 50


def poses(seed: int, count: int = 40, straight: bool = False) -> Measurements:
    """Return positions in a tracker's frame, and encoders with a curve of their own, that read 0 to 2 pi."""
    rng = np.random.default_rng(seed)
    kinematics = compile_kinematics(ROBOT)
    q = rng.uniform([-2, -1.5, 0, -2, -1.5, -2], [2, 0, 2, 2, 1.5, 2], (count, 6))
    q[:, 4] *= not straight
    at = posture(kinematics, q)
    pull = np.array([0, 0, -9.81, 0, 0, 0])
    torque = sum(
        np.einsum("nia,i->na", twist_jacobian(kinematics, at, n), m * pull) for n, m in WEIGHTS.items()
    )
    wound = np.asarray(torque) / TRUE
    place = posture(kinematics, q + wound).node_positions[:, kinematics.node_index["tool"]]
    away = rng.uniform(0, 6, (2, 6))
    curve = 2e-4 * np.sin(q + away[0]) + 1e-4 * np.sin(2 * q + away[1])
    link = q + wound + curve + rng.uniform(-3, 3, 6) + ENCODER * rng.standard_normal(q.shape)
    return make_measurements(
        ROBOT_VARIABLES,
        q,
        tcp=ROBOT.tcp,
        position=place + [0.5, 0.2, 0.1] + TOOL * rng.standard_normal(place.shape),
        sigma_position=TOOL,
        link=np.mod(link, 2 * np.pi),
        source="t.csv",
    )


def fitted(rows: Measurements, **options: object) -> Calibration:
    return calibrate(ROBOT, rows, ["base"], compliances=SPRINGS, folds=0, **options)


def told(found: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and stated std of the compliances over their true values."""
    own = [found[name] for name in SPRINGS]
    std = np.array([np.inf if item.std is None else item.std for item in own])
    return np.array([item.value for item in own]) * TRUE[1:] - 1.0, std * TRUE[1:]


@pytest.mark.slow
def test_compliances_are_recovered_within_their_stated_std() -> None:
    away, gain = [], []
    for seed in range(SEEDS):
        rows = poses(seed)
        (error, std), (_, plain) = told(fitted(only(rows, 1, 2, 4))), told(fitted(only(rows)))
        away.append(error / std)
        gain.append(plain / std)
    size = np.sqrt(np.mean(np.square(away), axis=0))
    within, less = (np.abs(away) < 2).mean(axis=0), np.median(gain, axis=0)
    print(f"{SEEDS} seeds, J2 to J6: RMS error over stated std {size.round(2)}; within two std {within}")
    print(f"std without over with the encoders of q2, q3 and q5: {less.round(2)}")
    assert (size < 1.35).all()  # of 50 draws: more in one of a thousand
    assert less[3] > 3


@pytest.mark.slow
def test_springs_in_series_are_known_by_one_encoder() -> None:
    away = []
    for seed in range(SEEDS):
        rows = poses(seed, straight=True)
        if seed < 3:
            assert np.isinf(told(fitted(only(rows)))[1][[2, 4]]).any()
        error, std = told(fitted(only(rows, 3)))
        assert np.isfinite(std).all()
        away.append(error / std)
    size = np.sqrt(np.mean(np.square(away), axis=0))
    print(f"series: RMS error over stated std {size.round(2)}; std of J4, J6 {std[[2, 4]].round(3)}")
    assert (size < 1.35).all()


def test_folds_and_notes() -> None:
    rows = only(poses(0), 1, 2)
    found = calibrate(ROBOT, rows, ["base"], compliances=SPRINGS, folds=3)
    assert found.held_out is not None
    assert [note.split(" ")[:3] for note in found.notes if "_link" in note] == [
        ["q2_link:", "35", "contrasts"],
        ["q3_link:", "35", "contrasts"],
    ]
    geometry = calibrate(ROBOT, rows, ["base"], folds=0)
    assert "encoders behind the gears are not used: no compliances are sought" in geometry.notes
    unstated = replace(rows, sigma=rows.sigma * np.nan, sigma_position=None)
    assert any("the noise of the positions is not stated" in note for note in fitted(unstated).notes)
    few = subset(rows, np.arange(12))
    few.link[7:, 1] = np.nan
    assert any("q2_link is not used: found 2 independent differences" in note for note in fitted(few).notes)
