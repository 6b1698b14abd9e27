"""Section properties against published tables, closed forms and a second formulation.

Timoshenko and Goodier, Theory of Elasticity, 3rd ed., art. 109, table 7: torsion of rectangles. Roark's
Formulas for Stress and Strain, 8th ed., tables A.1 and 10.7. Cowper, J. Appl. Mech. 33 (1966) 335: shear.
"""
# ruff: noqa: SIM300  # it takes A and J for constants

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse.linalg import spsolve

from beamstiff.errors import BeamstiffError
from beamstiff.robot.section_import import section_from_analysis
from beamstiff.robot.sections import Section, SectionProperties, section_properties

lengths = st.floats(1e-3, 10)
fractions = st.floats(0.01, 0.99)


def properties(**dimensions: object) -> SectionProperties:
    return section_properties(Section(shear=True, **dimensions))


@pytest.mark.parametrize(
    ("ratio", "published"),
    [
        (1, "0.1406"),
        (1.2, "0.166"),
        (1.5, "0.196"),
        (2, "0.229"),
        (2.5, "0.249"),
        (3, "0.263"),
        (4, "0.281"),
        (5, "0.291"),
        (10, "0.312"),
        (1e6, "0.333"),
    ],
)
def test_torsion_of_rectangles_is_the_published_one(ratio: float, published: str) -> None:
    # J = k1 a b^3; the table prints k1 to its last digit (0.2912 as 0.291, 0.3123 as 0.312)
    half_a_digit = 0.5 * 10.0 ** -(len(published) - 2) * 1.2
    for height, width in ((ratio, 1.0), (1.0, ratio)):
        section = properties(shape="rectangle", width=width, height=height)
        assert section.J / ratio == pytest.approx(float(published), abs=half_a_digit)


def torsion_by_finite_differences(columns: int, rows: int, hole: np.ndarray | None = None) -> float:
    """Return J of a rectangle of unit cells by Prandtl's stress function (second formulation).

    Laplace phi = -2, zero outside, one unknown constant over the hole (with it, warping is single-valued);
    J = 2 x the volume below phi.
    """
    number = -np.ones((columns + 1, rows + 1), dtype=int)
    inside = np.zeros_like(number, dtype=bool)
    inside[1:-1, 1:-1] = True
    if hole is not None:
        inside &= ~hole
    number[inside] = np.arange(inside.sum())
    unknowns = int(inside.sum())
    load = np.full(unknowns, 2.0)
    if hole is not None:
        number[hole] = unknowns
        unknowns += 1
        load = np.append(load, 2.0 * hole.sum())
    matrix = sparse.lil_matrix((unknowns, unknowns))
    for one, other in ((number[:-1], number[1:]), (number[:, :-1], number[:, 1:])):
        for a, b in zip(one.ravel(), other.ravel(), strict=True):
            if a == b:
                continue
            for at, opposite in ((a, b), (b, a)):
                if at >= 0:
                    matrix[at, at] += 1.0
                    if opposite >= 0:
                        matrix[at, opposite] -= 1.0
    return float(load @ spsolve(matrix.tocsc(), load))


def extrapolated(coarse: float, fine: float) -> float:
    return fine + (fine - coarse) / 3.0  # the error falls with the square of the step


@pytest.mark.parametrize(
    ("width", "height", "wall", "within"),
    [(20, 20, 1, 0.03), (20, 20, 2, 0.05), (30, 20, 1, 0.03), (20, 20, 4, 0.07)],
)
def test_torsion_of_boxes_is_close_to_the_stress_function_and_never_above(
    width: int, height: int, wall: int, within: float
) -> None:
    results = []
    for cells in (4, 8):
        hole = np.zeros((width * cells + 1, height * cells + 1), dtype=bool)
        edge = wall * cells
        hole[edge:-edge, edge:-edge] = True
        results.append(torsion_by_finite_differences(width * cells, height * cells, hole) / cells**4)
    truth = extrapolated(*results)
    found = properties(shape="box", width=width, height=height, wall=wall).J
    assert (1 - within) * truth < found < truth


@given(lengths, lengths)
def test_rectangles_have_the_textbook_second_moments(width: float, height: float) -> None:
    section = properties(shape="rectangle", width=width, height=height)
    turned = properties(shape="rectangle", width=height, height=width)
    assert section.A == pytest.approx(width * height, rel=1e-14)
    assert section.Iy == pytest.approx(width * height**3 / 12, rel=1e-14), (
        "bending in the plane of the height"
    )
    assert section.Iz == pytest.approx(height * width**3 / 12, rel=1e-14)
    assert section.Ay == section.Az == pytest.approx(5 / 6 * section.A, rel=1e-14)
    assert (turned.Iy, turned.Iz) == pytest.approx((section.Iz, section.Iy), rel=1e-14)
    assert turned.J == pytest.approx(section.J, rel=1e-14)


@given(lengths)
def test_circles_have_the_textbook_properties(outer: float) -> None:
    section = properties(shape="circle", outer=outer)
    radius = outer / 2
    assert section.A == pytest.approx(math.pi * radius**2, rel=1e-14)
    assert section.Iy == section.Iz == pytest.approx(math.pi * radius**4 / 4, rel=1e-14)
    assert section.J == pytest.approx(math.pi * radius**4 / 2, rel=1e-14)
    # Cowper: 6 (1 + nu) / (7 + 6 nu) with nu = 0
    assert section.Ay == section.Az == pytest.approx(6 / 7 * section.A, rel=1e-14)


@given(lengths, fractions)
def test_a_tube_is_a_circle_without_a_circle(outer: float, fraction: float) -> None:
    wall = fraction * outer / 2
    tube = properties(shape="tube", outer=outer, wall=wall)
    whole, hole = (properties(shape="circle", outer=size) for size in (outer, outer - 2 * wall))
    for name in ("A", "Iy", "Iz", "J"):
        expected = getattr(whole, name) - getattr(hole, name)
        assert getattr(tube, name) == pytest.approx(expected, rel=1e-12, abs=1e-13 * getattr(whole, name))


def test_tubes_reach_the_thin_wall_and_the_solid_circle() -> None:
    mean, wall = 0.3, 1e-7
    thin = properties(shape="tube", outer=mean + wall, wall=wall)
    assert thin.A == pytest.approx(math.pi * mean * wall, rel=1e-6)
    assert thin.Iy == pytest.approx(math.pi * mean**3 * wall / 8, rel=1e-6)
    assert thin.J == pytest.approx(math.pi * mean**3 * wall / 4, rel=1e-6)
    assert thin.Ay == pytest.approx(thin.A / 2, rel=1e-6)
    solid, almost = properties(shape="circle", outer=0.3), properties(shape="tube", outer=0.3, wall=0.1499999)
    for name in ("A", "Iy", "J", "Ay"):
        assert getattr(almost, name) == pytest.approx(getattr(solid, name), rel=1e-5)


@given(lengths, lengths, fractions)
def test_a_box_is_a_rectangle_without_a_rectangle(width: float, height: float, fraction: float) -> None:
    wall = fraction * min(width, height) / 2
    box = properties(shape="box", width=width, height=height, wall=wall)
    whole = properties(shape="rectangle", width=width, height=height)
    hole = properties(shape="rectangle", width=width - 2 * wall, height=height - 2 * wall)
    for name in ("A", "Iy", "Iz"):
        expected = getattr(whole, name) - getattr(hole, name)
        assert getattr(box, name) == pytest.approx(expected, rel=1e-12, abs=1e-13 * getattr(whole, name))
    assert box.Ay == pytest.approx(2 * wall * width, rel=1e-14), "the walls along y"
    assert box.Az == pytest.approx(2 * wall * height, rel=1e-14)


def test_thin_boxes_follow_bredt() -> None:
    width, height, wall = 0.2, 0.3, 1e-6
    box = properties(shape="box", width=width, height=height, wall=wall)
    assert box.J == pytest.approx(4 * (width * height) ** 2 / (2 * (width + height) / wall), rel=2e-5)


@given(lengths, lengths, fractions, fractions)
def test_an_i_is_a_rectangle_without_the_two_sides(
    width: float, height: float, of_width: float, of_height: float
) -> None:
    web, flange = of_width * width, of_height * height / 2
    section = properties(shape="I", width=width, height=height, web=web, flange=flange)
    inner = height - 2 * flange
    whole = width * height**3 / 12
    assert section.A == pytest.approx(
        width * height - (width - web) * inner, rel=1e-12, abs=1e-13 * width * height
    )
    assert section.Iy == pytest.approx(whole - (width - web) * inner**3 / 12, rel=1e-12, abs=1e-13 * whole)
    assert section.Iz == pytest.approx((2 * flange * width**3 + inner * web**3) / 12, rel=1e-14)
    assert section.Az == pytest.approx(web * height, rel=1e-14)


def test_an_i_of_thin_strips_twists_like_the_strips() -> None:
    # Roark, table 10.7: an open thin section twists as its strips, J = sum of b t^3 / 3
    section = properties(shape="I", width=0.1, height=0.2, web=1e-6, flange=2e-6)
    assert section.J == pytest.approx((2 * 0.1 * 2e-6**3 + 0.2 * 1e-6**3) / 3, rel=3e-5)


shapes = st.one_of(
    st.fixed_dictionaries({"shape": st.just("tube"), "outer": lengths, "wall": fractions}),
    st.fixed_dictionaries({"shape": st.just("circle"), "outer": lengths}),
    st.fixed_dictionaries({"shape": st.just("box"), "width": lengths, "height": lengths, "wall": fractions}),
    st.fixed_dictionaries({"shape": st.just("rectangle"), "width": lengths, "height": lengths}),
    st.fixed_dictionaries(
        {"shape": st.just("I"), "width": lengths, "height": lengths, "web": fractions, "flange": fractions}
    ),
)


@given(shapes)
def test_every_shape_obeys_what_every_section_obeys(shape: dict[str, object]) -> None:
    smallest = min(value for key, value in shape.items() if key in ("outer", "width", "height"))
    shape = {
        key: value * (shape["width"] if key == "web" else smallest / 2)
        if key in ("wall", "web", "flange")
        else value
        for key, value in shape.items()
    }
    section = properties(**shape)
    assert min(section.A, section.Iy, section.Iz, section.J) > 0
    # Saint-Venant: no section twists stiffer than the polar moment
    assert section.J <= (section.Iy + section.Iz) * (1 + 1e-12)
    assert section.Ay <= section.A * (1 + 1e-12)
    assert section.Az <= section.A * (1 + 1e-12)
    # twice the size: 4 times the areas, 16 times the moments
    double = properties(**{key: value if key == "shape" else 2 * value for key, value in shape.items()})
    for name, factor in {"A": 4, "Ay": 4, "Az": 4, "Iy": 16, "Iz": 16, "J": 16}.items():
        assert getattr(double, name) == pytest.approx(factor * getattr(section, name), rel=1e-12)


def test_shear_areas_come_only_when_asked_for() -> None:
    plain = section_properties(Section(shape="circle", outer=0.1))
    assert (plain.Ay, plain.Az) == (None, None)
    assert section_properties(Section(shape="circle", outer=0.1, shear=True)).Ay is not None


def test_given_properties_are_taken_as_they_are() -> None:
    section = Section(A="21 cm^2", Iy=1e-6, Iz=2e-6, J=3e-6, Az=0.5e-3)
    assert section_properties(section) == SectionProperties(21e-4, 1e-6, 2e-6, 3e-6, None, 0.5e-3)


def test_a_rectangle_as_thin_as_numbers_get_is_refused_without_a_warning() -> None:
    with pytest.raises(BeamstiffError, match="leave the range of numbers"):
        Section(shape="rectangle", width=1e-320, height=0.1)


@pytest.mark.parametrize("outer", [1e200, 1e-200])
def test_sizes_whose_fourth_power_is_no_number_are_refused(outer: float) -> None:
    with pytest.raises(BeamstiffError, match="leave the range of numbers"):
        Section(shape="circle", outer=outer)


# Sections analysed by sectionproperties. Truth: our closed forms; skipped where the package is missing


@dataclass
class Analysed:
    """A rectangle of 100 mm (x) by 200 mm (y), turned, as the package would tell of it."""

    turned: float = 0.0

    def get_area(self) -> float:
        return 2e4

    def get_ic(self) -> tuple[float, float, float]:
        big, small = 100 * 200**3 / 12, 200 * 100**3 / 12
        c, s = math.cos(self.turned), math.sin(self.turned)
        return big * c * c + small * s * s, big * s * s + small * c * c, (small - big) * c * s

    def get_j(self) -> float:
        return 4.5736e7

    def get_as(self) -> tuple[float, float]:
        return 2e4 * 5 / 6, 2e4 * 5 / 6


def test_axes_and_units_are_those_of_a_beam() -> None:
    ours = section_properties(Section(shape="rectangle", width=0.1, height=0.2, shear=True))
    theirs = section_properties(section_from_analysis(Analysed(), unit=1e-3, shear=True))
    for name in ("A", "Iy", "Iz", "Ay", "Az"):
        assert getattr(theirs, name) == pytest.approx(getattr(ours, name), rel=1e-12)
    assert pytest.approx(ours.J, rel=1e-4) == theirs.J


def test_turned_principal_axes_are_refused_with_their_angle() -> None:
    with pytest.raises(BeamstiffError, match=r"turned by -?10 deg"):
        section_from_analysis(Analysed(math.radians(10.0)), unit=1e-3)


def test_a_section_that_was_not_analysed_is_refused() -> None:
    with pytest.raises(BeamstiffError, match="cannot be used"):
        section_from_analysis(object(), unit=1e-3)
    with pytest.raises(BeamstiffError, match="unit"):
        section_from_analysis(Analysed(), unit=0.0)


def test_the_package_itself_agrees_with_our_rectangle() -> None:
    library = pytest.importorskip("sectionproperties.pre.library")
    analysis = pytest.importorskip("sectionproperties.analysis")
    section = analysis.Section(library.rectangular_section(d=200, b=100).create_mesh(mesh_sizes=50))
    with pytest.raises(BeamstiffError, match="calculate_geometric"):
        section_from_analysis(section, unit=1e-3)
    section.calculate_geometric_properties()
    section.calculate_warping_properties()
    theirs = section_properties(section_from_analysis(section, unit=1e-3, shear=True))
    ours = section_properties(Section(shape="rectangle", width=0.1, height=0.2, shear=True))
    for name in ("A", "Iy", "Iz", "J", "Ay", "Az"):
        assert getattr(theirs, name) == pytest.approx(getattr(ours, name), rel=1e-4)
