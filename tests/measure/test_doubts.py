"""Mistakes of unit that make a valid table."""

from __future__ import annotations

import re

import pytest

from beamstiff.measure import doubts, parse_measurements
from beamstiff.robot.description import Robot


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("q1,d2,dx\n1,0,0\n90,0,0\n", "t.csv:3: q1: 90 rad is more than two turns.*q1 \\[deg\\]"),
        ("q1,d2,dx\n4,0,0\n", "t.csv:2: q1: 4 rad lies outside the limits -3.14159 to 3.14159"),
        ("q1,d2,dx\n0,0,0.639\n", "t.csv:2: a displacement of 0.639 m is large"),
        ("q1,d2,rx\n0,0,0.5\n", "t.csv:2: a rotation of 0.5 rad is large"),
        ("# sigma_position: 0.03\nq1,d2,dx\n0,0,0\n", "t.csv: sigma_position: 0.03 m is large"),
        ("# sigma_rotation: 0.02\nq1,d2,rx\n0,0,0\n", "t.csv: sigma_rotation: 0.02 rad is large"),
        ("q1,d2,fx,dx\n0,0,1,0\n0,0,-9e6,0\n", "t.csv:3: a load of 9e\\+06 N"),
    ],
)
def test_what_is_hardly_meant_is_told(text: str, part: str, arm: Robot) -> None:
    found = doubts(parse_measurements(text, arm, "t.csv"), arm)
    assert len(found) == 1
    assert re.match(part, found[0])


def test_a_common_table_leaves_no_doubt(arm: Robot) -> None:
    text = "# sigma_position: 0.03 mm\nq1 [deg],d2 [mm],fz,dz [mm],rx [deg]\n90,900,-900,-1.2,0.02\n"
    assert doubts(parse_measurements(text, arm), arm) == ()


def test_an_absolute_table_has_no_large_displacements(arm: Robot) -> None:
    assert doubts(parse_measurements("q1,d2,x,y,z,a,b,c\n0,0,2,1,1,3,0,0\n", arm), arm) == ()
