"""A robot written back into its file: what did not change keeps every byte."""

import difflib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff import load_robot, robot_names
from beamstiff.robot.library import robot_path
from beamstiff.robot.parts import AddedEffect, Node, Rigid
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.robot.yaml_edit import edited_yaml, robot_yaml
from beamstiff.units import unit_size

TEXTS = {name: robot_path(name).read_text(encoding="utf-8") for name in robot_names()}
EFFECT = AddedEffect(effect="backlash", component="q2", shape="gap", parameters={"half_width": "2e-4 rad"})


def commented(text: str) -> str:
    """Return a robot's text as a person may have worked on it: remarks on every line, blank lines, blanks."""
    lines = [
        f"{line}   # mine, {at}: é" if line.endswith("}") else line
        for at, line in enumerate(text.splitlines())
    ]
    return "\n\n# by hand\n".join(["\n".join(lines[:40]), "\n".join(lines[40:])]) + "\n# the end\n"


def changes(before: str, after: str) -> list[str]:
    return [
        line for line in difflib.ndiff(before.splitlines(), after.splitlines()) if line[:2] in ("+ ", "- ")
    ]


@pytest.mark.parametrize("name", TEXTS)
def test_a_robot_that_did_not_change_keeps_its_text(name: str) -> None:
    for text in (TEXTS[name], commented(TEXTS[name]), TEXTS[name].replace("\n", "\r\n")):
        assert edited_yaml(text, parse_robot(text), {}) == text


@pytest.mark.parametrize("name", sorted(name for name in TEXTS if load_robot(name).identify))
def test_only_the_numbers_of_the_identified_values_change(name: str) -> None:
    text = commented(TEXTS[name])
    robot = parse_robot(text)
    values = {one: robot.parameter(one) * 1.23456789012345 for one in robot.identify}
    found = edited_yaml(text, robot.with_parameters(values), {})
    assert len(changes(text, found)) <= 2 * len(values)
    for before, after in zip(text.splitlines(), found.splitlines(), strict=True):
        if before == after:
            continue
        parts = difflib.SequenceMatcher(None, before, after).get_opcodes()
        told = "".join(before[a:b] + after[c:d] for kind, a, b, c, d in parts if kind != "equal")
        assert set(told) <= set("0123456789.e"), told
    again = parse_robot(found)
    for one, value in values.items():
        assert again.parameter(one) == pytest.approx(value, rel=1e-14)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(sorted(TEXTS)), st.data())
def test_any_stiffness_is_read_back_as_it_was_meant(name: str, data: st.DataObject) -> None:
    robot = parse_robot(TEXTS[name])
    own = sorted(one for one in stiffness_parameters(robot) if not one.endswith(".E"))
    if not own:
        return
    sizes = st.floats(1e-3, 1e14) | st.sampled_from([0.0, np.inf])
    values = data.draw(st.dictionaries(st.sampled_from(own), sizes, max_size=4))
    found = edited_yaml(TEXTS[name], robot.with_parameters(values), {})
    assert found is not None
    for one, value in values.items():
        assert parse_robot(found).parameter(one) == pytest.approx(value, rel=1e-13)


@pytest.mark.parametrize(
    ("value", "std", "written"),
    [
        (300000.00000000227, None, '"300000 N*m/rad"'),
        (4.2e6, None, '"4.2e6 N*m/rad"'),
        (1.0 / 7.0, None, '"0.142857142857143 N*m/rad"'),
        (3912345.678, 5e4, '"3.912e6 N*m/rad"'),
        (3912345.678, 5e2, '"3.91235e6 N*m/rad"'),
    ],
)
def test_digits_are_those_the_uncertainty_supports(value: float, std: float | None, written: str) -> None:
    robot = load_robot("kr240-2").with_parameters({"J1.torsional": value})
    found = edited_yaml(TEXTS["kr240-2"], robot, {} if std is None else {"J1.torsional": std})
    line = next(line for line in found.splitlines() if "name: J1," in line)
    assert f"torsional: {written}" in line


def test_a_changed_zero_stays_in_degrees_and_a_length_in_millimetres(everything: str) -> None:
    robot = parse_robot(everything)
    before = next(frame for frame in robot.frames if frame.name == "f2")
    moved = before.model_copy(update={"theta": f"q2 - {np.pi / 2 - 0.01!r}", "r": 0.25})
    found = edited_yaml(
        everything,
        robot.model_copy(update={"frames": tuple(moved if one is before else one for one in robot.frames)}),
        {"f2.theta": 1e-4},
    )
    assert found is not None
    (old, new) = [line[2:] for line in changes(everything, found)]
    assert new == old.replace("q2 - 90 deg", "q2 - 89.427 deg").replace("}", ", r: 0.25}")


@pytest.mark.parametrize("name", ["kr500", "ir663", "cantilever"])
def test_effects_come_below_and_the_rest_stays(name: str) -> None:
    text = TEXTS[name]
    once = edited_yaml(text, parse_robot(text).model_copy(update={"effects": (EFFECT,)}), {})
    assert once.startswith(text.rstrip("\n"))
    other = EFFECT.model_copy(update={"component": "q3"})
    twice = edited_yaml(once, parse_robot(once).model_copy(update={"effects": (EFFECT, other)}), {})
    assert twice is not None
    assert {line[0] for line in changes(once, twice)} == {"+"}
    assert parse_robot(twice).effects == (EFFECT, other)


BLOCKS = """# of blocks, with lists that stand as far left as their keys
beamstiff: 1
name: hinge
variables:
- name: q1
  type: revolute
frames:
- name: f1   # the only one
  theta: q1 - 90 deg
nodes: [{name: a}, {name: b, frame: f1}]
joints:
- name: J   # worn
  nodes: [a, b]
  frame: f1
  variable: q1
  stiffness:
    radial: 2e8 N/m
    torsional: 1e6 N*m/rad   # of the data sheet
    # to be measured again
fixed: [a]
tcp: b
identify:
- J.torsional  # first
- J.radial  # second
"""


def test_several_new_parts_come_in_their_order_and_the_rest_stays() -> None:
    robot = load_robot("kr500")
    names = ("z seat", "a seat", "m seat")
    nodes = (*robot.nodes, *(Node(name=name, at=(0.0, 0.0, 1.0)) for name in names))
    rigids = (*robot.rigids, *(Rigid(name=name, nodes=(robot.fixed[0], name)) for name in names))
    changed = robot.model_copy(update={"nodes": nodes, "rigids": rigids})
    found = edited_yaml(TEXTS["kr500"], changed, {})
    assert found is not None
    assert [line for line in TEXTS["kr500"].splitlines() if line not in found.splitlines()] == []
    assert parse_robot(found).nodes[-3:] == nodes[-3:]


def test_a_file_of_blocks_keeps_its_blocks() -> None:
    robot = parse_robot(BLOCKS).with_parameters({"J.torsional": 1.5e6, "J.radial": np.inf, "J.axial": 3e8})
    assert edited_yaml(BLOCKS, robot, {}) == (
        BLOCKS.replace(
            "1e6 N*m/rad   # of the data sheet", "1.5e6 N*m/rad   # of the data sheet\n    axial: 3.0e+08"
        )
        .replace("2e8 N/m", "rigid")
        .replace("- J.radial  # second\n", "")
    )


def test_what_an_alias_shares_is_not_changed_for_all(tmp_path: Path) -> None:
    text = TEXTS["kr240-2"].replace('"3.8e6 N*m/rad"', '&k "3.8e6 N*m/rad"').replace('"6.6e6 N*m/rad"', "*k")
    (tmp_path / "arm.yaml").write_text(text, encoding="utf-8")
    robot = parse_robot(text).with_parameters({"J1.torsional": 1e6})
    assert edited_yaml(text, robot, {}) is None
    assert parse_robot(robot_yaml(robot, tmp_path / "arm.yaml")) == robot


def test_units_have_the_size_that_their_definition_says() -> None:
    for unit, size in {
        "mm": 1e-3,
        "N/mm": 1e3,
        "N*mm/rad": 1e-3,
        "GPa": 1e9,
        "deg": np.pi / 180,
        "kg": 1,
    }.items():
        assert unit_size(unit) == pytest.approx(size, rel=1e-15)
