import math
import string
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.robot.expression import Expression, parse_expression

KINDS = {"q1": "angle", "q2": "angle", "s": "length", "_x9": "angle", "pitch": "angle"}


@pytest.mark.parametrize(
    ("text", "kind", "constant", "coefficients"),
    [
        ("q2 - 90 deg", "angle", -math.pi / 2, {"q2": 1}),
        ("-q2", "angle", 0, {"q2": -1}),
        ("+q2", "angle", 0, {"q2": 1}),
        ("  q1+q2  ", "angle", 0, {"q1": 1, "q2": 1}),
        ("q1 - q2 + q1", "angle", 0, {"q1": 2, "q2": -1}),
        ("q1 - q1", "angle", 0, {}),
        ("2*q1 + pi/2", "angle", math.pi / 2, {"q1": 2}),
        ("q1*2", "angle", 0, {"q1": 2}),
        ("2*q1*3/4", "angle", 0, {"q1": 1.5}),
        ("q1/2", "angle", 0, {"q1": 0.5}),
        ("pi*q1/180", "angle", 0, {"q1": math.pi / 180}),
        ("1e-3*_x9", "angle", 0, {"_x9": 1e-3}),
        (".5*pitch", "angle", 0, {"pitch": 0.5}),
        ("90°", "angle", math.pi / 2, {}),
        ("3*30 deg", "angle", math.pi / 2, {}),
        ("180 deg/2", "angle", math.pi / 2, {}),
        ("pi", "angle", math.pi, {}),
        ("0.5", "angle", 0.5, {}),
        ("473 mm", "length", 0.473, {}),
        ("473mm", "length", 0.473, {}),
        ("s + 1 in", "length", 0.0254, {"s": 1}),
        ("5 mm/rad * q1", "length", 0, {"q1": 0.005}),
        ("5 mm/rad*q1 - 1", "length", -1, {"q1": 0.005}),
        ("5 mm/deg * q1", "length", 0, {"q1": 0.005 * 180 / math.pi}),
        ("2 rad/m * s", "angle", 0, {"s": 2}),
        ("2 deg/mm * s", "angle", 0, {"s": 2 * math.pi / 180 * 1000}),
        (1.5, "angle", 1.5, {}),
        (2, "length", 2.0, {}),
    ],
)
def test_expressions_mean_what_they_say(
    text: object, kind: str, constant: float, coefficients: dict[str, float]
) -> None:
    expression = parse_expression(text, kind, KINDS)
    assert expression.constant == pytest.approx(constant, rel=1e-15)
    assert expression.coefficients == pytest.approx(coefficients, rel=1e-15)


@pytest.mark.parametrize("kind", ["angle", "length"])
@pytest.mark.parametrize(
    "text",
    [
        *("", " ", "+", "-", "q1 +", "* q1", "/2", "q1 *", "q1 q2", "2 q1", "q1 2", "--q1", "+-q1"),
        *("1 - - q1", "q1*q2", "q1*q1", "1/q1", "q1/q2", "2/q1*q1", "(q1)", "q1**2", "q1^2", "q1 ** 2"),
        *("q1; q2", "q1, q2", "q1 = 2", "q1 < 2", "q1.real", "q1[0]", "q1()", "'q1'", "q1 # comment"),
        # − is the minus sign of a text processor
        *("2 mm/rad*q1/3 mm", "5/3 mm", "1,5", "−q1", "q1\0", "0x10", "1:30", "nan", "inf*q1", "[1, 2]"),
        *("{}", "lambda: 0", "__import__('os').system('true')"),
        *("().__class__.__bases__[0].__subclasses__()", "exec('x=1')", "open('/etc/passwd')"),
        *("q1 if q2 else s", "q1\nimport os"),
    ],
)
def test_what_the_grammar_does_not_hold_is_refused(text: str, kind: str) -> None:
    with pytest.raises(BeamstiffError, match=r"^found "):
        parse_expression(text, kind, KINDS)


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("q22 + 1", "angle", "found the unknown variable 'q22' in 'q22 + 1' (did you mean 'q2'?)"),
        ("sin(q1)", "angle", "found the unknown variable 'sin' in 'sin(q1)'"),
        ("q1*q2", "angle", "found 'q1*q2', expected a linear expression of variables such as 'q2 - 90 deg'"),
        ("2 q1", "angle", "found '2 q1', expected a linear expression of variables such as"),
        ("90 deg", "length", "found the unit 'deg', expected a unit of length such as m"),
        ("90 mm", "angle", "found the unit 'mm', expected a unit of angle such as rad"),
        ("5 parsec", "length", "unknown unit 'parsec', expected a unit of length"),
        (
            "q1",
            "length",
            "found 'q1': an angle where a length is expected; give the coefficient a unit such as m/rad",
        ),
        (
            "2*s",
            "angle",
            "found '2*s': a length where an angle is expected; give the coefficient a unit such as rad/m",
        ),
        ("5 mm*q1", "length", "give the coefficient a unit such as m/rad"),
        ("5 N/rad*q1", "length", "found the unit 'N', expected a unit of length such as m"),
        ("5 mm/mm*q1", "length", "found the unit 'mm', expected a unit of angle such as rad"),
        ("2 rad*q1", "angle", "found the unit 'rad' on a coefficient in '2 rad*q1', expected a plain number"),
        ("q1/0", "angle", "found a division by zero in 'q1/0'"),
        ("1/0.0", "angle", "found a division by zero in '1/0.0'"),
        ("1e999", "angle", "found '1e999', expected a finite number"),
        ("1e200*1e200*q1", "angle", "expected finite numbers"),
        ("1e308 + 1e308", "angle", "expected finite numbers"),
        ("1e300/1e-300", "angle", "expected finite numbers"),
        ("+".join(["q1"] * 400), "angle", "found an expression of 1199 characters, expected at most 500"),
        (math.nan, "angle", "found nan, expected a finite number"),
        (True, "angle", "found true, expected a number"),
        (None, "angle", "found null, expected a number"),
        (["q1"], "angle", "found ['q1'], expected a number"),
    ],
)
def test_what_is_wrong_is_said(text: object, kind: str, expected: str) -> None:
    with pytest.raises(BeamstiffError) as error:
        parse_expression(text, kind, KINDS)
    assert expected in str(error.value)


def test_a_variable_goes_before_a_unit_of_its_name_only_where_no_number_stands_before_it() -> None:
    kinds = {"mm": "length"}
    assert parse_expression("2*mm", "length", kinds) == Expression(0.0, {"mm": 2.0})
    assert parse_expression("2 mm", "length", kinds) == Expression(0.002, {})


terms = st.tuples(
    st.sampled_from(["+", "-"]), st.floats(0, 1e5), st.sampled_from(["q1", "q2", "_x9", "pitch", None])
)


@given(st.lists(terms, min_size=1, max_size=8), st.sampled_from(["", " ", "  "]))
def test_sums_are_what_python_makes_of_them(rows: list[tuple[str, float, str | None]], space: str) -> None:
    text = space.join(
        f"{sign}{space}{number!r}" + (f"{space}*{space}{name}" if name else "") for sign, number, name in rows
    )
    values = {"q1": 0.3, "q2": -1.7, "_x9": 2.9, "pitch": 0.01}
    # the oracle: Python itself, on text that we made
    truth = eval(text, {"__builtins__": {}}, values)
    expression = parse_expression(text, "angle", KINDS)
    found = expression.constant + sum(by * values[name] for name, by in expression.coefficients.items())
    assert found == pytest.approx(truth, rel=1e-12, abs=1e-8)


@given(
    st.dictionaries(st.sampled_from(sorted(set(KINDS) - {"s"})), st.floats(-1e6, 1e6).filter(bool)),
    st.floats(-1e6, 1e6),
)
def test_an_expression_written_out_stays_the_same(coefficients: dict[str, float], constant: float) -> None:
    expression = Expression(constant, coefficients)
    assert parse_expression(str(expression).replace("+ -", "- "), "angle", KINDS) == expression


@given(st.text(string.printable + "°µ²π−", max_size=60) | st.text(max_size=30))
def test_any_text_is_a_finite_linear_expression_or_an_error(text: str) -> None:
    try:
        expression = parse_expression(text, "angle", KINDS)
    except BeamstiffError:
        return
    assert all(map(math.isfinite, [expression.constant, *expression.coefficients.values()]))
    assert set(expression.coefficients) <= set(KINDS)


@pytest.mark.parametrize("piece", ["1", "+", "-", "*", "q", "1_", "1e", ".", " ", "deg/", "(", "pi*"])
def test_no_text_takes_long(piece: str) -> None:
    start = time.perf_counter()
    for text in (piece * 490, piece * 100_000, "q1" + piece * 490, "1 " + piece * 490):
        try:
            parse_expression(text[:500] if len(text) < 1000 else text, "angle", KINDS)
        except BeamstiffError:
            continue
    assert time.perf_counter() - start < 0.5


@pytest.mark.parametrize("text", ["1e308", "1e308 deg", "-2e6", "1e300 deg + 1", 2e6])
def test_an_angle_whose_digits_are_lost_in_its_turns_is_refused(text: str | float) -> None:
    with pytest.raises(BeamstiffError, match=r"expected an angle of at most 1e\+06 rad"):
        parse_expression(text, "angle", {})
    assert parse_expression("1e6", "angle", {}).constant == 1e6
    assert parse_expression("2e6", "length", {}).constant == 2e6
