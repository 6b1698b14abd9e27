"""Stated postures: S and T, configurations and CONFIG, from axis values as the manuals define them."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.compensation.follow import NO_POSTURE, follow
from beamstiff.compensation.formats import fanuc, krl, rapid
from beamstiff.compensation.posture import Arm, StatedPosture, arm_of
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array

KINEMATICS = compile_kinematics(load_robot("kr500"))  # its variables are KUKA's A1 to A6
FLANGE, UPPER, FORE, OFFSET = 0.29, 1.3, 1.025, 0.055
STRETCHED = np.arctan2(-OFFSET, FORE)  # A3 of the stretched arm


def postures(count: int, seed: int) -> Array:
    """Return axis values all over the ranges, away from the singularities."""
    low, high = np.array([variable.limits for variable in KINEMATICS.robot.actuated]).T
    q = np.random.default_rng(seed).uniform(low, high, (10 * count, 6))
    wrist = pose_of(KINEMATICS, posture(KINEMATICS, q), KINEMATICS.robot.tcp)
    away = np.abs(q[:, 4]) > 0.1
    away &= (np.abs(q[:, 2] - STRETCHED) > 0.1) & (np.abs(in_front(q, wrist)) > 0.1)
    return q[away][:count]


def in_front(q: Array, poses: Array) -> Array:
    """Return how far the wrist is before axis 1; KUKA's A1 turns clockwise."""
    wrist = poses[:, :3, 3] - FLANGE * poses[:, :3, 2]
    return np.asarray(wrist[:, 0] * np.cos(q[:, 0]) - wrist[:, 1] * np.sin(q[:, 0]))


def kuka(q: Array, front: float) -> StatedPosture:
    """Return S and T as the KUKA manual defines them."""
    status = 1 * (front < 0) + 2 * (q[2] >= STRETCHED) + 4 * (q[4] < 0)
    turn = sum(1 << axis for axis in range(6) if q[axis] < 0)
    [place] = krl.read(f"PTP {{X 1,Y 2,Z 3,A 0,B 0,C 0,S 'B{status:b}',T {turn}}}", "a.src").places
    assert place.posture is not None
    return place.posture


def abb(q: Array, front: float) -> StatedPosture:
    """Return the configuration as the RAPID manual defines it; ABB turns axes 1, 4 and 6 the other way."""
    kind = 4 * (front < 0) + 2 * (q[2] < STRETCHED) + 1 * (q[4] < 0)
    quarters = [int(np.floor(-q[axis] / (0.5 * np.pi))) for axis in (0, 3, 5)]
    text = f"p:=[[1,2,3],[1,0,0,0],[{','.join(map(str, quarters))},{kind}],[0,0,0,0,0,0]];"
    [place] = rapid.read(text, "a.mod").places
    assert place.posture is not None
    return place.posture


@pytest.mark.parametrize("stated", [kuka, abb])
def test_of_all_postures_at_a_pose_the_stated_one_is_taken(stated) -> None:
    arm = arm_of(KINEMATICS)
    q = postures(12, 1)
    poses = pose_of(KINEMATICS, posture(KINEMATICS, q), KINEMATICS.robot.tcp)
    fronts = in_front(q, poses)
    said = [stated(one, front) for one, front in zip(q, fronts, strict=True)]
    assert len({one.text for one in said}) > 8
    # whatever the neighbours are: every target from scratch, and all in a row
    found = follow(KINEMATICS, poses, None, arm, said)
    assert not found.reasons
    np.testing.assert_allclose(found.q, q, atol=1e-6)
    assert not found.switched.size


def test_a_posture_beyond_the_ranges_is_told() -> None:
    q = np.radians([[20.0, -60, 100, 30, 50, 20]])
    poses = pose_of(KINEMATICS, posture(KINEMATICS, q), KINEMATICS.robot.tcp)
    found = follow(KINEMATICS, poses, None, arm_of(KINEMATICS), [StatedPosture("S 1", front=False)])
    assert found.reasons == {0: "no posture within the joints' ranges is S 1"}


@pytest.mark.parametrize("stated", [kuka, abb])
def test_where_no_posture_is_as_stated_the_one_that_is_possible_is_written_in_the_programs_language(
    stated,
) -> None:
    """Axis 1 is said to be on the other side, everything else as it is."""
    arm = arm_of(KINEMATICS)
    q = postures(12, 2)
    poses = pose_of(KINEMATICS, posture(KINEMATICS, q), KINEMATICS.robot.tcp)
    for one, pose, front in zip(q, poses, in_front(q, poses), strict=True):
        right, mirrored = stated(one, front), one.copy()
        mirrored[0] = -one[0] - np.copysign(np.pi / 2, one[0]) * (stated is abb)
        wrong = stated(mirrored, front)
        assert wrong != right
        found = follow(KINEMATICS, pose[None], None, arm, [wrong])
        [said] = found.reasons.values()
        told = right.text.removeprefix("configuration ")
        assert said.startswith(f"{NO_POSTURE} {wrong.text}; reachable as {told}, q1 = ")
        assert float(said.split("q1 = ")[1].split()[0]) == pytest.approx(np.degrees(one[0]), rel=6e-3)


def test_the_posture_nearest_the_middle_is_offered_where_zeros_are_stated() -> None:
    """Offline programs state zeros that nobody chose: what is most like these flips the wrist."""
    q = np.radians([[-20.0, -70, 100, 8, -35, 5]])
    pose = pose_of(KINEMATICS, posture(KINEMATICS, q), KINEMATICS.robot.tcp)
    zeros = abb(np.radians([20.0, -70, 100, 8, 35, 5]), True)
    [said] = follow(KINEMATICS, pose, None, arm_of(KINEMATICS), [zeros]).reasons.values()
    own = abb(q[0], True).text.removeprefix("configuration ")
    assert f", or, nearest the middle of the joints' ranges, as {own} (--q " in said
    values = dict(one.split("=") for one in said.rpartition("(--q ")[2].rstrip(")").split(","))
    assert [float(value.removesuffix("deg")) for value in values.values()] == [-20, -70, 100, 8, -35, 5]


def test_what_decides_is_named_axis_by_axis() -> None:
    arm = arm_of(KINEMATICS)
    assert arm is not None
    home = np.radians([[20.0, -90, 90, 0, 90, 0]])
    text = (
        "/POS\nP[1]{{\n GP1:\n UF : 0, UT : 0, CONFIG : '{}',\n X = 1 mm, Y = 2 mm, Z = 3 mm,\n"
        " W = 0 deg, P = 0 deg, R = 0 deg\n}};\n/END\n"
    )

    def told(config: str) -> str:
        [place] = fanuc.read(text.format(config), "a.ls").places
        return arm.reachable_as(place.posture, home)

    right = "CONFIG 'N U T, 0, 0, 0'"
    assert told("N U T, 1, 0, 0") == f"{right}, q1 = 20 deg"
    assert told("F U T, 0, 0, 0") == f"{right}, q5 = 90 deg"
    assert told("N D T, 0, 0, 0") == f"{right}, q3 = 90 deg"
    assert told("N U B, 0, 0, 0") == f"{right}, the wrist in front of axis 1"
    assert told("N U T, 0, 0, 1") == f"{right}, q6 = 0 deg"
    # axis 4 at the border of two quarters: as stated, on either side
    for quarter in (0, -1):
        said = f"p:=[[1,2,3],[1,0,0,0],[0,{quarter},0,0],[0,0,0,0,0,0]];"
        [place] = rapid.read(said, "a.mod").places
        assert arm.reachable_as(place.posture, home) == f"[-1,{quarter},0,0], q1 = 20 deg"
    [place] = krl.read("PTP {X 1,Y 2,Z 3,A 0,B 0,C 0,S 1,T 6}", "a.src").places
    # the arm on the other side: the signs of A2 and A3 are not told
    assert arm.reachable_as(place.posture, home) == "S 2, the wrist in front of axis 1, q3 = 90 deg"


def test_fanuc_counts_turns_of_axis_6_from_a_flange_with_x_upwards() -> None:
    text = (
        "/POS\nP[1]{{\n GP1:\n UF : 0, UT : 0, CONFIG : '{}',\n X = 1 mm, Y = 2 mm, Z = 3 mm,\n"
        " W = 0 deg, P = 0 deg, R = 0 deg\n}};\n/END\n"
    )
    arm = arm_of(KINEMATICS)
    assert isinstance(arm, Arm)

    def fits(config: str, degrees: list[float]) -> bool:
        [place] = fanuc.read(text.format(config), "a.ls").places
        assert place.posture is not None
        return bool(arm.fits(place.posture, np.radians([degrees]))[0])

    # the forearm level, the tool down: no flip, elbow up, front
    home = [0.0, -90, 90, 0, 90, 0]
    assert fits("N U T, 0, 0, 0", home)
    assert not fits("F U T, 0, 0, 0", home)
    assert not fits("N D T, 0, 0, 0", home)
    assert not fits("N U B, 0, 0, 0", home)
    assert fits("F U T, 0, 0, 0", [0, -90, 90, 0, -90, 0])
    # A6 = 100: x of the flange is 80 deg from upwards; A6 = 190 is 10 deg beyond
    assert fits("N U T, 0, 0, 0", [0, -90, 90, 0, 90, 100])
    assert fits("N U T, 0, 0, 0", [0, -90, 90, 300 - 360, 90, 170])
    assert not fits("N U T, 0, 0, 0", [0, -90, 90, 300, 90, 100])
    assert fits("N U T, 0, 1, 0", [0, -90, 90, 300, 90, 100]) != fits(
        "N U T, 0, -1, 0", [0, -90, 90, 300, 90, 100]
    )


@pytest.mark.parametrize("name", ["ir663", "gantry", "stewart", "delta", "palletizer"])
def test_a_robot_without_a_spherical_wrist_is_no_arm(name: str) -> None:
    assert arm_of(compile_kinematics(load_robot(name))) is None


def test_an_arm_counts_alike_however_its_file_counts() -> None:
    arm = arm_of(compile_kinematics(load_robot("kr240-2")))  # q2 = -A2, q3 = -A3 - 90 deg, says its file
    assert arm is not None
    assert arm.sign.tolist()[:4] == [1, -1, -1, 1]
    up = np.radians([[10.0, 90, -150, 20, -60, 15]])
    assert arm.fits(StatedPosture("", True, True, True), up).all()
    assert not arm.fits(StatedPosture("", True, False, True), up).any()
    assert not arm.fits(StatedPosture("", True, True, False), up).any()
