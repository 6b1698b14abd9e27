"""Tables of a tag's poses as a camera reads them, exact but for noise: what a user would write."""

import numpy as np

from beamstiff import load_robot
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array, rotation_from_vector, transform, vector_from_rotation

FLIP = transform(np.diag([1.0, -1, -1]), np.array([0.02, -0.03, 1.0]))  # a tag that faces the camera


def rigid_arm() -> Robot:
    """Return the KR240-2 with rigid drives."""
    robot = load_robot("kr240-2")
    return robot.with_parameters(dict.fromkeys(robot.identify, np.inf)).model_copy(update={"identify": ()})


def seen(
    robot: Robot,
    real: Robot | None = None,
    *,
    where: str = "on robot",
    off: Array | None = None,
    scale: float = 0.0,
    noise: float = 0.0,
    count: int = 40,
    seed: int = 0,
) -> str:
    """Return a table of `count` postures.

    `real`: the machine. `off` (4, 4): how what is on the robot sits against its TCP. `scale`: how much longer
    distances read. `noise`: of corners, pixels, as the table says.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = 0.5 * (low + high) + 0.1 * rng.standard_normal((count, len(low)))
    q[:, 3:] += 0.1 * rng.standard_normal(q[:, 3:].shape)
    tip = poses(real or robot, q) @ (np.eye(4) if off is None else off)
    stands = poses(robot, 0.5 * (low + high)[None])[0] @ FLIP  # the tag, or a fixed camera
    tag = np.linalg.inv(tip) @ stands if where == "on robot" else np.linalg.inv(stands) @ tip
    from beamstiff.measure.camera import corner_noise

    position, turned = (1 + scale) * tag[:, :3, 3], vector_from_rotation(tag[:, :3, :3])
    std = corner_noise(position, turned, noise or 1.0, 900.0, 0.1) * bool(noise)
    error = std * rng.standard_normal(std.shape)
    turned = vector_from_rotation(rotation_from_vector(error[:, 3:]) @ tag[:, :3, :3])
    lines = [f"# camera: {where}", "# orientation: rotation vector"]
    lines += [f"# pixel_noise: {noise or 0.05}", "# focal_length: 900", "# tag_size: 100 mm"]
    lines.append(",".join([*(f"{one.name} [rad]" for one in robot.actuated), "x,y,z,a,b,c"]))
    values = np.hstack([q, position + error[:, :3], turned])
    return "\n".join([*lines, *(",".join(map(repr, row)) for row in values.tolist())]) + "\n"


def poses(robot: Robot, q: Array) -> Array:
    """Return the TCP's poses (P, 4, 4)."""
    kinematics = compile_kinematics(robot)
    return pose_of(kinematics, posture(kinematics, q), robot.tcp)
