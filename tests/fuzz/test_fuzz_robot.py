"""Mutated robot files: a robot whose every number is one, or one line that says what is wrong, always."""

from __future__ import annotations

import math
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

WORDS = r"""
nan .nan inf -.inf 1e999 -1e999 1e308 -1e308 1e-320 1e200 1e-200 -1 0 -0.0 0.0 '' "" [] {} [[]] null ~ true no
1:30 010 0x1F 1,5 % ° rigid free Rigid &a *a <<: << --- ... q1 q1*q1 q1/0 pi base é 日本 # | > ' " \ ` @ , :
__import__('os').abort()
"""
NASTY = [
    *WORDS.split(),
    *(
        "",
        " ",
        "{a: }",
        "5 parsec",
        "5 deg",
        "5 mm",
        "5 N*m/rad",
        "1e5 N/mm**9",
        "5 m/m",
        "&a [*a]",
        "<<: *steel",
    ),
    *(
        "!!python/object/apply:os.abort []",
        "!!binary aa==",
        "! a",
        "2*q1 + 1e308*q1 + 1e308*q1",
        "%YAML 9.9\n---\n",
    ),
    *("x" * 5000, "9" * 400, "1e" + "9" * 300, "+".join(["q1"] * 200)),
    *("[" * 300, "{a: " * 300, "- " * 300, "? " * 300),
    *("\t", "\n", "\r", "\r\n", "\x00", "\x07", "\x1b[31m", "\x7f", "\x85", "\u2028", "\ufeff", "\u202e"),
    *("\u0661", "\uff11", "\U0001f916", " #", ": ", "- ", "? ", "\n  - ", "\n- ", "\n    ", ", ,"),
]
TOKEN = re.compile(r"\"[^\"]*\"|'[^']*'|[\w.+*/^-]+|[^\w\s]")


@st.composite
def mutated(draw: st.DrawFn) -> bytes:
    """Draw a robot file with one to four faults."""
    text = draw(st.sampled_from(SEEDS))
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(
            st.sampled_from(["token", "token", "nasty", "swap", "insert", "line", "indent", "cut", "splice"])
        )
        tokens = list(TOKEN.finditer(text)) if kind in ("token", "nasty", "swap") else []
        lines = text.split("\n")
        if tokens:
            one = tokens[draw(st.integers(0, len(tokens) - 1))]
            other = tokens[draw(st.integers(0, len(tokens) - 1))][0]
            with_text = {"token": other, "nasty": draw(st.sampled_from(NASTY))}.get(kind, other[::-1])
            text = text[: one.start()] + with_text + text[one.end() :]
        elif kind == "insert":
            at = draw(st.integers(0, len(text)))
            text = text[:at] + draw(st.sampled_from(NASTY) | st.text(max_size=5)) + text[at:]
        elif kind == "line":  # away, twice, or elsewhere
            line = lines.pop(draw(st.integers(0, len(lines) - 1)))
            for _ in range(draw(st.integers(0, 2))):
                lines.insert(draw(st.integers(0, len(lines))), line)
            text = "\n".join(lines)
        elif kind == "indent":
            at = draw(st.integers(0, len(lines) - 1))
            lines[at] = draw(st.sampled_from(["", " ", "  ", "    ", "\t", "- "])) + lines[at].lstrip()
            text = "\n".join(lines)
        elif kind == "cut":
            text = text[: draw(st.integers(0, len(text)))]
        elif kind == "splice":
            other_text = draw(st.sampled_from(SEEDS))
            text += "\n" + other_text[draw(st.integers(0, len(other_text))) :]
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 2]))):
        if data:
            data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    return bytes(data)


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
    assert message == f"{path}: is empty" or (line and 1 <= int(line[1]) <= breaks + 2)
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


@settings(ALL, max_examples=2_000)
@given(data=mutated())
def test_mutated_files_are_robots_or_one_line(data: bytes, file: Path) -> None:
    event("a robot" if check_file(data, file) else "refused")


@pytest.mark.slow
@settings(ALL)
@given(data=mutated())
def test_ten_thousand_mutated_files_are_robots_or_one_line(data: bytes, file: Path) -> None:
    event("a robot" if check_file(data, file) else "refused")


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
