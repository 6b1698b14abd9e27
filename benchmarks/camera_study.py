"""Camera, hand-eye or robot: ``python -m benchmarks.camera_study [--cases N] [--seed N]`` (needs OpenCV).

An arm of six random proportions carries a camera and looks at one printed tag from 40 postures; the exam's
mechanics say where its camera is, every image is rendered and read by OpenCV's AprilTag detector and PnP. One
cause is planted: the camera sits elsewhere (hand-eye), the tag is printed too large or the focal length is
wrong (camera scale), the zero of an encoder or a length or twist of a link is off (robot), or none. Counted
is the party that the verdict blames. What sits behind the last joint is hand-eye: an error of the camera's
frame is; and a zero of q6 is not planted, which turns the camera alone.
"""

from __future__ import annotations

import argparse
from collections import Counter

import cv2
import numpy as np

from beamstiff import diagnose
from beamstiff.calibration.corrected import corrected
from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import SimulatedCampaign
from beamstiff.exam.robots import random_arm
from beamstiff.exam.simulate import readings, reality_of
from beamstiff.measure.reader import parse_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import rotation_from_vector, transform

FOCAL, WIDTH, HEIGHT, SIZE = 900.0, 1280, 960, 0.06  # pixels, pixels, m
POSTURES, FINER, GREY = 40, 3, 2.0  # images; sub-pixels of a rendered one along each side; noise of 255
PIXEL = 0.055  # of a detected corner, as found on 150 other images; stated in the table
HALF = 0.4566  # pixels: where this refinement begins to count, as found on them too
PARTIES = ("hand-eye", "camera", "robot", "none")
CAUSES = ("hand-eye", "tag size", "focal length", "joint zero", "link", "none")
BLAMED = dict(zip(CAUSES, ("hand-eye", "camera", "camera", "robot", "robot", "none"), strict=True))


def with_camera(arm: Robot, rng: np.random.Generator) -> Robot:
    """Return an arm whose TCP is a camera that looks away from its flange."""
    made = arm.model_dump(mode="json", exclude_defaults=True)
    angle, far = rng.uniform(-25, 25, 2), rng.uniform(0.03, 0.08, 2)
    frame = {"name": "camera", "parent": "f6", "alpha": f"{angle[0]} deg", "d": far[0]}
    made["frames"].append(frame | {"theta": f"{angle[1]} deg", "r": far[1]})
    made["nodes"].append({"name": "camera", "frame": "camera"})
    made["rigids"].append({"name": "bracket", "nodes": ["n6b", "camera"]})
    return Robot.model_validate(made | {"tcp": "camera"})


def looking(robot: Robot, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a tag's pose (4, 4) and postures (P, 6) from which its camera sees it, from near and far."""
    kinematics = compile_kinematics(robot)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    while True:
        q = low + (high - low) * rng.uniform(0.35, 0.65, 6)
        first = pose_of(kinematics, posture(kinematics, q[None]), robot.tcp)[0]
        flip = np.diag([1.0, -1, -1, 1])
        flip[2, 3] = 0.45
        tag = first @ flip  # faces the camera
        targets = []
        for _ in range(2 * POSTURES):
            tilt = np.array([*rng.uniform(-0.6, 0.6, 2), rng.uniform(-1.5, 1.5)])
            aim = np.array([*rng.uniform(-0.06, 0.06, 2), 0.0])
            turn = rotation_from_vector(tilt) @ np.diag([1.0, -1, -1])
            at = aim - turn @ [0, 0, rng.uniform(0.35, 0.75)]
            targets.append(tag @ transform(turn, at))
        found = inverse_geometry(kinematics, np.array(targets), start=q, tolerance=1e-6, restarts=4)
        if found.reached.sum() >= POSTURES:
            return tag, found.q[found.reached][:POSTURES]


def camera_poses(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return where the exam's mechanics have the camera, (P, 4, 4)."""
    count = len(q)
    name = np.full(count, robot.tcp)
    states = SimulatedCampaign(
        q=q, wrench=np.zeros((count, 6)), pose=np.arange(count), step=np.zeros(count, dtype=np.int64),
        time=60.0 * np.arange(count), temperature=np.full(count, 20.0), point=name, load_point=name,
        kind="absolute", rotations=True,
    )  # fmt: skip
    values = readings(reality_of(robot, ()), states)
    return transform(rotation_from_vector(values[:, 3:]), values[:, :3])


def image(
    seen: np.ndarray, focal: float, size: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a camera sees around a tag whose pose (4, 4) is in its frame, and its first pixel (2,)."""
    lens = np.array([[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]])
    around = (3.2 * size / SIZE * TAG @ seen[:3, :3].T + seen[:3, 3]) @ lens.T
    around = around[:, :2] / around[:, 2:]
    first = np.floor(around.min(axis=0))
    width, height = np.ceil(around.max(axis=0) - first).astype(int).tolist()
    marker = cv2.aruco.generateImageMarker(DICTIONARY, 7, 320)
    marker = cv2.copyMakeBorder(marker, 80, 80, 80, 80, cv2.BORDER_CONSTANT, value=255)
    # of pixels of the marker, by their corners, to the plane of the tag, to finer pixels of the image
    plane = size / 320 * np.array([[1.0, 0, -240], [0, -1, 240], [0, 0, 320 / size]])
    lens[:2, 2] -= first
    finer = np.array([[FINER, 0, FINER / 2 - 0.5], [0, FINER, FINER / 2 - 0.5], [0, 0, 1]])
    half = np.array([[1.0, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    homography = finer @ lens @ seen[:3, [0, 1, 3]] @ plane @ half
    fine = cv2.warpPerspective(
        marker, homography, (FINER * width, FINER * height), flags=cv2.INTER_AREA, borderValue=200
    )
    grey = cv2.GaussianBlur(cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    return np.clip(grey + GREY * rng.standard_normal(grey.shape), 0, 255).astype(np.uint8), first


DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
OPTIONS = cv2.aruco.DetectorParameters()
OPTIONS.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
DETECTOR = cv2.aruco.ArucoDetector(DICTIONARY, OPTIONS)
LENS = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
TAG = 0.5 * SIZE * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])


def corners_of(picture: np.ndarray, first: np.ndarray) -> np.ndarray | None:
    """Return the corners (4, 2) of the tag in an image; None where it is not found."""
    corners, _, _ = DETECTOR.detectMarkers(picture)
    return corners[0].reshape(4, 2).astype(np.float64) + first - HALF if len(corners) == 1 else None


def read(points: np.ndarray) -> np.ndarray:
    """Return position and rotation vector (6,) of the tag whose corners (4, 2) are seen."""
    _, turn, shift = cv2.solvePnP(TAG, points, LENS, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    turn, shift = cv2.solvePnPRefineLM(TAG, points, LENS, None, turn, shift)
    return np.concatenate([shift.ravel(), turn.ravel()])


def table(robot: Robot, cause: str, rng: np.random.Generator) -> str:
    """Return the table of a machine with a cause, as a user would write it."""
    tag, q = looking(robot, rng)
    real, focal, size = robot, FOCAL, SIZE
    sign = rng.choice([-1.0, 1.0])
    if cause == "joint zero":
        real = corrected(robot, {f"q{rng.integers(2, 6)}": sign * rng.uniform(1e-3, 4e-3)}, q[:1])
    elif cause == "link":
        name = rng.choice(["f3.d", "f4.r", "f4.alpha", "f5.alpha"])
        real = corrected(robot, {str(name): sign * rng.uniform(1e-3, 3e-3)}, q[:1])
    elif cause == "tag size":
        size *= 1 + sign * rng.uniform(3e-3, 1e-2)
    elif cause == "focal length":
        focal *= 1 + sign * rng.uniform(3e-3, 1e-2)
    camera = camera_poses(real, q)
    if cause == "hand-eye":
        off = transform(rotation_from_vector(rng.normal(0, 4e-3, 3)), rng.normal(0, 2e-3, 3))
        camera = camera @ off
    lines = ["# camera: on robot", f"# pixel_noise: {PIXEL}", f"# focal_length: {FOCAL}"]
    lines += [f"# tag_size: {SIZE} m", "# orientation: rotation vector"]
    lines.append(",".join([*(f"q{k} [rad]" for k in range(1, 7)), "x [m]", "y [m]", "z [m]", "a", "b", "c"]))
    for at, here in zip(q, np.linalg.inv(camera) @ tag, strict=True):
        points = corners_of(*image(here, focal, size, rng))
        if points is not None:
            lines.append(",".join(map(repr, [*at.tolist(), *read(points).tolist()])))
    return "\n".join(lines) + "\n"


def blamed(effect: str, component: str | None) -> str:
    """Return which party an effect blames."""
    if effect in ("unknown", "none"):
        return effect
    if effect == "camera-scale":
        return "camera"
    behind = effect == "geometry-error" and str(component).startswith("camera.")
    return "hand-eye" if behind or effect in ("hand-eye", "tool-offset") else "robot"


def main() -> None:
    """Print how often the right party is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=20261126)
    options = parser.parse_args()
    said: dict[str, Counter[str]] = {cause: Counter() for cause in CAUSES}
    for number in range(options.cases):
        rng = np.random.default_rng([options.seed, number])
        cause = CAUSES[number % len(CAUSES)]
        robot = with_camera(random_arm(rng), rng)
        robot = robot.with_parameters(dict.fromkeys(robot.identify, np.inf))
        try:
            rows = parse_measurements(table(robot, cause, rng), robot)
            found = diagnose(robot, rows)
        except BeamstiffError as error:
            print(f"{number} {cause}: {error}", flush=True)
            said[cause]["refused"] += 1
            continue
        verdict = found.verdict
        party = blamed(verdict.effect, verdict.component)
        said[cause][party] += 1
        right = "" if party == BLAMED[cause] else "   <- not so"
        print(f"{number} {cause}: {verdict.key} {verdict.probability:.2f}{right}", flush=True)
    print(f"{'planted':14}" + "".join(f"{name:>10}" for name in (*PARTIES, "unknown", "refused")))
    for cause, count in said.items():
        print(f"{cause:14}" + "".join(f"{count[name]:10}" for name in (*PARTIES, "unknown", "refused")))
    with_cause = [(BLAMED[cause], count) for cause, count in said.items() if cause != "none"]
    right = sum(count[party] for party, count in with_cause)
    print(f"right party {right} of {sum(count.total() for _, count in with_cause)} with a cause")


if __name__ == "__main__":
    main()
