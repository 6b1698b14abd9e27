"""Damaged files of other programs: one line of refusal, or a result; never a crash."""

import random
from collections.abc import Callable

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.point_lists import parse_points
from beamstiff.measure.profiles import parse_profile
from beamstiff.measure.text import split_table
from beamstiff.robot.dh_tables import parse_csv_table, parse_yaml_table
from beamstiff.robot.sdf import parse_sdf
from beamstiff.robot.urdf.reader import parse_urdf
from beamstiff.robot.urdf.writer import robot_to_urdf
from tests.malformed import damaged
from tests.robot.urdf_texts import EVERYTHING

URDF = EVERYTHING.replace("<dynamics", '<beamstiff torsional="1e6 N*m/rad"/><dynamics').replace(
    "</robot>", '<beamstiff tcp="jaw_a">gravity: [0, 0, -9.8]\nmasses: []\n</beamstiff></robot>'
)
SDF = """<sdf version="1.9"><model name="arm"><link name="foot"/><link name="tip"><pose>0 0 0.4 0 0 0</pose>
<inertial><pose>0.1 0 0.2 0 0 0</pose><mass>5</mass></inertial></link>
<joint name="yaw" type="revolute"><pose>0 0.1 0 0 0 0</pose><parent>foot</parent><child>tip</child>
<axis><xyz expressed_in="foot">0 0 1</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis>
<beamstiff torsional="1e6 N*m/rad"/></joint></model></sdf>
"""
CSV = """# convention: classic
name,theta [deg],d [mm],a [mm],alpha [deg],torsional [N*m/rad]
f1,q1,450,150,90,2e6
f2,q2 + 90,0,600,0,1e6
f3,,q3,100,90,
"""
YAML = """convention: modified
rows:
  - {theta: q1 + 10 deg, d: 400 mm, torsional: 1e6 N*m/rad}
  - {alpha: -90 deg, a: 50 mm, d: q2 + 100 mm, axial: rigid}
"""
PROFILE = """comment: "//"
separator: whitespace
columns: {pose: 1, point: 2, x: 3, y: 4, z: 5}
units: {length: mm}
points: {S1: tip, S2: tip}
"""
POINTS = "// made up\nP1 S1 1 2 3\nP2 S2 4 5 6\n"
JOINTS = "pose,q1 [deg],fz [N]\nP2,20,-500\nP1,10,0\n"


READERS: dict[str, tuple[str, Callable[[str], object]]] = {
    "urdf": (URDF, lambda text: robot_to_urdf(parse_urdf(text))),
    "sdf": (SDF, parse_sdf),
    "csv": (CSV, parse_csv_table),
    "yaml": (YAML, parse_yaml_table),
    "profile": (PROFILE, lambda text: parse_points(POINTS, parse_profile(text))),
    "points": (POINTS, lambda text: parse_points(text, parse_profile(PROFILE))),
    "joints": (
        JOINTS,
        lambda text: parse_points(POINTS, parse_profile(PROFILE), "p", split_table(text, "j")),
    ),
}


@pytest.mark.parametrize("kind", READERS)
def test_a_damaged_file_is_read_or_refused_in_one_line(kind: str) -> None:
    text, read = READERS[kind]
    read(text)
    generator = random.Random(7)
    refused: list[str] = []
    for _ in range(150):
        try:
            read(damaged(text, generator, [text]))
        except BeamstiffError as error:
            refused.append(str(error))
    assert len(refused) > 30
    assert all(message.isprintable() and len(message) < 800 for message in refused)
