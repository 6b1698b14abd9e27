"""Malformed files of every kind, for the tests and for `benchmarks.malformed_inputs`.

Some come with what the one line has to hold that refuses them.
"""

import random
import re
from collections.abc import Iterator, Sequence

ALIAS_BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)

# old and new text in the crane of `tests.cli.conftest`, or a whole file; what the message holds
BROKEN_ROBOTS: list[tuple[str | None, str | bytes, list[str]]] = [
    (None, b"", ["broken.yaml", "empty"]),
    (None, b"\x00\x01\x02\xff", ["broken.yaml", "binary"]),
    (None, b"name: \xff\xfe", ["broken.yaml"]),
    (None, b"beamstiff: 1\nname: [", ["broken.yaml:"]),
    (None, b"- just\n- a list\n", ["broken.yaml:1"]),
    (None, b"beamstiff: 1\nname: !!python/object/apply:os.system ['touch pwned']\n", ["broken.yaml:2"]),
    (None, ALIAS_BOMB.encode(), ["broken.yaml"]),
    ("beamstiff: 1", "beamstiff: 2", ["broken.yaml:1", "beamstiff", "2"]),
    ("tcp: tip", "tcq: tip", ["broken.yaml:16", "tcq: unknown key", "did you mean 'tcp'"]),
    ("tcp: tip\n", "", ["tcp"]),
    ("tcp: tip", "tcp: top", ["'top'", "did you mean 'tip'"]),
    ("fixed: [foot]", "fixed: [feet]", ["broken.yaml:15", "unknown node 'feet'"]),
    ("theta: q1", "theta: q2", ["q2"]),
    ("name: q1", "name: fx", ["broken.yaml:4", "'fx' is a column", "rename the variable"]),
    ("theta: q1", "theta: q1 * q1", ["q1 * q1"]),
    ("theta: q1", "parent: f1, theta: q1", ["f1"]),
    ("name: hub, frame: f1", "name: foot, frame: f1", ["foot"]),
    ('["1 m", 0, 0]', '["1 kg", 0, 0]', ["'kg'", "length"]),
    ('["1 m", 0, 0]', "[.nan, 0, 0]", ["nan"]),
    ('["1 m", 0, 0]', "[1e999, 0, 0]", ["1e999"]),
    ('["1 m", 0, 0]', "[1, 0]", ["nodes[2] (tip)"]),
    ('torsional: "1e6 N*m/rad"', 'torsional: "-1e6 N*m/rad"', ["torsional", "-1e6"]),
    ('torsional: "1e6 N*m/rad"', 'torsional: "1e6 N*m"', ["N*m/rad"]),
    ('torsional: "1e6 N*m/rad"', "torsional: stiff", ["'stiff'", "rigid"]),
    ('torsional: "1e6 N*m/rad"', "torsional: free", ["'J1.torsional' is free"]),
    ("nodes: [hub, tip]", "nodes: [hub, hub]", ["arm"]),
    ("rigids: [{name: arm, nodes: [hub, tip]}]", "", ["tip"]),
    (
        "rigids: [{name: arm, nodes: [hub, tip]}]",
        "rigids: [{name: arm, nodes: [hub, tip]}]\nrigids: []",
        ["rigids"],
    ),
    ('["1 m", 0, 0]}', '["1 m", 0, 0]}\n  - {name: far, at: [9, 9, 9]}', ["far"]),
    ("identify: [J1.torsional]", "identify: [J1.turning]", ["'J1.turning'"]),
]

# a table for the crane; what the message holds
BROKEN_TABLES: list[tuple[bytes, list[str]]] = [
    (b"", ["broken.csv", "empty"]),
    (b"\x00\xff\x00", ["broken.csv", "binary"]),
    (b"q1,fy,dy [mm]\n", ["broken.csv"]),
    (b"fy,dy [mm]\n1000,1.5\n", ["broken.csv:1", "q1"]),
    (b"q1,fq,dy [mm]\n0,1000,1.5\n", ["broken.csv:1", "fq"]),
    (b"q1,fy,dy [mm]\n0,1000\n", ["broken.csv:2"]),
    (b"q1,fy,dy [mm]\n0,1000,1.5,7\n", ["broken.csv:2"]),
    (b"q1,fy,dy [mm]\n0,much,1.5\n", ["broken.csv:2", "fy", "'much'"]),
    (b"q1,fy,dy [mm]\n0,1000,nan\n", ["broken.csv:2", "dy", "nan"]),
    (b"q1,fy,dy [mm]\n0,inf,1.5\n", ["broken.csv:2", "fy", "inf"]),
    (b"q1,fy,dy [kg]\n0,1000,1.5\n", ["broken.csv:1", "kg"]),
    (b"q1,fy,fy,dy [mm]\n0,1000,1000,1.5\n", ["broken.csv:1", "fy"]),
    (b"q1,fy,dy [mm],x [mm]\n0,1000,1.5,1000\n", ["broken.csv:1"]),
    (b"# sigma_position: -1 mm\nq1,fy,dy [mm]\n0,1000,1.5\n", ["broken.csv:1", "sigma_position"]),
    (b"q1,fy,dy [mm],point\n0,1000,1.5,top\n", ["broken.csv:2", "'top'"]),
    (b"q1,A [deg],B [deg],C [deg],x\n0,1,2,3,1\n", ["broken.csv:1", "Euler"]),
    (b"q1,fy\n0,1000\n", ["broken.csv", "measured"]),
    (b"q1,fy,x [mm],y [mm]\n0,1000,1000,1.5\n", ["broken.csv", "absolute"]),
    (b"q1,fy,dy [mm]\n0,0,0\n", ["broken.csv"]),
    (b"q1,fy,dy [mm]\n0,1e-300,1\n1,1e-300,1\n", ["broken.csv", "without load"]),
    (b"q1,fx,dx [mm]\n0,1000,0.5\n", ["J1.torsional"]),
]

# what no reader can use, whatever it reads
ANYTHING: dict[str, bytes] = {
    "empty": b"",
    "white space": b" \n\t\r\n",
    "byte order mark": b"\xef\xbb\xbf",
    "two byte order marks": b"\xef\xbb\xbf\xef\xbb\xbfbeamstiff: 1\n",
    "NUL": b"\x00",
    "NUL within": b"beamstiff: 1\nname: a\x00b\n",
    "binary": bytes(range(256)),
    "not UTF-8": b"name: \xff\xfe\xfa\n",
    "UTF-16": "name: a\nq1,fy\n0,1\n".encode("utf-16"),
    "UTF-32": "name: a\nq1,fy\n0,1\n".encode("utf-32"),
    "surrogates": b"name: \xed\xa0\x80\n",
    "control characters": b"q1,fy\x07\n0,1\x1b[2J\n",
    "carriage returns": b"q1,fy\r0,1\r",
    "alias bomb": ALIAS_BOMB.encode(),
    "entity bomb": b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
    b'<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;">]><robot name="&c;"/>',
    "file of the machine": b'<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="&a;"/>',
    "deep lists": b"beamstiff: 1\nnodes: " + b"[" * 20_000,
    "deep maps": b"rows: " + b"{a: " * 20_000,
    "deep blocks": b"- " * 20_000 + b"a",
    "deep tags": b"<robot>" * 20_000,
    "deep tags, closed": b"<sdf>" + b"<a>" * 5_000 + b"</a>" * 5_000 + b"</sdf>",
    "a long line": b"q" * 2_000_000,
    "a huge integer": b"beamstiff: " + b"9" * 5_000 + b"\n",
    "many commas": b"," * 200_000 + b"\n",
    "open quote": b'q1,fy\n"0,1\n',
    "code": b"!!python/object/apply:os.system [exit]\n",
    "null": b"null\n",
    "a list": b"- a\n- b\n",
    "a number": b"1\n",
    "JSON": b'{"format": "beamstiff-diagnosis/1", "gap": {}}\n',
    "HTML": b"<!doctype html><title>404</title>\n",
}
WORDS = [
    *("", "nan", ".nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e-320", "0", "-1", "9" * 400, "1_0"),
    *("0x10", "1,5", "null", "true", "[]", "{}", "[1, 2, 3, 4]", "{a: 1}", "'1'", "x", "q1", "tip", "1 kg"),
    *("1 mm", "deg", "rigid", "free", "\u0661", "\u00e9", "\x00", "\ufeff", "x" * 3000, "<a>", "&amp;", '"'),
    *("1 2", "--1"),
]
ODD = r"""
NaN -.inf Infinity -1e999 1e200 1e-200 1e400 1e-400 -0.0 1.5.5 +-1 e5 . 1e 1d5 1:30 010 NA None ~ no
=1+1 '' "" [[]] % ° µ ' \ ` @ # | > , ; : [ ] [mm] [deg] [mm**999] [N*m/rad] < /> Rigid &a *a <<: << --- ...
-- q3 q1*q1 q1/0 pi base 日本 A B C dx pose step point sigma_dx t joint revolute fixed
mm __import__('os').abort()
"""
# what is hard on some reader, wherever it stands
NASTY = [
    *(*WORDS, *ODD.split()),
    *("{a: }", "5 parsec", "[5 parsec]", "5 deg", "5 mm", "5 N*m/rad", "1e5 N/mm**9", "5 m/m", "0 0 0"),
    *(
        "&a [*a]",
        "<<: *steel",
        "!!python/object/apply:os.abort []",
        "!!binary aa==",
        "! a",
        "%YAML 9.9\n---\n",
    ),
    *("2*q1 + 1e308*q1 + 1e308*q1", "1e" + "9" * 300, "+".join(["q1"] * 200), "a" * 5000, "q" * 140_000),
    *("[" * 300, "{a: " * 300, "- " * 300, "? " * 300, "# sigma_position: 0", "# sigma_rotation: -1"),
    *("# history: continuous", "# orientation: rotation vector", "# decimal: comma"),
    *(
        "\t",
        "\n",
        "\r",
        "\r\n",
        "\x07",
        "\x0b",
        "\x0c",
        "\x1b[31m",
        "\x1c",
        "\x7f",
        "\x85",
        "\u2028",
        "\u202e",
    ),
    *("\uff11", "\U0001d7cf", "\U0001f916", " ", " #", ": ", "- ", "? ", "\n  - ", "\n- ", "\n    ", ", ,"),
]
KINDS = (
    "token",
    "token",
    "character",
    "insert",
    "cell",
    "line",
    "columns",
    "indent",
    "cut",
    "signs",
    "splice",
)
TOKEN = re.compile(r"\"[^\"]*\"|'[^']*'|[\w.+*/^-]+|[^\w\s]")
_WORD = re.compile(r"[\w.+-]+")


def with_other_words(text: str, count: int, seed: int = 0) -> Iterator[tuple[str, bytes]]:
    """Yield a name and a text, `count` times: a word is another one, a line twice, or the rest missing."""
    generator = random.Random(seed)
    spans = [match.span() for match in _WORD.finditer(text)]
    for _ in range(count):
        start, end = generator.choice(spans)
        kind = generator.choice(["word"] * 4 + ["line twice", "cut"])
        if kind == "word":
            word = generator.choice(WORDS)
            yield f"{text[start:end]} -> {word[:20]!r}", (text[:start] + word + text[end:]).encode()
        elif kind == "cut":
            yield f"cut at {start}", text[:start].encode()
        else:
            lines = text.splitlines(keepends=True)
            at = text.count("\n", 0, start)
            yield f"line {at + 1} twice", "".join([*lines[: at + 1], lines[at], *lines[at + 1 :]]).encode()


def damaged(text: str, source: random.Random, others: Sequence[str]) -> str:
    """Return a text with one to four faults: in characters, words, cells, lines, columns."""
    for _ in range(source.randint(1, 4)):
        at, lines = source.randrange(len(text) + 1), text.split("\n")
        line, tokens = source.randrange(len(lines)), [match.span() for match in TOKEN.finditer(text)]
        match source.choice(KINDS):
            case "token" if tokens:
                (start, end), (first, last) = source.choice(tokens), source.choice(tokens)
                new = source.choice([text[first:last], text[first:last][::-1], source.choice(NASTY)])
                text = text[:start] + new + text[end:]
            case "character":
                new = chr(source.choice([source.randrange(128), source.randrange(0xD800)]))
                text = text[:at] + new + text[at + 1 :]
            case "insert":
                text = text[:at] + source.choice(NASTY) + text[at:]
            case "cell":
                cells = lines[line].split(",")
                cells[source.randrange(len(cells))] = source.choice(NASTY)
                lines[line] = ",".join(cells)
                text = "\n".join(lines)
            case "line":  # away, twice, or elsewhere
                moved = lines.pop(line)
                for _ in range(source.randrange(3)):
                    lines.insert(source.randrange(len(lines) + 1), moved)
                text = "\n".join(lines)
            case "columns":  # one less or twice
                column, copies = source.randrange(12), source.choice([0, 2])
                cut = [row.split(",") for row in lines]
                cut = [row[:column] + row[column : column + 1] * copies + row[column + 1 :] for row in cut]
                text = "\n".join(",".join(row) for row in cut)
            case "indent":
                lines[line] = source.choice(["", " ", "  ", "    ", "\t", "- "]) + lines[line].lstrip()
                text = "\n".join(lines)
            case "cut":
                text = text[:at] + source.choice(["", text[at + source.randrange(1, 20) :]])
            case "signs":
                signs = [(",", ";"), (";", ","), (",", "\t"), (".", ","), (" ", ""), ("\n", "\r")]
                text = text.replace(*source.choice(signs))
            case "splice":
                other = source.choice(others)
                text += source.choice(["", "\n"]) + other[source.randrange(len(other)) :]
    return text
