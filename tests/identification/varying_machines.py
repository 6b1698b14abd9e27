"""KR500s whose joint compliances follow what a test says, for models that let them vary."""

from collections.abc import Callable
from functools import cache

import numpy as np

from beamstiff import Robot, load_robot
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.grid import Cubes
from beamstiff.model.grid_sampling import sample
from beamstiff.model.varying import displaced, ports_at
from beamstiff.robot.kinematics import compile_kinematics

SIGMA = 1e-5
DOWN = np.diag([-1.0, 1.0, -1.0])
HOME = np.deg2rad([0.0, -60.0, 100.0, 0.0, 40.0, 0.0])
WORKSPACE = Cubes(np.array([1.7, -0.6, 0.8]), 0.6, (1, 2, 1))


@cache
def kr500() -> Robot:
    return load_robot("kr500")


def compliances() -> np.ndarray:
    return 1.0 / np.array([kr500().parameter(name) for name in kr500().identify])


@cache
def postures(count: int, seed: int = 0) -> np.ndarray:
    """Return postures with the TCP in the workspace, the tool turned a little."""
    random = np.random.default_rng(seed)
    at = random.uniform(WORKSPACE.low, WORKSPACE.high, (count, 3))
    found = sample(compile_kinematics(kr500()), at, DOWN, [0.0], HOME)
    assert found.reached.all()
    return found.q + random.uniform(-0.1, 0.1, found.q.shape) * [0, 0, 0, 1, 0, 1]


def loads(count: int, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng([seed, 7])
    return random.normal(size=(count, 6)) * [900, 900, 900, 200, 200, 200]


def table(
    q: np.ndarray,
    wrench: np.ndarray,
    change: Callable[[np.ndarray], np.ndarray],
    noise: float = SIGMA,
    seed: int = 0,
    sigma: float | None = SIGMA,
) -> Measurements:
    """Return readings where the logarithms of the six compliances change by `change` of q, (N, 6).

    Of rotations too: the TCP lies on axis 6, whose spring displaces nothing.
    """
    robot = kr500()
    seen = displaced(ports_at(robot, robot.identify, q, wrench), compliances() * np.exp(change(q)))
    seen = seen + noise * np.random.default_rng([seed, 1]).standard_normal(seen.shape)
    names = [variable.name for variable in robot.actuated]
    return make_measurements(
        names, q, tcp=robot.tcp, wrench=wrench, displacement=seen, sigma_position=sigma, sigma_rotation=sigma
    )


def nothing(q: np.ndarray) -> np.ndarray:
    return np.zeros((len(q), 6))


def lever(q: np.ndarray) -> np.ndarray:
    """Return a wave of joint 2's and joint 3's compliance with their own angles."""
    change = np.zeros((len(q), 6))
    change[:, 1] = 0.5 * np.sin(5 * q[:, 1])
    change[:, 2] = 0.4 * np.cos(4 * q[:, 2])
    return change
