"""Quantities against the definitions of the units: SI brochure, the international yard and pound, 1959."""

import contextlib
import math
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.units import MOST_TURN, UNITS, in_si, in_unit, number, quantity, unit_factor


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("1047 mm", "length", 1.047),
        ("1 in", "length", 0.0254),
        ("2 ft", "length", 0.6096),
        ("30 µm", "length", 30e-6),  # micro sign
        ("30 μm", "length", 30e-6),  # Greek mu
        ("30 um", "length", 30e-6),
        ("1.5e3mm", "length", 1.5),
        ("180 deg", "angle", math.pi),
        ("-90°", "angle", -math.pi / 2),
        ("1 rev", "angle", 2 * math.pi),
        ("60 arcmin", "angle", math.pi / 180),
        ("3600 arcsec", "angle", math.pi / 180),
        ("100 gon", "angle", math.pi / 2),
        ("2 mrad", "angle", 0.002),
        ("1 kN", "force", 1000.0),
        ("1 kgf", "force", 9.80665),
        ("1 lbf", "force", 4.4482216152605),
        ("3 N m", "moment", 3.0),
        ("3 Nm", "moment", 3.0),
        ("3 N·m", "moment", 3.0),
        ("3 kNm", "moment", 3000.0),
        ("3 Nmm", "moment", 0.003),
        ("2 t", "mass", 2000.0),
        ("500 g", "mass", 0.5),
        ("1 lb", "mass", 0.45359237),
        ("2 min", "time", 120.0),
        ("1 h", "time", 3600.0),
        ("20 ms", "time", 0.02),
        ("20 degC", "temperature", 20.0),
        ("20 °C", "temperature", 20.0),
        ("20 C", "temperature", 20.0),
        ("293.15 K", "temperature", 20.0),
        ("68 degF", "temperature", 20.0),
        ("1 g_n", "acceleration", 9.80665),
        ("9.81 m/s^2", "acceleration", 9.81),
        ("210 GPa", "modulus", 210e9),
        ("210000 N/mm^2", "modulus", 210e9),
        ("1 psi", "modulus", 4.4482216152605 / 0.0254**2),
        ("7.85 g/cm^3", "density", 7850.0),
        ("5 mm2", "area", 5e-6),
        ("5 cm²", "area", 5e-4),
        ("12 cm^4", "second moment of area", 12e-8),
        ("12 mm4", "second moment of area", 12e-12),
        ("12 mm**4", "second moment of area", 12e-12),
        ("5e10 N/mm", "translational stiffness", 5e13),
        ("2 N/µm", "translational stiffness", 2e6),
        ("1.72e9 N*mm/rad", "rotational stiffness", 1.72e6),
        ("1.72e9 N mm/rad", "rotational stiffness", 1.72e6),
        ("1 N*m/deg", "rotational stiffness", 180 / math.pi),
        ("1 J/rad", "rotational stiffness", 1.0),
        ("50 %", "number", 0.5),
        ("2e11", "modulus", 2e11),
        ("010", "length", 10.0),
        ("1_000", "length", 1000.0),
        (".5", "length", 0.5),
        ("5.", "length", 5.0),
        (3, "length", 3.0),
        (np.int64(3), "length", 3.0),
        (np.float32(0.5), "length", 0.5),
        (Fraction(1, 4), "length", 0.25),
    ],
)
def test_units_have_their_defined_size(text: object, kind: str, value: float) -> None:
    assert quantity(text, kind) == pytest.approx(value, rel=4e-16, abs=4e-14 if kind == "temperature" else 0)


@pytest.mark.parametrize("kind", UNITS)
def test_every_kind_has_its_si_unit_at_factor_one(kind: str) -> None:
    if UNITS[kind]:
        assert unit_factor(UNITS[kind], kind) == (1.0, 0.0)


@given(st.integers(-(10**9), 10**9))
def test_whole_millimetres_become_the_nearest_metres(millimetres: int) -> None:
    # 473 * 0.001 is not 0.473 in binary
    assert quantity(f"{millimetres} mm", "length") == float(Fraction(millimetres, 1000))


@given(st.decimals(allow_nan=False, allow_infinity=False, min_value=-99999, max_value=99999, places=4))
def test_decimal_millimetres_become_metres_to_the_last_digit(millimetres: Decimal) -> None:
    assert quantity(f"{millimetres} mm", "length") == pytest.approx(
        float(millimetres / 1000), rel=2.3e-16, abs=0
    )


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("90 deg", "length", "found the unit 'deg', expected a unit of length such as m"),
        ("90 deg", "number", "found the unit 'deg', expected a plain number without a unit"),
        ("5 m/m", "angle", "found the unit 'm/m', expected a unit of angle such as rad"),
        ("50 %", "angle", "expected a unit of angle such as rad"),
        ("5 mm", "angle", "found the unit 'mm', expected a unit of angle such as rad"),
        ("5 Nm", "rotational stiffness", "a stiffness about an axis is a moment per angle, Nm/rad"),
        ("5 N/m", "rotational stiffness", "expected a unit of rotational stiffness such as N*m/rad"),
        ("5 N*m/rad", "moment", "expected a unit of moment such as N*m"),
        ("5 N*m/rad", "translational stiffness", "expected a unit of translational stiffness such as N/m"),
        ("5 kg", "force", "found the unit 'kg', expected a unit of force such as N"),
        ("5 K", "length", "expected a unit of length such as m"),
        ("5 parsec", "length", "unknown unit 'parsec', expected a unit of length such as m"),
        ("5 e", "length", "unknown unit 'e'"),
        ("5 delta_degC", "temperature", "unknown unit"),
        ("5 mm**99", "length", "found the unit 'mm**99'"),
        ("5 m**9**9", "length", "found the unit 'm**9**9'"),
        ("5 mm+m", "length", "found the unit 'mm+m'"),
        ("5 (mm)", "length", "found '5 (mm)', expected a number"),
        ("5 __import__('os')", "length", "expected a number with a unit of length"),
        ("5 mm 3", "length", "found the unit 'mm 3'"),
        ("1.2.3 mm", "length", "found '1.2.3 mm', expected a number"),
        ("1,5 mm", "length", "found '1,5 mm', expected a number with a unit of length such as m: decimals"),
        ("mm", "length", "found 'mm', expected a number with a unit of length such as m"),
        ("", "length", "found '', expected a number"),
        ("1:30", "angle", "found '1:30', expected a number with a unit of angle"),
        ("0x1F", "length", "expected"),
        ("0o17", "length", "expected"),
        ("--1 mm", "length", "found '--1 mm', expected a number"),
        (".inf", "length", "found '.inf', expected a number"),
        (".nan", "length", "found '.nan', expected a number"),
        ("nan", "length", "found 'nan', expected a number"),
        ("inf m", "length", "found 'inf m', expected a number"),
        ("1e999", "length", "found '1e999', expected a finite number"),
        ("1e999 mm", "length", "expected a finite number"),
        ("1e308 km", "length", "found inf, expected a finite number"),
        ("٣ mm", "length", "found '٣ mm', expected a number"),  # float("٣") is 3.0
        ("9" * 300, "length", "expected a number"),
        (math.nan, "length", "found nan, expected a finite number"),
        (-math.inf, "length", "found -inf, expected a finite number"),
        (10**400, "length", "found a whole number of more than 60 digits, expected a finite number"),
        (True, "length", "found true, expected a number"),
        (None, "length", "found null, expected a number"),
        ([5], "length", "found [5], expected a number"),
        ({"mm": 5}, "length", "found {'mm': 5}, expected a number"),
        (5j, "length", "found 5j, expected a number"),
        (b"5", "length", "found b'5', expected a number"),
    ],
)
def test_what_is_no_such_quantity_is_refused(text: object, kind: str, expected: str) -> None:
    with pytest.raises(BeamstiffError) as error:
        quantity(text, kind)
    assert expected in str(error.value)


@given(st.text(max_size=300))
def test_any_text_is_a_finite_number_or_an_error(text: str) -> None:
    for kind in ("length", "temperature", "number", "rotational stiffness"):
        with contextlib.suppress(BeamstiffError):
            assert math.isfinite(quantity(text, kind))


@given(st.text("0123456789.eE+-_ mMNgradkPs*/^°%²", max_size=40))
def test_texts_close_to_quantities_are_finite_numbers_or_errors(text: str) -> None:
    with contextlib.suppress(BeamstiffError):
        assert math.isfinite(quantity(text, "length"))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_the_text_of_a_number_is_the_number(value: float) -> None:
    assert number(repr(value)) == value
    assert quantity(repr(value), "length") == value
    assert quantity(f"{value!r} m", "length") == value


@given(st.floats(-1e12, 1e12), st.sampled_from(["mm", "deg", "kN", "N*mm/rad", "GPa", "in", "K"]))
def test_the_factor_is_what_the_text_is_read_with(value: float, unit: str) -> None:
    kinds = {
        "mm": "length",
        "deg": "angle",
        "kN": "force",
        "GPa": "modulus",
        "in": "length",
        "K": "temperature",
    }
    kind = kinds.get(unit, "rotational stiffness")
    factor, offset = unit_factor(unit, kind)
    expected = pytest.approx(factor * value + offset, rel=1e-15, abs=1e-300)
    assert in_si(value, unit, kind) == expected
    if kind == "angle" and abs(in_si(value, unit, kind)) > MOST_TURN:
        with pytest.raises(BeamstiffError, match="expected an angle of at most"):
            quantity(f"{value!r} {unit}", kind)
        return
    assert quantity(f"{value!r} {unit}", kind) == expected


def test_plain_numbers_never_load_the_unit_parser() -> None:
    script = (
        "import sys; from beamstiff.units import quantity; quantity('2e11', 'modulus'); quantity(1, 'angle');"
        "sys.exit('pint' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.2 mrad", "rad", 2e-4),
        ("2e-7 rad/(N*m)", "rad/(N*m)", 2e-7),
        ("2e-7 rad/(N m)", "rad/(N*m)", 2e-7),
        ("0.2 mrad/kN/m", "rad/(N*m)", 2e-7),
        ("3 um/degC", "m/K", 3e-6),
        ("3 kN^-1", "1/N", 3e-3),
        ("4 kN^-1*m^-2", "1/(N*m^2)", 4e-3),
        ("5 %", "1", 0.05),
        ("2e-3", "rad", 2e-3),
        (3, "rad", 3.0),
    ],
)
def test_quantities_of_any_dimension_are_read_in_the_unit_asked(
    text: object, unit: str, value: float
) -> None:
    assert in_unit(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["1 mm", "1 rad/N", "1 parsec", "1 (m)", "much", "1 rad/(N*(m))", None, True]
)
def test_quantities_of_another_dimension_or_form_are_refused(text: object) -> None:
    with pytest.raises(BeamstiffError):
        in_unit(text, "rad/(N*m)")
