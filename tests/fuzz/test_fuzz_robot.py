"""Mutated robot files: a robot whose every number is one, or one line that says what is wrong, always."""

import math
import random
import re
import time
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from beamstiff.errors import BeamstiffError
from beamstiff.robot.coupling import coupling, frame_expressions
from beamstiff.robot.description import Robot
from beamstiff.robot.graph import parts_without_support, structure_graph
from beamstiff.robot.parts import JointStiffness, Strut
from beamstiff.robot.reader import load_robot, parse_robot
from beamstiff.robot.sections import section_properties
from beamstiff.robot.writer import robot_to_yaml
from tests.malformed import NASTY, TOKEN, damaged

EVERYTHING = (Path(__file__).parents[1] / "robot" / "everything.yaml").read_text(encoding="utf-8")
# the same keys in block style, with anchors, quotes and comments of every kind
BLOCK = """%YAML 1.1
---
beamstiff: 1   # the format
name: 'Portal''s end'
materials:
  "steel": &steel
    E: 210 GPa
    G: 8.0e+10
  other: *steel
sections:
  tube:
    shape: tube
    outer: 300 mm
    wall: 1.2e-2
variables:
- name: q
  type: prismatic
  limits:
  - -1.5
  - 1500 mm
- {name: p, equals: "0.5*q + 1 mm"}
frames:
- name: slide
  d: q
  gamma: 90 deg
- name: tool
  parent: slide
  b: p
  theta: "2 rad/m * q"
nodes:
- name: foot
- name: head
  at: &up [0, 0, "1000 mm"]
- {name: carriage, frame: slide}
- name: end
  frame: slide
  at: *up
beams:
- name: column
  nodes: [foot, head]
  section: tube
  material: steel
  up:
    - 1
    - 0
    - 0
- name: beam
  nodes: [carriage, end]
  section: tube
  material: other
joints:
- name: rail
  nodes: [head, carriage]
  frame: slide
  axis: X
  variable: q
  stiffness:
    axial: 2e8 N/m
    radial: 1e9
    torsional: rigid
    tilting: 1.5e6 N*m/deg
fixed:
- foot
tcp: end
identify: ["rail.axial"]
...
"""
FLOW = (
    '{"beamstiff": 1, "name": "j", "nodes": [{"name": "a"}, {"name": "b", "at": [1, 2, 3.0]}, {"name": "c"}],'
    '"rigids": [{"name": "r", "nodes": ["a", "b"]}], "frames": [{"name": "f", "beta": -1e-3}], '
    '"joints": [{"name": "k", "nodes": ["a", "c"], "frame": "f", "stiffness": {"torsional": "free"}}], '
    '"masses": [{"node": "b", "mass": 5}], "fixed": ["a"], "tcp": "b"}'
)
SEEDS = [EVERYTHING, BLOCK, FLOW]


def numbers(value: Any, stiffness: bool = False) -> None:
    """Check that every number is finite; only a stiffness may be infinite: rigid."""
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            of_stiffness = isinstance(value, JointStiffness) or (
                isinstance(value, Strut) and name == "stiffness"
            )
            numbers(getattr(value, name), of_stiffness)
    elif isinstance(value, dict):
        for item in value.values():
            numbers(item)
    elif isinstance(value, tuple):
        for item in value:
            numbers(item)
    elif isinstance(value, float):
        assert not math.isnan(value)
        assert value >= 0.0 if stiffness else math.isfinite(value)


def check_robot(robot: Robot) -> None:
    """Check what every robot promises, whatever its file looked like."""
    numbers(robot)
    for section in robot.sections.values():
        assert all(value is None or 0 < value < math.inf for value in astuple(section_properties(section)))
    for expressions in frame_expressions(robot).values():
        for expression in expressions.values():
            assert all(map(math.isfinite, [expression.constant, *expression.coefficients.values()]))
    coupled = coupling(robot)
    assert np.isfinite(coupled.matrix).all()
    assert np.isfinite(coupled.offset).all()
    assert all(0 < robot.parameter(name) < math.inf for name in robot.identify)
    assert parts_without_support(structure_graph(robot), robot.fixed) == []
    assert parse_robot(robot_to_yaml(robot)) == robot


def check_file(data: bytes, path: Path) -> bool:
    """Check what is made of a file; return whether it is a robot."""
    path.write_bytes(data)
    start = time.process_time()
    try:
        robot = load_robot(path)
    except BeamstiffError as error:
        message: str | None = str(error)
    else:
        message = None
        check_robot(robot)
    assert time.process_time() - start < 5.0
    if message is None:
        return True
    assert message.startswith(f"{path}:")
    assert message.isprintable()
    assert len(message) < 1000
    line = re.match(r":(\d+): ", message.removeprefix(str(path)))
    # as many lines as libyaml counts: it takes the breaks of Unicode for such too
    breaks = len(re.findall("\r\n|[\n\r\x85\u2028\u2029]", data.decode("utf-8", "replace")))
    assert message.startswith(f"{path}: is empty, expected ") or (line and 1 <= int(line[1]) <= breaks + 2)
    return False


def test_the_seeds_are_robots() -> None:
    for seed in SEEDS:
        check_robot(parse_robot(seed))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz") / "robot.yaml"


ALL = settings(
    max_examples=10_000, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
)


def mutated(source: random.Random) -> bytes:
    """Return a robot file with one to four faults, and some bytes that are others."""
    data = bytearray(damaged(source.choice(SEEDS), source, SEEDS).encode("utf-8", "surrogatepass"))
    for _ in range(source.choice([0, 0, 0, 1, 2]) if data else 0):
        data[source.randrange(len(data))] = source.randrange(256)
    return bytes(data)


@settings(ALL, max_examples=2_000)
@given(source=st.randoms(use_true_random=False))
def test_mutated_files_are_robots_or_one_line(source: random.Random, file: Path) -> None:
    event("a robot" if check_file(mutated(source), file) else "refused")


@pytest.mark.slow
@settings(ALL)
@given(source=st.randoms(use_true_random=False))
def test_ten_thousand_mutated_files_are_robots_or_one_line(source: random.Random, file: Path) -> None:
    event("a robot" if check_file(mutated(source), file) else "refused")


@pytest.mark.parametrize("nasty", NASTY, ids=[ascii(nasty)[1:20] for nasty in NASTY])
def test_values_replaced_by_something_nasty(nasty: str, file: Path) -> None:
    for seed in SEEDS:
        # every 41st token, others for every nasty text: in the end all meet much
        tokens = list(TOKEN.finditer(seed))
        for token in tokens[NASTY.index(nasty) % 41 :: 41]:
            check_file((seed[: token.start()] + nasty + seed[token.end() :]).encode(), file)


@given(data=st.binary(max_size=300) | st.text(max_size=200).map(lambda text: text.encode("utf-8", "ignore")))
def test_any_bytes_are_refused_in_one_line(data: bytes, file: Path) -> None:
    assert not check_file(data, file)
