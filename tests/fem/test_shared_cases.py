"""Every linear frame of the shared benchmark list, read from its file, which names the source of each."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff.robot.parts import Material
from beamstiff.robot.sections import Section
from tests.fem.builders import displacement, frame

FILE = "real/frame_benchmarks/cases.json"
# in units of the last digit that is printed; sources round on the way, Frame3DD adds geometric stiffness
FRAMES = {"logan_5_8": 1.0, "ferreira_8_3": 0.51, "kassimali_6_6": 1.0, "frame3dd_exB_lc1": 2.0}


def last_digit(printed: float) -> float:
    """Return one unit of the last digit that a number is printed with; of a bare 0 the sixth decimal's."""
    mantissa, _, exponent = (repr(float(printed)) if printed else "0.000000").partition("e")
    decimals = len(mantissa.partition(".")[2]) if not mantissa.endswith(".0") else 0
    return float(10.0 ** (int(exponent or 0) - decimals))


def in_space(vector: list[float]) -> list[float]:
    """Return a plane load [fx, fy, mz] or point [x, y] as one in space."""
    return {2: [*vector, 0.0], 3: [vector[0], vector[1], 0.0, 0.0, 0.0, vector[-1]]}[len(vector)]


def across(case: dict[str, Any], i: int, j: int) -> tuple[float, ...]:
    """Return a direction in the plane of the member and its local y."""
    axis = np.subtract(case["nodes"][j], case["nodes"][i])
    if "axis_rule" in case:  # there y is up x axis, with up = z, or x for members along z
        return tuple(np.cross([1, 0, 0] if axis[:2].tolist() == [0, 0] else [0, 0, 1], axis))
    return (-axis[1], axis[0], 0.0) if len(axis) == 2 else (0.3, 0.2, 0.1)


@pytest.fixture(scope="module")
def cases(shared_path: Callable[[str], Path]) -> dict[str, dict[str, Any]]:
    listed = json.loads(shared_path(FILE).read_text())["cases"]
    return {case["id"]: case for case in listed}


@pytest.mark.parametrize("name", FRAMES)
def test_frame_agrees_to_the_printed_digits(cases: dict[str, dict[str, Any]], name: str) -> None:
    case = cases[name]
    plane = case.get("plane") == "xy"
    second = case.get("I", 0.0)
    section = Section(
        A=case["A"],
        Iy=case.get("Iy", second),
        Iz=case.get("Iz", second),
        J=case.get("J", 1.0),
        Ay=case.get("Asy"),
        Az=case.get("Asz"),
    )
    (node, load), *_ = case["loads"].items()
    robot = frame(
        [in_space(point) if plane else point for point in case["nodes"]],
        beams=[tuple(pair) for pair in case["elements"]],
        fixed=case["fixed"],
        tcp=int(node),
        section=section,
        material=Material(E=case["E"], G=case.get("G", case["E"])),
        up=[across(case, i, j) for i, j in case["elements"]],
    )
    found = displacement(robot, {f"n{node}": in_space(load) if plane else load})
    printed = np.array(case[f"expect_node{node}"])
    digits = np.array([last_digit(value) for value in printed])
    wrong = np.abs((found[[0, 1, 5]] if plane else found) - printed) / digits
    assert (wrong <= FRAMES[name]).all(), wrong


def test_truss_agrees_to_the_printed_digits(cases: dict[str, dict[str, Any]]) -> None:
    case = cases["kassimali_8_1_truss"]
    points = np.array(case["nodes"], dtype=float)
    struts = [
        (i, j, case["E"] * case["A"] / float(np.linalg.norm(points[j] - points[i])))
        for i, j in case["elements"]
    ]
    aside = [(900.0, 0, 0), (900.0, 0, 1)]  # the TCP needs a rotation
    robot = frame([*points.tolist(), *aside], struts=struts, beams=[(5, 6)], fixed=(0, 1, 2, 3, 5))
    found = displacement(robot, {"n4": [*case["loads"]["4"], 0, 0, 0]}, "n4")[:3]
    assert found == pytest.approx(case["expect_node4"], abs=5.1e-6)
