"""Loads in a wrong sign or unit, of absolute readings with one load a posture.

Truth: drives of a heavy arm wound up by derivatives of potential energies, read in closed form.
"""

import numpy as np
import pytest

from beamstiff import diagnose
from beamstiff.diagnosis.decomposition.open_model import open_geometry
from beamstiff.diagnosis.misread_loads import misread_loads
from beamstiff.errors import UnusableError
from beamstiff.measure.table import Measurements, make_measurements
from tests.diagnosis.machines import arm_at
from tests.diagnosis.weighed_arm import ROBOT, VARIABLES, held, postures, weights

NOISE = 3e-5  # m
SOFTER = 1.2  # than in the robot file
DRIVES = [f"J{number}.torsional" for number in range(1, 7)]


def campaign(read: float) -> Measurements:
    """Return 60 postures, every third loaded, whose loads the table gives `read` times as large."""
    rng = np.random.default_rng(5)
    q = postures(rng, 60)
    loaded = np.arange(60) % 3 == 2
    down, aside = np.where(loaded, 1200.0, 0.0), np.where(loaded, 300.0, 0.0)
    compliance = SOFTER / np.array([ROBOT.parameter(name) for name in DRIVES])
    weight = weights()
    torque = held(lambda at: weight(at) + down * arm_at(at).tip[:, 2] - aside * arm_at(at).tip[:, 0], q)
    position = arm_at(q - compliance * torque).tip + NOISE * rng.standard_normal((60, 3))
    wrench = np.zeros((60, 6))
    wrench[:, 0], wrench[:, 2] = read * aside, -read * down
    return make_measurements(
        VARIABLES, q, wrench=wrench, position=position, sigma_position=NOISE, tcp=ROBOT.tcp
    )


@pytest.mark.parametrize(
    ("read", "meant"),
    [
        (1.0, ""),
        (-1.0, "loads with fx, fz reversed"),
        (1 / 9.81, "fx fy fz in kg, and read in N"),
        (-1 / 9.81, "fx fy fz in kg and reversed, and read in N"),
        (1e-3, "fx fy fz in kN, and read in N"),
    ],
)
def test_loads_that_were_read_otherwise_are_told(read: float, meant: str) -> None:
    robot = ROBOT.model_copy(update={"identify": tuple(DRIVES[:3])})
    said = misread_loads(open_geometry(robot, campaign(read), balance=False))
    assert meant in said if meant else not said


@pytest.mark.slow
def test_misread_loads_are_refused() -> None:
    with pytest.raises(UnusableError, match="the positions fit loads with fx, fz reversed"):
        diagnose(ROBOT, campaign(-1.0))
