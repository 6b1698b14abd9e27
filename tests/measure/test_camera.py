"""Poses of a tag in the frame of a camera, read as poses of the robot."""

import numpy as np
import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.camera import corner_noise, unscaled
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.robot.description import Robot
from beamstiff.se3 import rotation_from_vector
from tests.seen_by_camera import FLIP, poses, rigid_arm, seen

TURNED_BACK = rotation_from_vector(-np.array([1e-5, -2e-5, 3e-5]))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return rigid_arm()


@pytest.mark.parametrize("where", ["on robot", "fixed"])
def test_poses_are_those_of_the_robot_in_the_frame_of_what_stands(robot: Robot, where: str) -> None:
    rows = parse_measurements(seen(robot, where=where, scale=0.01), robot)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    stands = poses(robot, 0.5 * (low + high)[None])[0] @ FLIP
    there = np.linalg.inv(stands) @ poses(robot, rows.q)
    plain = unscaled(rows, {"camera.scale": 0.01})
    np.testing.assert_allclose(plain.position, there[:, :3, 3], atol=1e-12)
    np.testing.assert_allclose(rotation_from_vector(rows.rotation), there[:, :3, :3], atol=1e-12)
    np.testing.assert_allclose(rows.position - plain.position, -0.01 * plain.sight, atol=1e-12)


def test_noise_of_corners_is_that_of_poses_found_by_projecting() -> None:
    """Monte Carlo over noisy corners, linear about the pose; depth and turns grow with the range."""
    rng = np.random.default_rng(0)
    at, turn = np.array([0.05, -0.02, 0.6]), np.array([0.3, 0.2, 0.4])
    corners = 0.05 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])

    def project(pose: np.ndarray) -> np.ndarray:
        points = corners @ rotation_from_vector(pose[3:]).T + pose[:3]
        return (900 * points[:, :2] / points[:, 2:]).ravel()

    start = np.concatenate([at, turn])
    slopes = np.stack([(project(start + h) - project(start - h)) / 2e-6 for h in 1e-6 * np.eye(6)], axis=1)
    found = np.linalg.pinv(slopes) @ (0.1 * rng.standard_normal((8, 20000)))
    stated = corner_noise(at[None], turn[None], 0.1, 900.0, 0.1)[0]
    np.testing.assert_allclose(stated[:3], found[:3].std(axis=1), rtol=0.03)
    # of turns about the camera's axes the vector's own differ by the rate of turning: compare the sizes
    assert 0.8 < np.linalg.norm(stated[3:]) / np.linalg.norm(found[3:].std(axis=1)) < 1.2
    ahead = np.array([[0.0, 0.0, 0.6]])
    near, far = (corner_noise(k * ahead, turn[None], 0.1, 900.0, 0.1)[0] for k in (1, 2))
    assert far[2] > 3.5 * near[2]
    assert far[0] < 2.5 * near[0]


def test_a_camera_on_the_robot_that_turns_sees_the_tag_move(robot: Robot) -> None:
    rows = parse_measurements(seen(robot), robot)
    motion = np.zeros((len(rows), 6))
    motion[:, 3:] = [1e-5, -2e-5, 3e-5]
    back = rotation_from_vector(rows.rotation).swapaxes(1, 2)
    before, after = ((back @ turn @ rows.sight[..., None])[..., 0] for turn in (np.eye(3), TURNED_BACK))
    read = rows.along(motion)[:, :3]
    np.testing.assert_allclose(read[:, 0], (before - after)[:, 2], atol=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(read, axis=1), np.linalg.norm(after - before, axis=1), atol=1e-9
    )
    fixed = parse_measurements(seen(robot, where="fixed"), robot)
    np.testing.assert_array_equal(fixed.along(motion)[:, :3], 0.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("# camera: on robot", "# camera: on tripod", "found 'on tripod', expected on robot or fixed"),
        ("# tag_size: 100 mm\n", "", "pixel_noise: expected all of pixel_noise focal_length tag_size"),
        ("# focal_length: 900", "# focal_length: -3", "focal_length: found '-3', expected a positive number"),
        ("x,y,z,a,b,c", "x,y,z,remark,point,pose", "expected x y z and an orientation"),
        ("x,y,z,a,b,c", "dx,dy,dz,rx,ry,rz", "camera: found in a table of displacements"),
    ],
)
def test_bad_tables_are_refused(robot: Robot, old: str, new: str, message: str) -> None:
    text = seen(robot).replace(old, new)
    if "remark" in new:
        text = "\n".join(
            line if line.startswith("#") or "remark" in line else f"{line.rsplit(',', 3)[0]},,,{at}"
            for at, line in enumerate(text.splitlines())
        )
    with pytest.raises(BeamstiffError, match=message):
        parse_measurements(text, robot)


def test_a_tag_behind_the_camera_is_refused(robot: Robot) -> None:
    rows = seen(robot).splitlines()
    cells = rows[6].split(",")
    cells[8] = "-0.5"
    with pytest.raises(BeamstiffError, match="behind the camera"):
        parse_measurements("\n".join([*rows[:6], ",".join(cells), *rows[7:]]), robot)


def test_rows_of_a_camera_are_not_written_as_those_of_a_tracker(robot: Robot) -> None:
    with pytest.raises(BeamstiffError, match="rows that a camera read are not written"):
        measurements_to_csv(parse_measurements(seen(robot), robot), robot)
