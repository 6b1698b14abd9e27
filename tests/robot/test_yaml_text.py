import datetime
import math
import re
import time
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.robot import yaml_text
from beamstiff.robot.yaml_text import parse_yaml


@pytest.fixture(params=["libyaml", "pure Python"])
def loader(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Run with PyYAML's C parser and with its own, which takes over where the C one is not built."""
    name: str = request.param
    if name == "libyaml" and not yaml.__with_libyaml__:
        pytest.skip("this PyYAML has no libyaml")
    monkeypatch.setattr(yaml_text, "LOADER", yaml.CSafeLoader if name == "libyaml" else yaml.SafeLoader)
    return name


TEXTS = ("1:30", "010", "0x1F", "0o17", "1_000", "on", "off", "yes", "No", "y", "2026-01-31", ".inf", "-.INF")
TEXTS += (".nan", "nan", "1e999", "=", "1e", "1.2.3", "+", ".", "12 mm", "2026-01-31 12:00:00")
TEXTS += ("\u0661", "1\u0660")  # an Arabic one


@pytest.mark.usefixtures("loader")
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2e11", 2e11),
        ("-9.81", -9.81),
        ("1e-05", 1e-05),
        ("1.e3", 1000.0),
        (".5", 0.5),
        ("+3", 3),
        ("0", 0),
        ("-0.0", -0.0),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("-", [None]),
        # what YAML 1.1 would make something else of, and what is no number though it starts like one
        *((text, text) for text in TEXTS),
        # what is quoted is text
        ("'5'", "5"),
        ('"true"', "true"),
        ("'null'", "null"),
        ("''", ""),
        ("|\n  5", "5"),
        (">\n  5", "5"),
    ],
)
def test_scalars_follow_yaml_1_2_and_nothing_else(text: str, value: Any) -> None:
    data, _ = parse_yaml(f"key: {text}" if value != [None] else f"key:\n  {text}")
    assert data == {"key": value}
    assert type(data["key"]) is type(value)
    assert not isinstance(data["key"], datetime.date)


@pytest.mark.usefixtures("loader")
def test_every_key_path_has_its_line() -> None:
    _, lines = parse_yaml(
        "a: 1\n"  # 1
        "b:\n"  # 2
        "  - {c: 1, d: [2,\n"  # 3
        "      3]}\n"  # 4
        "  - e:\n"  # 5
        "      text: |\n"  # 6
        "        more\n"  # 7
        "      f: &x {g: 1}\n"  # 8
        "# comment\n"  # 9
        "h: *x\n"  # 10
    )
    assert lines.at(()) == 1
    assert lines.at(("a",)) == 1
    assert lines.at(("b",)) == 2
    assert lines.at(("b", 0)) == 3
    assert lines.at(("b", 0, "d")) == 3
    assert lines.at(("b", 0, "d", 1)) == 4
    assert lines.at(("b", 1)) == 5
    assert lines.at(("b", 1, "e", "text")) == 6
    assert lines.at(("b", 1, "e", "f", "g")) == 8
    assert lines.at(("h",)) == 10
    assert lines.at(("h", "g")) == 8, "what an alias stands for is where its anchor is"


@pytest.mark.usefixtures("loader")
def test_a_path_that_does_not_exist_has_the_nearest_line() -> None:
    _, lines = parse_yaml("a: 1\nb:\n  - c: 1\n")
    assert lines.at(("b", 0, "missing", "deeper")) == 3
    assert lines.at(("b", 7)) == 2
    assert lines.at(("b", -1)) == 2
    assert lines.at(("b", "c")) == 2
    assert lines.at(("a", "c")) == 1
    assert lines.at(("nothing",)) == 1


@pytest.mark.usefixtures("loader")
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_lines_are_counted_with_every_kind_of_line_end(newline: str) -> None:
    _, lines = parse_yaml(newline.join(["a: 1", "", "# c", "b: 2"]))
    assert lines.at(("b",)) == 4


@pytest.mark.usefixtures("loader")
def test_a_byte_order_mark_is_no_part_of_the_first_key() -> None:
    assert parse_yaml("\ufeffa: 1")[0] == {"a": 1}


@pytest.mark.usefixtures("loader")
def test_anchors_stand_for_what_they_name() -> None:
    data, _ = parse_yaml("a: &s {k: [1, 2]}\nb: *s\nc: &t text\nd: [*t, *s]\n")
    assert data == {"a": {"k": [1, 2]}, "b": {"k": [1, 2]}, "c": "text", "d": ["text", {"k": [1, 2]}]}


@pytest.mark.usefixtures("loader")
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: {b: 1, b: 2}", "t.yaml:1: a: duplicate key 'b', first on line 1"),
        ("a:\n  - b: 1\n  - b: 1\n    c: 2\n    b: 3", "t.yaml:5: a[1]: duplicate key 'b', first on line 3"),
        ("1: a\n'1': b", "t.yaml:2: duplicate key '1', first on line 1"),
        (
            "a: !!python/name:os.system",
            "t.yaml:1: a: found the tag '!!python/name:os.system', expected plain",
        ),
        ("a: &x b\n*x : c\n", "t.yaml:2: found the alias *x as a key, expected text"),
        ("a: !!int 5", "t.yaml:1: a: found the tag '!!int', expected plain values"),
        ("a: 1\n--- \nb: 2", "t.yaml:2: found a second document (---), expected one robot a file"),
        ("a: *b", "t.yaml:1: a: found the alias *b, but no anchor &b before it"),
        (
            f"a: *{'x' * 5000}",
            f"t.yaml:1: a: found the alias *{'x' * 40}, but no anchor &{'x' * 40} before it",
        ),
        ("a: &b [*b]", "t.yaml:1: a[0]: the alias *b holds itself"),
        ("a: &b {c: {d: [*b]}}", "t.yaml:1: a.c.d[0]: the alias *b holds itself"),
        ("[" * 41 + "]" * 41, "nested deeper than 40 levels"),
        ("[" * 100_000, "nested deeper than 40 levels"),
        ("- " * 100_000 + "a", "nested deeper than 40 levels"),
        ("{a: " * 100_000, "nested deeper than 40 levels"),
        ('"\\ud800": 1\nb: "\\U00110000"', "not valid YAML: "),
        ("a: b\x00", r"t.yaml:1: found the character '\x00', expected printable text"),
        ("a: 1\nb: \ud800", r"t.yaml:2: found the character '\ud800', expected printable text"),
        ("a: [1\nb: 2\n", "t.yaml:2: not valid YAML:"),
        ("", "t.yaml: is empty"),
        ("# nothing\n", "t.yaml: is empty"),
        ("--- ~\n", "t.yaml: is empty"),
    ],
)
def test_what_is_refused_is_named_with_its_line(text: str, expected: str) -> None:
    start = time.process_time()
    with pytest.raises(BeamstiffError) as error:
        parse_yaml(text, "t.yaml")
    assert expected in str(error.value)
    assert time.process_time() - start < 2.0


@pytest.mark.usefixtures("loader")
def test_forty_levels_are_deep_enough_for_anyone() -> None:
    data, _ = parse_yaml("[" * 40 + "]" * 40)
    for _ in range(39):
        (data,) = data
    assert data == []


def test_a_million_repeated_values_are_the_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_text, "MOST_REPEATED", 10)
    # ten values: the list, and nine in it
    assert parse_yaml("a: &a [1, 2, 3, 4, 5, 6, 7, 8, 9]\nb: *a")[0]["b"] == list(range(1, 10))
    with pytest.raises(BeamstiffError, match=r":2: c\[1\]: the aliases of this file stand for more than 10"):
        parse_yaml("a: &a [1, 2, 3, 4, 5, 6, 7]\nc: [*a, *a]")


def test_the_number_of_values_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_text, "MOST_VALUES", 10)
    assert parse_yaml("[1, 2, 3, 4, 5, 6, 7, 8, 9]")[0] == list(range(1, 10))
    with pytest.raises(BeamstiffError, match=r":1: \[9\]: holds more than 10 values"):
        parse_yaml("[1, 2, 3, 4, 5, 6, 7, 8, 9, 10]")
    monkeypatch.setattr(yaml_text, "LARGEST", 100)
    with pytest.raises(BeamstiffError, match="larger than"):
        parse_yaml("a" * 101)


_NUMERIC = re.compile("[-+.]*[0-9]")

plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    # not 2e11: that is text in YAML 1.1, and PyYAML does not quote it
    | st.text(st.characters(exclude_categories=("Cs", "Cc", "Cn", "Co"))).filter(
        lambda text: not _NUMERIC.match(text)
    ),
    lambda inside: (
        st.lists(inside, max_size=4)
        | st.dictionaries(st.text("abcdefghijk_-. ", min_size=1).filter(str.strip), inside, max_size=4)
    ),
    max_leaves=12,
)


@given(plain.filter(lambda data: data is not None), st.booleans())
def test_what_pyyaml_writes_is_read_as_pyyaml_reads_it(data: Any, flow: bool) -> None:
    # PyYAML quotes text that YAML 1.1 would take for something else, so both readings agree
    text = yaml.safe_dump(data, allow_unicode=True, default_flow_style=flow)
    assert parse_yaml(text)[0] == yaml.safe_load(text)


@given(st.text(st.sampled_from(list("{}[]:,-?&*!|>'\"%@`#\n ab1.~<=\t")), max_size=60))
def test_any_text_is_plain_data_or_an_error(text: str) -> None:
    try:
        data, lines = parse_yaml(text)
    except BeamstiffError as error:
        message = str(error)
    else:
        message = ""
    if message:
        assert message.startswith("<text>")
        return
    stack = [(data, ())]
    while stack:
        value, path = stack.pop()
        assert 1 <= lines.at(path) <= text.count("\n") + 1
        if isinstance(value, dict):
            assert all(type(key) is str for key in value)
            stack += [(item, (*path, key)) for key, item in value.items()]
        elif isinstance(value, list):
            stack += [(item, (*path, at)) for at, item in enumerate(value)]
        else:
            assert value is None or type(value) in (bool, int, float, str)
            assert type(value) is not float or math.isfinite(value)
