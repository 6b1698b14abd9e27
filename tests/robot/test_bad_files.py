"""Files that hold no robot: not text, not YAML, not one document, or out to do harm."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from beamstiff.errors import BeamstiffError
from beamstiff.robot.reader import load_robot, parse_robot

SMALL = """beamstiff: 1
name: small
nodes:
  - {name: a}
  - {name: b, at: [1, 0, 0]}
  - {name: c, at: [1, 0, 0]}
rigids: [{name: link, nodes: [a, b]}]
"""
REST = "fixed: [a]\ntcp: c\n"
STEEL = "materials: {m: {E: 1, G: 1}}\nsections: {s: {A: 1, Iy: 1, Iz: 1, J: 1}}\n"

WHOLE = {
    "empty": (b"", " is empty"),
    "white space": (b" \n\n  \n", " is empty"),
    "comments only": (b"# a robot\n# to be written\n", " is empty"),
    "one word": (b"robot\n", "1: found 'robot', expected keys with values, the first `beamstiff: 1`"),
    "list": (b"- beamstiff: 1\n", "1: found [{'beamstiff': 1}], expected keys with values"),
    "another YAML file": (
        b"joint_names: [a, b]\n",
        "1: beamstiff: is missing: a robot starts with `beamstiff: 1`",
    ),
    "nothing but the version": (b"beamstiff: 1\n", "1: name: is missing (and 3 more)"),
    "binary": (b"\x7fELF\x02\x01\x01\0\0\0", "1: found a binary file (null character), expected text"),
    "picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "3: found a binary file (null character), expected text"),
    "Latin 1": (
        "beamstiff: 1\nname: M\xfcller\n".encode("latin-1"),
        "2: found the byte 0xfc, expected UTF-8 text",
    ),
    "control character": (
        b"beamstiff: 1\nname: a\x07b\n",
        "2: found the character '\\x07', expected printable text",
    ),
    "tab": (b"beamstiff: 1\nnodes:\n\t- {name: a}\n", "3: not valid YAML:"),
    "open bracket": (
        b"beamstiff: 1\nfixed: [a, b\ntcp: c\n",
        "3: not valid YAML: did not find expected ',' or ']' while parsing a flow sequence that starts "
        "on line 2",
    ),
    "open quote": (b"beamstiff: 1\nname: 'a\n", "not valid YAML: found unexpected end of stream"),
    "wrong indent": (
        b"beamstiff: 1\nnodes:\n  - {name: a}\n - {name: b}\n",
        "4: not valid YAML: did not find expected",
    ),
    "two colons": (b"beamstiff: 1\nname: a: b\n", "2: not valid YAML: mapping values are not allowed"),
    "key without a colon": (b"beamstiff: 1\nname\ntcp: a\n", "not valid YAML: could not find expected ':'"),
    "unfit character": (
        b"beamstiff: 1\nname: @home\n",
        "2: not valid YAML: found character that cannot start any token",
    ),
    "YAML 2": (b"%YAML 2.0\n---\nbeamstiff: 1\n", "1: not valid YAML: found incompatible YAML document"),
    "anchor on a key": (b"&x a: b\n", "1: found the anchor &x on a key"),
    "deep keys": (b"? " * 100_000 + b"a", "1: found a map as a key, expected text"),
    "no nodes": (
        b"beamstiff: 1\nname: a\nnodes: []\nfixed: [a]\ntcp: a\n",
        "3: nodes: found [], expected at least 1",
    ),
    "zero-length beam": (
        f"{SMALL}{STEEL}beams:\n  - {{name: beam, nodes: [b, c], section: s, material: m}}\n{REST}".encode(),
        "11: beams[0] (beam).nodes: the beam 'beam' has zero length: its nodes 'b' and 'c' coincide "
        "(those of a rigid may)",
    ),
    "zero-length strut": (
        f"{SMALL}struts: [{{name: rod, nodes: [b, c], stiffness: 1}}]\n{REST}".encode(),
        "8: struts[0] (rod).nodes: the strut 'rod' has zero length: its nodes 'b' and 'c' coincide",
    ),
    "disconnected node": (
        f"{SMALL}{REST}".encode(),
        "6: nodes[2] (c): disconnected part: nodes c are connected to no fixed node; join them to what "
        "carries them with a beam, a joint or a rigid, such as {name: mount, nodes: [b, c]} under `rigids`",
    ),
    "frame and node of one name": (
        f"{SMALL}{REST}frames: [{{name: b}}]\nloops: [{{name: l, a: b, b: c, constrain: pose}}]\n".encode(),
        "11: loops[0] (l).a: 'b' is both a frame and a node: rename one",
    ),
    "coupling that overflows": (
        f"{SMALL}{REST}variables:\n  - {{name: q, type: revolute}}\n  - {{name: r, equals: 1e300*q}}\n"
        "  - {name: s, equals: 1e300*r}\n".encode(),
        "10: variables: variable 's': its coupling overflows, expected finite coefficients",
    ),
    "circle of coupled variables": (
        f"{SMALL}{REST}variables:\n  - {{name: q, equals: r}}\n  - {{name: r, equals: 2*s}}\n"
        "  - {name: s, equals: -q}\n".encode(),
        "is coupled to itself: ",
    ),
}


@pytest.mark.parametrize("case", WHOLE)
def test_a_file_that_is_no_robot_is_refused(case: str, message_for: Callable[[bytes], str]) -> None:
    text, expected = WHOLE[case]
    start = time.perf_counter()
    assert expected in message_for(text)
    assert time.perf_counter() - start < 2.0


def test_another_encoding_is_named(everything: str, message_for: Callable[[bytes], str]) -> None:
    for encoding in ("utf-16", "utf-16-le", "utf-16-be"):
        assert "found UTF-16 text, expected UTF-8" in message_for(everything.encode(encoding)) or (
            "found a binary file" in message_for(everything.encode(encoding))
        )


TAGS = [
    "!!python/object/apply:os.system ['touch {file}']",
    "!!python/object/apply:os.system\n- touch {file}",
    "!!python/object/new:subprocess.Popen [['touch', '{file}']]",
    "!!python/object/apply:subprocess.check_output [['touch', '{file}']]",
    "!!python/object/apply:eval [\"open('{file}', 'w')\"]",
    "!!python/object/new:type {{args: ['x', !!python/tuple [], {{'extend': !!python/name:exec }}], "
    "listitems: \"open('{file}', 'w')\"}}",
    "!!python/name:os.system",
    "!!python/module:antigravity",
    "!<tag:yaml.org,2002:python/object/apply:os.system> ['touch {file}']",
    "!!binary aGVsbG8=",
    "!!timestamp 2026-01-01",
    "!!set {{a}}",
    "!!str text",
    "!local thing",
    "! thing",
]


@pytest.mark.parametrize("tag", TAGS)
@pytest.mark.parametrize("place", ["tcp: {}", "tcp: [{}]", "{}", "? {}\n: a", "- {}"])
def test_yaml_that_tries_to_run_code_is_refused_and_runs_nothing(
    tag: str, place: str, tmp_path: Path, message_for: Callable[[str], str]
) -> None:
    trace = tmp_path / "trace"
    message = message_for(place.format(tag.format(file=trace)))
    assert "nothing in a file is ever run" in message or "not valid YAML" in message
    assert not trace.exists()
    assert "antigravity" not in sys.modules


@pytest.mark.parametrize(("first", "part"), [("[x, x, x, x, x, x, x, x, x]", "[{}]"), ("{a: b}", "{{{}}}")])
def test_a_bomb_of_aliases_is_refused(first: str, part: str, message_for: Callable[[str], str]) -> None:
    rows = [f"a0: &a0 {first}"]
    for level in range(1, 40):
        items = [f"*a{level - 1}"] * 9
        inside = ", ".join(items if part == "[{}]" else (f"k{at}: {item}" for at, item in enumerate(items)))
        rows.append(f"a{level}: &a{level} {part.format(inside)}")
    start = time.perf_counter()
    message = message_for("\n".join(rows))
    assert "the aliases of this file stand for more than 1,000,000 values" in message
    assert time.perf_counter() - start < 1.0


def test_a_large_but_bounded_expansion_is_refused_in_a_moment(message_for: Callable[[str], str]) -> None:
    rows = [
        "beamstiff: 1",
        "name: a",
        f"materials: &a [{', '.join(['x'] * 90)}]",
        f"sections: &b [{', '.join(['*a'] * 100)}]",
    ]
    rows.append(f"nodes: [{', '.join(['*b'] * 90)}]")
    start = time.perf_counter()
    assert "(and " in message_for("\n".join(rows))
    assert time.perf_counter() - start < 5.0


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    (tmp_path / "kr240.yaml").write_text("beamstiff: 1\n")
    for path, expected in (
        (tmp_path, "is a folder, expected a file"),
        (tmp_path / "kr420.yaml", "no such file (did you mean 'kr240.yaml'?)"),
        (tmp_path / "nowhere" / "kr240.yaml", "no such file"),
        (tmp_path / "kr240.yaml" / "kr240.yaml", "cannot be read: not a directory"),
        (tmp_path / ("x" * 5000), "cannot be read: file name too long"),
        (tmp_path / "a\0b.yaml", "cannot be read: "),
    ):
        with pytest.raises(BeamstiffError) as error:
            load_robot(path)
        assert expected in str(error.value)
        assert str(error.value).isprintable()


def test_a_file_that_is_far_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.touch()
    os.truncate(path, 300_000_000)  # takes no room on the disk
    with pytest.raises(BeamstiffError, match=r"robot\.yaml: larger than 200 MB"):
        load_robot(path)


# Keys, values, names and structures that are wrong in a robot file: `spoiled.yaml` holds the cases


SPOILED = yaml.safe_load((Path(__file__).parent / "spoiled.yaml").read_text(encoding="utf-8")) | {
    "endless name": ("tcp: tip", f"tcp: {'x' * 5000}", "tcp: found 'xxx"),
    "endless expression": ('"q2 - 90 deg"', f'"{"+".join(["q2"] * 500)}"', "expected at most 500"),
}


@pytest.mark.parametrize("case", SPOILED)
def test_the_message_names_line_key_and_what_would_be_right(
    case: str, everything: str, message_for: Callable[[str], str]
) -> None:
    old, new, expected, *nearest = SPOILED[case]
    assert everything.count(old) == 1, "the place to spoil"
    text = everything.replace(old, new)
    line = text[: text.index(nearest[0] if nearest else new)].count("\n") + 1
    message = message_for(text)
    assert message.startswith(f"{line}: "), message
    assert expected in message


def test_the_robot_that_is_spoiled_is_good(everything: str) -> None:
    assert parse_robot(everything).name == "everything"
