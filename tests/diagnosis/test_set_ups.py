"""Balls in sockets, diagnosed without a tracker: the machine is moved by plain kinematics."""

import numpy as np

from beamstiff import diagnose
from beamstiff.measure.instruments import target
from beamstiff.measure.table import make_measurements
from beamstiff.planning.seated import seated_postures
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from tests.calibration.machines import machine, machined, serial, variables

REAL = machine(serial(), machined(serial(), 3))
SOCKETS = {"S0": (1.5, 0.3, 1.2), "S1": (1.2, -1.0, 1.6), "S2": (2.0, 0.8, 0.8)}
SCATTER = 2e-3  # rad: of every joint, far beside the noise that the table states
STATED = 3e-5  # m
EACH = 16


def test_a_robot_that_scatters_far_beside_the_stated_noise_does_not_shrink_to_a_point() -> None:
    rng = np.random.default_rng(5)
    held = [
        seated_postures(REAL, target(name, "socket", place=place), EACH, 10 + at)
        for at, (name, place) in enumerate(SOCKETS.items())
    ]
    q = np.concatenate(held)
    rows = make_measurements(
        variables(REAL),
        q + SCATTER * rng.standard_normal(q.shape),
        tcp=REAL.tcp,
        position=np.zeros((len(q), 3)),
        sigma_position=STATED,
        target=np.repeat([*SOCKETS], EACH),
        targets=[target(name, "socket") for name in SOCKETS],
    )
    result = diagnose(serial(), rows)
    kinematics = compile_kinematics(REAL)
    moved = twist_jacobian(kinematics, posture(kinematics, q), REAL.tcp)[:, :3]
    scatter = SCATTER * np.sqrt((moved**2).sum(axis=(1, 2)).mean())
    assert scatter > 50 * STATED
    assert 0.7 * scatter < result.rms < 2.0 * scatter
