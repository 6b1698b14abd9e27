"""Robots that measurements are of."""

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from beamstiff.robot.description import Robot


@pytest.fixture(scope="session")
def arm() -> Robot:
    """Return an arm: q1 turns, d2 slides, q3 follows q1; nodes root, elbow and tip."""
    return Robot(
        name="arm",
        variables=[
            {"name": "q1", "type": "revolute", "limits": ["-180 deg", "180 deg"]},
            {"name": "d2", "type": "prismatic"},
            {"name": "q3", "equals": "-q1"},
        ],
        frames=[
            {"name": "f1", "theta": "q1"},
            {"name": "f2", "parent": "f1", "r": "d2"},
            {"name": "f3", "parent": "f2", "d": 1.0, "theta": "q3"},
        ],
        nodes=[{"name": "root"}, {"name": "elbow", "frame": "f2"}, {"name": "tip", "frame": "f3"}],
        rigids=[{"name": "a", "nodes": ["root", "elbow"]}, {"name": "b", "nodes": ["elbow", "tip"]}],
        fixed=["root"],
        tcp="tip",
    )


@pytest.fixture(scope="session")
def four_bar() -> Robot:
    """Return a parallelogram driven by q1, its angles th2 and th3 passive."""
    return Robot(
        name="four-bar",
        variables=[
            {"name": "q1", "type": "revolute"},
            {"name": "th2", "type": "revolute", "passive": True},
            {"name": "th3", "type": "revolute", "passive": True},
        ],
        frames=[
            {"name": "f1", "theta": "q1"},
            {"name": "f2", "parent": "f1", "d": 1.0, "theta": "th2"},
            {"name": "f3", "d": 2.0, "theta": "th3"},
        ],
        loops=[{"name": "loop", "a": "coupler", "b": "rocker", "constrain": "plane"}],
        nodes=[
            {"name": "root"},
            {"name": "coupler", "frame": "f2", "at": [2, 0, 0]},
            {"name": "rocker", "frame": "f3", "at": [1, 0, 0]},
        ],
        rigids=[{"name": "a", "nodes": ["root", "coupler"]}, {"name": "b", "nodes": ["root", "rocker"]}],
        fixed=["root"],
        tcp="coupler",
    )


@pytest.fixture
def kr240(shared_path: Callable[[str], Path]) -> Robot:
    """Return the robot of the practice sets."""
    data = yaml.safe_load(shared_path("practice/kr240.yaml").read_text(encoding="utf-8"))
    del data["beamstiff"]
    return Robot(**data)
