"""The robots that are examined: two bundled ones, a third serial one, and arms of random proportions."""

from typing import Any

import numpy as np

from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.library import robot_path
from beamstiff.robot.parts import Mass
from beamstiff.robot.reader import load_robot

RANDOM_ARM = "random-arm"
ROBOTS = {"kr240-2": 0.35, "kr500": 0.15, RANDOM_ARM: 0.25, "ir663": 0.25}  # and how often each is drawn

# N m/rad, axis 2 of an arm with 1 m reach; the KR240-2 (2.7 m) has 6.6e6 (its paper, table 2), which fixes it
MAIN_AXIS = 3e5
_LIMITS = ((-170, 170), (-20, 130), (-160, 70), (-180, 180), (-115, 115), (-350, 350))


def exam_robot(name: str, rng: np.random.Generator) -> Robot:
    """Return the robot of this name: drawn anew for `RANDOM_ARM`, else the bundled one."""
    return random_arm(rng) if name == RANDOM_ARM else load_robot(robot_path(name))


def random_arm(rng: np.random.Generator) -> Robot:
    """Return a six-axis arm with rigid links, its proportions and drive stiffness drawn.

    Reach from 0.9 to 3 m, with which stiffness grows, each axis' own scattered by two; half without a wrist's
    common centre.

    >>> arm = random_arm(np.random.default_rng(3))
    >>> arm.name, len(arm.joints), arm.identify[0]
    ('random-arm', 6, 'J1.torsional')
    """
    reach = rng.uniform(0.9, 3.0)
    upper = reach * rng.uniform(0.38, 0.5)
    fore = reach * rng.uniform(0.32, 0.42)
    flange = reach * rng.uniform(0.06, 0.13)
    height, shoulder = reach * rng.uniform(0.2, 0.35), reach * rng.uniform(0.0, 0.18)
    elbow = reach * rng.uniform(-0.06, 0.08)
    wrist = reach * rng.uniform(0.03, 0.06) if rng.random() < 0.5 else 0.0
    frames: list[dict[str, Any]] = [
        {"name": "f1", "theta": "q1", "r": height},
        {"name": "f2", "parent": "f1", "alpha": "90 deg", "d": shoulder, "theta": "q2"},
        {"name": "f3", "parent": "f2", "d": upper, "theta": "q3"},
        {"name": "f4", "parent": "f3", "alpha": "-90 deg", "d": elbow, "theta": "q4", "r": fore},
        {"name": "f5", "parent": "f4", "alpha": "90 deg", "theta": "q5", "d": wrist},
        {"name": "f6", "parent": "f5", "alpha": "-90 deg", "theta": "q6", "r": flange},
    ]
    # where each joint lies, seen from the link before it
    ends = [(0.0, 0.0, height), (shoulder, 0.0, 0.0), (upper, 0.0, 0.0), (elbow, fore, 0.0)]
    ends += [(wrist, 0.0, 0.0), (0.0, flange, 0.0)]
    nodes: list[dict[str, Any]] = [{"name": "n0"}]
    main = MAIN_AXIS * reach**3.3 * rng.uniform(0.6, 1.6)
    share = np.array([1.5, 1.0, 1.6, 12.0, 12.0, 14.0]) * np.exp(rng.uniform(-0.7, 0.7, 6))
    joints = []
    for at, (end, less) in enumerate(zip(ends, share, strict=True), start=1):
        parent = "base" if at == 1 else f"f{at - 1}"
        nodes += [{"name": f"n{at}a", "frame": parent, "at": end}, {"name": f"n{at}b", "frame": f"f{at}"}]
        joint = {"name": f"J{at}", "nodes": [f"n{at}a", f"n{at}b"], "frame": f"f{at}", "axis": "z"}
        joints.append({**joint, "variable": f"q{at}", "stiffness": {"torsional": float(main / less)}})
    starts = ["n0", *(f"n{at}b" for at in range(1, 6))]
    variables = [
        {"name": f"q{at}", "type": "revolute", "limits": [f"{limit} deg" for limit in limits]}
        for at, limits in enumerate(_LIMITS, start=1)
    ]
    rigids = [{"name": f"link{at}", "nodes": [start, f"n{at + 1}a"]} for at, start in enumerate(starts)]
    return Robot.model_validate(
        {
            "name": RANDOM_ARM,
            "variables": variables,
            "frames": frames,
            "nodes": nodes,
            "rigids": rigids,
            "joints": joints,
            "fixed": ["n0"],
            "tcp": "n6b",
            "identify": [f"J{at}.torsional" for at in range(1, 7)],
        }
    )


def with_closed_guesses(robot: Robot) -> Robot:
    """Return the robot with its passive variables in the middle of its limits as guesses, in its assembly.

    The simulator starts from them and knows no assembly otherwise. As it is where the middle does not close.
    """
    if not robot.loops:
        return robot
    kinematics = compile_kinematics(robot)
    middle = np.array([sum(item.limits) / 2 if item.limits else 0.0 for item in robot.actuated])
    closure = close_loops(kinematics, middle[None], strict=False)
    if not closure.closed[0]:
        return robot
    found = dict(zip(kinematics.coupling.names, closure.values[0].tolist(), strict=True))
    variables = tuple(
        item.model_copy(update={"guess": found[item.name]}) if item.passive else item
        for item in robot.variables
    )
    return robot.model_copy(update={"variables": variables})


def with_stiff_drive(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return the robot with one drive rigid and no longer identified; as it is where it has but one."""
    drives = [name for name in robot.identify if name.endswith(".torsional")]
    if len(drives) < 2:
        return robot
    stiff = drives[int(rng.integers(len(drives)))]
    left = tuple(name for name in robot.identify if name != stiff)
    return robot.with_parameters({stiff: RIGID}).model_copy(update={"identify": left})


def with_payload(robot: Robot, mass: float, at: tuple[float, float, float]) -> Robot:
    """Return the robot with a mass at its TCP, kg; `at` in the frame of the TCP's node, m."""
    return robot.model_copy(update={"masses": (*robot.masses, Mass(node=robot.tcp, mass=mass, at=at))})
