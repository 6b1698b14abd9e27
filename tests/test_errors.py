import time

import pytest

from beamstiff.errors import BeamstiffError, listed, shown, suggest


def test_a_message_is_one_line() -> None:
    assert str(BeamstiffError("robot.yaml:3:\n  found\t'x',\r\n expected y ")) == (
        "robot.yaml:3: found 'x', expected y"
    )


def test_control_characters_do_not_reach_the_terminal() -> None:
    message = str(BeamstiffError("key \x1b[31m\x07\u202e\ud800"))
    assert message == r"key \x1b[31m\x07\u202e\ud800"
    assert message.isprintable()


def test_it_is_a_value_error_for_those_who_do_not_know_beamstiff() -> None:
    assert issubclass(BeamstiffError, ValueError)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("tosional", " (did you mean 'torsional'?)"),
        ("Axial", " (did you mean 'axial'?)"),
        ("J12", ""),
        ("", ""),
        pytest.param("x" * 1_000_000, "", id="long"),
        (None, ""),
        (12, ""),
    ],
)
def test_a_close_name_is_suggested_and_a_far_one_is_not(name: object, hint: str) -> None:
    assert suggest(name, ["axial", "radial", "torsional", "tilting"]) == hint


def test_among_fifty_thousand_names_a_slip_of_the_finger_is_found_at_once() -> None:
    names = [f"node{number}" for number in range(50_000)]
    start = time.perf_counter()
    assert suggest("node4711x", names) == " (did you mean 'node4711'?)"
    assert suggest("nde4711", names) == " (did you mean 'node4711'?)"
    assert "did you mean 'node" in suggest("node50001", names)
    assert suggest("something else", names) == ""
    assert time.perf_counter() - start < 2.0


def test_long_lists_are_cut() -> None:
    assert listed([]) == ""
    assert listed(["a"]) == "a"
    assert listed(map(str, range(20)), most=3) == "0, 1, 2 and 17 more"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "null"),
        (True, "true"),
        (False, "false"),
        (0.1, "0.1"),
        ("5 mm", "'5 mm'"),
        ({"a": [1, None]}, "{'a': [1, None]}"),
        pytest.param(10**5000, "a whole number of more than 60 digits", id="huge"),
        ([10**5000], "[a whole number of more than 60 digits]"),
    ],
)
def test_values_are_shown_as_they_were_written(value: object, text: str) -> None:
    assert shown(value) == text


def test_a_huge_value_is_shown_short_and_at_once() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    start = time.perf_counter()
    for value in ("x" * 10_000_000, [["y" * 1000] * 1000] * 1_000_000, deep, dict.fromkeys(range(10**6))):
        assert len(shown(value)) <= 60
    assert time.perf_counter() - start < 2.0
