import numpy as np
import pytest
from scipy import integrate

from tests.diagnosis.machines import FORE, elbow, nominal, rows_of, shape_of

SHARES = np.array([1.0, 0.8, 0.4, 0.2, 0.05, -0.2, -1.0])


def slips(shape: str) -> np.ndarray:
    """Return what the elbow turns by, for shares of the largest torque on it."""
    rows = rows_of(elbow(), [0, 0], SHARES[:, None] * [0, 1500.0, 0, 0, 0, 0])
    columns = shape_of(nominal(elbow(), rows), "hardening", "q2", shape).columns
    np.testing.assert_allclose(columns[:, 1], FORE * columns[:, 5], atol=1e-12)
    return columns[:, 5]


def test_a_cubic_drive_gives_less_by_the_cube_of_its_torque() -> None:
    assert slips("cubic")[:, 0] == pytest.approx(-(SHARES**3))


def test_a_square_drive_gives_less_by_the_square_to_either_side() -> None:
    assert slips("square")[:, 0] == pytest.approx(-SHARES * np.abs(SHARES))


@pytest.mark.parametrize("knee", [0.05, 0.1, 0.25, 0.5])
def test_a_soft_windup_ends_at_its_knee(knee: float) -> None:
    found = slips(f"knee at {knee:g}")[:, 0]
    beyond = np.abs(SHARES) >= knee
    assert found[beyond] == pytest.approx(np.sign(SHARES[beyond]))
    assert found[~beyond] == pytest.approx(SHARES[~beyond] / knee)


@pytest.mark.parametrize("over", [0.03, 0.05, 0.08, 0.12, 0.2])
def test_a_drive_that_hardens_smoothly_has_a_stiffness_that_grows_towards_its_own(over: float) -> None:
    found = slips(f"smooth, over {over:g}")[:, 0]
    # it gives more at small torque by a share that fades exponentially: its windup is the integral
    windup = [integrate.quad(lambda t: np.exp(-t / over) / over, 0, abs(share))[0] for share in SHARES]
    assert found == pytest.approx(np.sign(SHARES) * windup, rel=1e-6)


def test_several_knees_make_any_drive_of_five_straight_lines() -> None:
    columns = slips("several knees")
    knees, levels = [0, 0.05, 0.1, 0.25, 0.5, 1], [0, 0.3, 0.5, 0.8, 1.0, 1.0]
    curve = np.interp(np.abs(SHARES), knees, levels) * np.sign(SHARES)
    left = curve - columns @ np.linalg.lstsq(columns, curve)[0]
    np.testing.assert_allclose(left, 0, atol=1e-12)


def test_each_side_winds_up_by_itself() -> None:
    columns, both = slips("several knees, other ones to each side"), slips("several knees")
    up, down = columns[:, 0::2], columns[:, 1::2]
    np.testing.assert_allclose(up + down, both, atol=1e-15)
    assert not up[SHARES < 0].any()
    assert not down[SHARES > 0].any()
