"""Sections analysed by sectionproperties. Truth: our closed forms; skipped where the package is missing."""

import math
from dataclasses import dataclass

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.robot.section_import import section_from_analysis
from beamstiff.robot.sections import Section, section_properties


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
