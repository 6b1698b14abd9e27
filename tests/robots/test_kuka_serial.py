"""The KR240-2 and the KR 500: six drive springs, C = J diag(1/k) J^T, and what is public of them."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from beamstiff import Robot, load_robot
from beamstiff.robot.kinematics import twist_jacobian
from beamstiff.units import quantity
from tests.robots.machine import at, compliance, inside, limits, point

KR240, KR500 = load_robot("kr240-2"), load_robot("kr500")


@pytest.mark.parametrize("robot", [KR240, KR500], ids=lambda robot: robot.name)
def test_compliance_is_the_springs_seen_through_the_jacobian(robot: Robot) -> None:
    q = inside(robot, 500)
    structure, posture = at(robot, q)
    J = twist_jacobian(structure.kinematics, posture, robot.tcp)
    k = np.array([robot.parameter(f"J{number}.torsional") for number in range(1, 7)])
    expected = (J / k) @ J.swapaxes(1, 2)
    assert np.abs(compliance(robot, q) - expected).max() < 1e-10 * np.abs(expected).max()


def comment_free_rows(path: Path) -> list[dict[str, str]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def test_the_kr240s_stiffness_is_table_2(shared_path: Callable[[str], Path]) -> None:
    rows = comment_free_rows(shared_path("data/kr240_identified.csv"))
    for row in rows:
        assert KR240.parameter(f"J{row['joint']}.torsional") == float(row["stiffness [N*m/rad]"])
    assert len(rows) == len(KR240.identify) == 6


def test_the_kr500s_stiffness_is_that_with_calibrated_kinematics(shared_path: Callable[[str], Path]) -> None:
    rows = {row["case"]: row for row in comment_free_rows(shared_path("data/kr500_identified.csv"))}
    for number in range(1, 7):
        printed = rows["calibrated kinematics"][f"k{number}"]
        assert KR500.parameter(f"J{number}.torsional") == pytest.approx(
            quantity(f"{printed} N*mm/rad", "rotational stiffness"), rel=1e-15
        )


def test_the_kr240s_zones_lie_within_its_limits_and_reach_them(shared_path: Callable[[str], Path]) -> None:
    rows = comment_free_rows(shared_path("data/kr240_zones.csv"))
    low, high = np.degrees(limits(KR240)).T
    for axis, name in ((1, "theta2"), (2, "theta3")):
        assert min(float(row[f"{name}_min"]) for row in rows) == pytest.approx(low[axis])
        assert max(float(row[f"{name}_max"]) for row in rows) == pytest.approx(high[axis])


@pytest.mark.parametrize(("robot", "stretched", "reach"), [(KR240, -90.0, 2.700), (KR500, 0.0, 2.826)])
def test_the_wrist_reaches_as_far_as_its_data_sheet_says(
    robot: Robot, stretched: float, reach: float
) -> None:
    q = np.zeros((2001, 6))
    q[:, 2] = np.radians(np.linspace(stretched - 10, stretched + 10, 2001))
    wrist = point(at(robot, q), "n5b")
    height = 0.675 if robot is KR240 else 1.045
    assert np.hypot(wrist[:, 0], wrist[:, 2] - height).max() == pytest.approx(reach, abs=0.002)


def test_the_kr500_stands_as_its_controller_says() -> None:
    # A1 to A6 all zero: stretched forward, 55 mm below axis 2; A1 counts clockwise from above, A2 downward;
    # A2 = -90, A3 = 90 deg: arm upright, forearm level
    tool = point(
        at(KR500, np.radians([[0] * 6, [90, 0, 0, 0, 0, 0], [0, -90, 90, 0, 0, 0], [0, 20, 0, 0, 0, 0]])),
        "n6b",
    )
    assert tool[0] == pytest.approx([0.500 + 1.300 + 1.025 + 0.290, 0.0, 1.045 - 0.055])
    assert tool[1] == pytest.approx([0.0, -3.115, 0.990])
    assert tool[2] == pytest.approx([0.500 + 1.025 + 0.290, 0.0, 1.045 + 1.300 - 0.055])
    assert tool[3, 2] < 0.5


def test_of_drives_4_and_6_only_the_sum_of_compliances_shows_where_the_wrist_is_stretched() -> None:
    q = inside(KR500, 20)
    k4, k6 = KR500.parameter("J4.torsional"), KR500.parameter("J6.torsional")
    swapped = KR500.with_parameters({"J4.torsional": k6, "J6.torsional": k4})
    C = compliance(KR500, q)
    assert np.abs(compliance(swapped, q) - C).max() > 1e-3 * np.abs(C).max()
    q[:, 4] = 0.0
    C = compliance(KR500, q)
    assert np.abs(compliance(swapped, q) - C).max() < 1e-12 * np.abs(C).max()
