"""Columns and beams under load against closed forms: Timoshenko and Gere, Theory of Elastic Stability.

Articles are those of its second edition. At the critical load the tangent stiffness stops being positive
definite. Under axial forces one element a beam is exact; in lateral buckling the elements approach the
critical load with the second power of their length.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from beamstiff import BeamstiffError, Material, Robot, Section
from beamstiff.fem.beam_column import coarse_beams
from beamstiff.fem.geometric_stiffness import loaded_compliance, loaded_displacement
from beamstiff.fem.static_response import nodal_loads
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.se3 import Array
from tests.fem.builders import FREE, RIGID, at_rest, frame, solve, some_rotation, turned

LENGTH = 2.0
STEEL = Material(E=210e9, G=80e9, density=7850.0)
ROD = Section(A=1e-4, Iy=2e-8, Iz=1e-8, J=2e-8)
BLADE = Section(A=1e-4, Iy=1e-5, Iz=1e-9, J=2e-9)
EI = STEEL.E * 1e-8
BLADE_EI, BLADE_GJ = STEEL.E * 1e-9, STEEL.G * 2e-9

# directions of (axial, radial, torsional, tilting)
HINGE, ROLLER = (RIGID, RIGID, RIGID, FREE), (FREE, RIGID, RIGID, FREE)
SLIDING_CLAMP = (FREE, RIGID, FREE, RIGID)
X = (1.0, 0.0, 0.0)


def line(elements: int, section: Section, tcp: int, supports: Sequence[Sequence[float]] = ()) -> Robot:
    """Return a beam along x, clamped at its start, or held at both ends by joints of the given stiffness."""
    points = [(LENGTH * at / elements, 0.0, 0.0) for at in range(elements + 1)]
    ends = (0, elements) if len(supports) == 2 else (elements,)
    joints = [
        (len(points) + at, end, X, how) for at, (end, how) in enumerate(zip(ends, supports, strict=False))
    ]
    points += [points[end] for end in ends[: len(supports)]]
    fixed = [joint[0] for joint in joints] + ([0] if len(supports) < 2 else [])
    parts = {"beams": [(at, at + 1) for at in range(elements)], "joints": joints}
    return frame(points, fixed=fixed, tcp=tcp, section=section, material=STEEL, up=(0, 1, 0), **parts)


def loaded(robot: Robot, loads: Mapping[str, Sequence[float]], factor: float) -> Array:
    structure = compile_structure(robot)
    return loaded_compliance(structure, at_rest(structure), factor * wrenches(structure, loads))[0]


def wrenches(structure: Structure, loads: Mapping[str, Sequence[float]]) -> Array:
    return nodal_loads(structure, 1, {name: np.asarray(load, dtype=float) for name, load in loads.items()})


def critical_factor(robot: Robot, loads: Mapping[str, Sequence[float]]) -> float:
    """Return by how much the loads can be multiplied before the robot buckles, to 1e-7 of it."""
    structure = compile_structure(robot)
    rest, once = at_rest(structure), wrenches(structure, loads)

    def buckles(factor: float) -> bool:
        try:
            loaded_compliance(structure, rest, factor * once)
        except BeamstiffError as refused:
            if "buckl" in str(refused):
                return True
            raise
        return False

    low, high = 0.0, 1.0
    while not buckles(high):
        low, high = high, 2 * high
    while high - low > 1e-7 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if buckles(middle) else (middle, high)
    return low


PUSH, DOWN, BEND = (-1.0, 0, 0, 0, 0, 0), (0, 0, -1.0, 0, 0, 0), (0, 0, 0, 0, 1.0, 0)
EULER = np.pi**2 * EI / LENGTH**2


@pytest.mark.parametrize("elements", [1, 2, 3])
@pytest.mark.parametrize(
    ("supports", "times"),
    [((HINGE, ROLLER), 1.0), ((), 0.25), ((SLIDING_CLAMP,), 4.0), ((ROLLER,), 4.4934094579**2 / np.pi**2)],
    ids=["pinned", "cantilever", "clamped", "clamped and hinged"],  # the last at tan u = u
)
def test_a_column_buckles_by_euler(elements: int, supports: Sequence[Sequence[float]], times: float) -> None:
    """Arts 2.1 and 2.2; the column stands askew in space."""
    rotation = some_rotation(1)
    robot = turned(line(elements, ROD, tcp=1, supports=supports), rotation)
    push = {f"n{elements}": (*(rotation @ PUSH[:3]), 0, 0, 0)}
    assert critical_factor(robot, push) == pytest.approx(times * EULER, rel=1e-6)


@pytest.mark.parametrize("elements", [1, 3])
@pytest.mark.parametrize("softness", [0.01, 0.3, 3.0])
def test_a_column_that_shears_buckles_at_haringxs_load(elements: int, softness: float) -> None:
    """``P (1 + P / G A_s) = P_E``: art. 2.17. As a cantilever, and between hinges."""
    for euler, tcp, supports in ((EULER / 4, elements, ()), (EULER, 1, (HINGE, ROLLER))):
        area = euler / softness / STEEL.G
        section = ROD.model_copy(update={"Ay": area, "Az": area})
        expected = area * STEEL.G / 2 * (np.sqrt(1 + 4 * softness) - 1)
        found = critical_factor(line(elements, section, tcp, supports), {f"n{elements}": PUSH})
        assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("softness", [0.0, 0.1, 3.0])
@pytest.mark.parametrize("share", [-3.0, -1.0, 1e-6, 0.1, 0.9, 0.99])
def test_one_element_is_as_stiff_as_many_of_first_order_converge_to(softness: float, share: float) -> None:
    """Halved often enough, what is of first order in the force is all that is left of it."""
    area = EULER / softness / STEEL.G if softness else None
    section = ROD.model_copy(update={"Ay": area, "Az": area})
    push = share * EULER / 4 * (1.0 if not softness else (np.sqrt(1 + 4 * softness) - 1) / (2 * softness))
    one, many = (loaded(line(count, section, tcp=count), {f"n{count}": PUSH}, push) for count in (1, 32))
    assert np.abs(one - many).max() <= 1e-8 * np.abs(many).max()


def test_the_stiffness_of_a_column_goes_to_zero_at_the_critical_load() -> None:
    robot = line(8, ROD, tcp=8)
    critical = critical_factor(robot, {"n8": PUSH})
    lateral = [1 / loaded(robot, {"n8": PUSH}, share * critical)[1, 1] for share in (0.0, 0.9, 0.99, 0.999)]
    slope = np.diff(lateral[1:]) / np.diff([0.9, 0.99, 0.999])
    assert (np.diff(lateral) < 0).all()
    assert lateral[-1] < 2e-3 * lateral[0]
    assert lateral[-1] + slope[-1] * 0.001 == pytest.approx(0.0, abs=1e-5 * lateral[0])


def test_beyond_the_critical_load_the_buckling_motion_is_named() -> None:
    robot = line(4, ROD, tcp=4)
    message = r"'frame' buckles under its load: node 'n4' .* \(-?0.00, .*moving nodes: n4, n3, n2, n1"
    with pytest.raises(BeamstiffError, match=message):
        loaded(robot, {"n4": PUSH}, 0.3 * EULER)


@pytest.mark.parametrize("share", [0.2, 0.6, 0.9, 0.99, -0.5, -3.0, -300.0])
def test_a_beam_column_under_a_load_at_its_middle(share: float) -> None:
    """Q L^3/48EI times 3 (tan u - u)/u^3, u = L/2 sqrt(P/EI); in tension 3 (u - tanh u)/u^3. Art. 1.3."""
    u = LENGTH / 2 * np.sqrt(abs(share) * EULER / EI)
    factor = 3 * (np.tan(u) - u) / u**3 if share > 0 else 3 * (u - np.tanh(u)) / u**3
    for elements in (2, 4):
        robot = line(elements, ROD, tcp=elements // 2, supports=(HINGE, ROLLER))
        found = loaded(robot, {f"n{elements}": PUSH}, share * EULER)[1, 1]
        assert found == pytest.approx(LENGTH**3 / (48 * EI) * factor, rel=1e-9)


@pytest.mark.parametrize("share", [0.2, 0.9, -3.0])
@pytest.mark.parametrize("elements", [1, 2])
def test_a_beam_column_under_its_own_weight(share: float, elements: int) -> None:
    """Its ends turn by q L^3/24EI times 3 (tan u - u)/u^3. Art. 1.5."""
    u = LENGTH / 2 * np.sqrt(abs(share) * EULER / EI)
    factor = 3 * (np.tan(u) - u) / u**3 if share > 0 else 3 * (u - np.tanh(u)) / u**3
    thick = ROD.model_copy(update={"A": 1.0})  # it does not grow shorter by its load
    robot = line(elements, thick, tcp=1, supports=(HINGE, ROLLER))
    robot = robot.model_copy(update={"gravity": (0, -1e-5, 0)})
    structure = compile_structure(robot)
    push = share * EULER * wrenches(structure, {f"n{elements}": PUSH})
    moved = loaded_displacement(structure, at_rest(structure), push, gravity=True)[0]
    slope = 1e-5 * 7850 * LENGTH**3 / (24 * EI) * factor
    assert moved[elements, 5] == pytest.approx(slope, rel=1e-6)
    assert moved[0, 5] == pytest.approx(-slope, rel=1e-6)


def test_a_cantilever_column_under_a_lateral_load_at_its_tip() -> None:
    """Deflection H/P (tan(kL)/k - L), k^2 = P/EI; the slope it gives is H/P (1/cos(kL) - 1). Art. 1.4."""
    force = 0.7 * EULER / 4
    k = np.sqrt(force / EI)
    found = loaded(line(1, ROD, tcp=1), {"n1": PUSH}, force)
    assert found[1, 1] == pytest.approx((np.tan(k * LENGTH) / k - LENGTH) / force, rel=1e-9)
    assert found[5, 1] == pytest.approx((1 / np.cos(k * LENGTH) - 1) / force, rel=1e-9)


def test_a_mast_buckles_under_its_own_weight() -> None:
    """At q L^3 = 7.837 EI. Art. 2.12 (Greenhill 1881)."""

    def stands(gravity: float) -> bool:
        points = [(0, 0, LENGTH * at / 4) for at in range(5)]
        beam = {"section": ROD, "material": STEEL, "up": (0, 1, 0), "gravity": (0, 0, -gravity)}
        robot = frame(points, beams=[(at, at + 1) for at in range(4)], **beam)
        structure = compile_structure(robot)
        try:
            loaded_compliance(structure, at_rest(structure), nodal_loads(structure, 1, {}), gravity=True)
        except BeamstiffError:
            return False
        return True

    critical = 7.837 * EI / LENGTH**3 / (7850 * 1e-4)
    assert stands(critical)
    assert not stands(1.0005 * critical)


def extrapolated(coarse: float, fine: float) -> float:
    """Return what halved elements converge to, with the second power of their length."""
    return fine + (fine - coarse) / 3


@pytest.mark.parametrize(
    ("supports", "load", "times"),
    [
        ((), {1.0: DOWN}, pytest.approx(4.0126, rel=1e-4)),
        ((HINGE, ROLLER), {0.0: BEND, 1.0: np.negative(BEND)}, pytest.approx(np.pi * LENGTH, rel=1e-4)),
        ((HINGE, ROLLER), {0.5: DOWN}, pytest.approx(16.94, abs=0.005)),
    ],
    ids=["load at the tip", "pure bending between forks", "load at the middle between forks"],
)
def test_a_blade_buckles_sideways(
    supports: Sequence[Sequence[float]], load: Mapping[float, Sequence[float]], times: Any
) -> None:
    """Times sqrt(EI GJ)/L^2: art. 6.3 (Prandtl, Michell 1899), 6.2 (M = pi sqrt(EI GJ)/L) and 6.4."""
    found = []
    for elements in (8, 16):
        robot = line(elements, BLADE, tcp=1, supports=supports)
        loads = {f"n{int(share * elements)}": wrench for share, wrench in load.items()}
        found.append(critical_factor(robot, loads))
    unit = np.sqrt(BLADE_EI * BLADE_GJ) / LENGTH**2
    assert extrapolated(*found) / unit == times


def test_a_clamped_shaft_buckles_under_torque() -> None:
    """At M = 8.987 EI/L = 2.861 pi EI/L. Art. 2.21 (Greenhill 1883)."""
    robot = line(16, Section(A=1e-4, Iy=1e-8, Iz=1e-8, J=2e-8), tcp=8, supports=(SLIDING_CLAMP,))
    expected = 8.987 * EI / LENGTH
    assert critical_factor(robot, {"n16": (0, 0, 0, 1.0, 0, 0)}) == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize("section", [ROD, BLADE, Section(A=1e-4, Iy=1e-8, Iz=1e-8, J=2e-8)])
@pytest.mark.parametrize("share", [0.02, 0.1, 0.2, 0.4])
def test_a_note_says_where_the_moments_of_one_element_are_coarse(section: Section, share: float) -> None:
    """Where one element differs from many by a thousandth there is one, and it bounds the difference."""
    least = STEEL.E * min(section.Iy, section.Iz)
    force = share * np.pi * np.sqrt(least * STEEL.G * section.J) / LENGTH**2
    one, many = (loaded(line(n, section, tcp=n), {f"n{n}": (0, 0, -force, 0, 0, 0)}, 1.0) for n in (1, 32))
    error = float(np.abs(np.diag(one - many) / np.diag(many)).max())
    notes = coarse_beams(solve(line(1, section, tcp=1), {"n1": [0, 0, -force, 0, 0, 0]}))
    if share < 0.05:
        assert not notes
        assert error < 1e-3
    else:
        (note,) = notes
        assert note.startswith("beam 'b0': its moments are ")
        assert f"{share:.0%} of what" in note
        assert 0.3 * share**2 / 2 < error < share**2 / 2
