"""Keys, kinds of values and quantities that are wrong in a robot file.

Each case spoils one place of `everything.yaml`: old text, new text, what the message must hold. The message
must also name the file, and the line of the spoiled place.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from beamstiff.robot.reader import parse_robot

SPOILED = {
    # keys
    "unknown key": ("tcp: tip", "tcp: tip\nTCP: n1", "TCP: unknown key (did you mean 'tcp'?)"),
    "misspelt key": (
        "identify: [",
        "identfy: [",
        "identfy: unknown key (did you mean 'identify'?)",
    ),
    "misspelt required key": ("fixed: [n0]", "fixd: [n0]", "fixd: unknown key (did you mean 'fixed'?)"),
    "misspelt key of an item": (
        "{axial: 1e9,",
        "{axal: 1e9,",
        "joints[2] (J33).stiffness.axal: unknown key (did you mean 'axial'?)",
    ),
    "key of another part": (
        "{node: tip, mass",
        "{name: tip, mass",
        "masses[0] (tip).name: unknown key",
    ),
    "missing key": (", frame: f1, variable: q1,", ", variable: q1,", "joints[0] (J1).frame: is missing"),
    "missing tcp": ("tcp: tip\n", "", "tcp: is missing"),
    "missing name": ("name: everything\n", "", "name: is missing"),
    "duplicate key": (
        "tcp: tip",
        "tcp: tip\ntcp: n1",
        "duplicate key 'tcp', first on line",
    ),
    "duplicate key of an item": (
        "frame: f3, axis: [0, 0, 1],",
        "frame: f3, axis: [0, 0, 1], frame: f2,",
        "joints[2]: duplicate key 'frame', first on line",
    ),
    "duplicate material": (
        "  carbon: {",
        "  steel: {",
        "materials: duplicate key 'steel', first on line",
    ),
    "number as a key": ("tcp: tip", "tcp: tip\n5: 6", "5: unknown key"),
    "empty key": ("tcp: tip", "tcp: tip\n? \n: x", "found an empty key"),
    "list as a key": ("tcp: tip", "tcp: tip\n? [a]\n: x", "found a list as a key, expected text"),
    "map as a key": ("tcp: tip", "tcp: tip\n{a: b}: x", "found a map as a key, expected text"),
    "merge key": (
        'stiffness: {torsional: "3.8e9 N*mm/rad"}',
        "stiffness: {<<: {torsional: 1e6}}",
        "joints[0].stiffness: found the merge key <<, which is not supported: write the keys out",
    ),
    # version
    "no version": ("beamstiff: 1\n", "", "beamstiff: is missing: a robot starts with `beamstiff: 1`"),
    "version of the future": ("beamstiff: 1\n", "beamstiff: 2\n", "beamstiff: found version 2, expected 1"),
    "version as text": ("beamstiff: 1\n", "beamstiff: '1'\n", "beamstiff: found version '1', expected 1"),
    "version true": ("beamstiff: 1\n", "beamstiff: true\n", "beamstiff: found version true, expected 1"),
    # kinds of values
    "text for a list": ("fixed: [n0]", "fixed: n0", "fixed: found 'n0', expected a list"),
    "nothing for a list": (
        "fixed: [n0]",
        "fixed:",
        "fixed: found null, expected a list",
    ),
    "empty list": ("fixed: [n0]", "fixed: []", "fixed: found [], expected at least 1 in the list"),
    "map for a list": ("fixed: [n0]", "fixed: {n0: 1}", "fixed: found {'n0': 1}, expected a list"),
    "list for a map": (
        "  carbon: {E: 1.2e11, G: 5e9}",
        "  carbon: [1.2e11, 5e9]",
        "materials.carbon: found [120000000000.0, 5000000000.0], expected keys with values",
    ),
    "text for an item": (
        "  - {name: n3b, frame: f3}",
        "  - n3b",
        "nodes[5]: found 'n3b', expected keys with values",
    ),
    "list for a name": ("tcp: tip", "tcp: [tip]", "tcp: found ['tip'], expected a name"),
    "empty name": ("tcp: tip", "tcp: ''", "tcp: found '', expected a name"),
    "number as a name": ("tcp: tip", "tcp: 1.5", "tcp: found 1.5, expected a name"),
    "control character in a name": (
        "tcp: tip",
        'tcp: "t\\x1bip"',
        "tcp: found 't\\x1bip', expected a name: printable text",
    ),
    "endless name": ("tcp: tip", f"tcp: {'x' * 5000}", "tcp: found 'xxx"),
    "variable name with a sign": (
        "{name: q2, type",
        "{name: q-2, type",
        "variables[1] (q-2).name: found 'q-2', expected a variable name of letters, digits and _",
    ),
    "variable called pi": ("{name: q2, type", "{name: pi, type", "expected a variable name"),
    "yes for true": (
        "{name: th9, type: revolute, passive: true}",
        "{name: th9, type: revolute, passive: yes}",
        "variables[4] (th9).passive: found 'yes', expected true or false",
    ),
    "one for true": ("shear: true", "shear: 1", "sections.rod.shear: found 1, expected true or false"),
    "unknown word": (
        "constrain: position",
        "constrain: positon",
        "loops[0] (closure).constrain: found 'positon', expected 'position', 'pose' or 'plane' "
        "(did you mean 'position'?)",
    ),
    "unknown joint type": (
        "{name: q2, type: revolute}",
        "{name: q2, type: rotary}",
        "variables[1] (q2).type: found 'rotary', expected 'revolute' or 'prismatic'",
    ),
    "unknown axis": (
        "axis: z, variable: q2",
        "axis: w, variable: q2",
        "joints[1] (J2).axis: found 'w', expected x, y, z or three numbers",
    ),
    "zero axis": (
        "axis: [0, 0, 1]",
        "axis: [0, 0, 0]",
        "joints[2] (J33).axis: found a zero vector, expected a direction",
    ),
    "boundless axis": (
        "axis: [0, 0, 1]",
        "axis: [0, 0, 1e200]",
        "joints[2] (J33).axis: found a vector of length 1e+200, expected a direction",
    ),
    "vector too short": (
        "at: [0.3, 0, 0]",
        "at: [0.3, 0]",
        "nodes[7] (n9).at: found [0.3, 0], expected more values",
    ),
    "vector too long": (
        "at: [0.3, 0, 0]",
        "at: [0.3, 0, 0, 0]",
        "nodes[7] (n9).at: found [0.3, 0, 0, 0], expected at most 3 in the list",
    ),
    "number for a vector": ("at: [0.3, 0, 0]", "at: 0.3", "nodes[7] (n9).at: found 0.3, expected a list"),
    # quantities
    "not a number": (
        "at: [0.3, 0, 0]",
        "at: [.nan, 0, 0]",
        "nodes[7] (n9).at[0]: found '.nan', expected a number",
    ),
    "bare nan": ("at: [0.3, 0, 0]", "at: [nan, 0, 0]", "nodes[7] (n9).at[0]: found 'nan', expected a number"),
    "infinite": (
        "at: [0.3, 0, 0]",
        "at: [-.inf, 0, 0]",
        "nodes[7] (n9).at[0]: found '-.inf', expected a number",
    ),
    "beyond the range of numbers": (
        "at: [0.3, 0, 0]",
        "at: [1e999, 0, 0]",
        "nodes[7] (n9).at[0]: found '1e999', expected a finite number",
    ),
    "wrong unit": (
        'outer: "300 mm"',
        'outer: "300 deg"',
        "sections.tube.outer: found the unit 'deg', expected a unit of length such as m",
    ),
    "unknown unit": (
        'outer: "300 mm"',
        'outer: "5 parsec"',
        "sections.tube.outer: unknown unit 'parsec', expected a unit of length such as m",
    ),
    "moment for a stiffness": (
        '"3.8e9 N*mm/rad"',
        '"3.8e9 N*mm"',
        "joints[0] (J1).stiffness.torsional: found the unit 'N*mm', expected a unit of rotational stiffness "
        "such as N*m/rad: a stiffness about an axis is a moment per angle, N*mm/rad; or rigid, or free",
    ),
    "translational stiffness about an axis": (
        "tilting: 3e6",
        'tilting: "3 N/m"',
        "joints[2] (J33).stiffness.tilting: found the unit 'N/m', expected a unit of rotational stiffness",
    ),
    "text for a number": ("E: 1.2e11", "E: stiff", "materials.carbon.E: found 'stiff', expected a number"),
    "true for a number": ("E: 1.2e11", "E: true", "materials.carbon.E: found true, expected a number"),
    "sexagesimal": ("E: 1.2e11", "E: 1:30", "materials.carbon.E: found '1:30', expected"),
    "hexadecimal": ("E: 1.2e11", "E: 0x10", "materials.carbon.E: found the unit 'x10', expected"),
    "decimal comma": (
        'outer: "300 mm"',
        'outer: "0,3 m"',
        "sections.tube.outer: found '0,3 m', expected a number with a unit of length such as m: decimals "
        "follow a point, not a comma",
    ),
    "negative modulus": (
        "E: 1.2e11",
        "E: -1.2e11",
        "materials.carbon.E: found -120000000000.0, expected a positive",
    ),
    "zero modulus": ("G: 5e9", "G: 0", "materials.carbon.G: found 0, expected a positive modulus"),
    "negative density": (
        '"7850 kg/m^3"',
        "-1",
        "materials.steel.density: found -1, expected a density of at least 0",
    ),
    "negative mass": ('"120 kg"', "-120", "masses[0].mass: found -120, expected a positive mass"),
    "zero stiffness": (
        "axial: 1e9",
        "axial: 0",
        "joints[2] (J33).stiffness.axial: found 0, expected a positive translational stiffness, or rigid",
    ),
    "zero stiffness with a point": (
        "axial: 1e9",
        "axial: 0.0",
        "joints[2] (J33).stiffness.axial: found 0.0, expected a positive translational stiffness, or",
    ),
    "negative stiffness": (
        "axial: 1e9",
        "axial: -1e9",
        "joints[2] (J33).stiffness.axial: found -1000000000.0, expected a positive translational stiffness",
    ),
    "infinite stiffness": (
        "axial: 1e9",
        "axial: .inf",
        "joints[2] (J33).stiffness.axial: found '.inf', expected a number with a unit of translational "
        "stiffness such as N/m; or rigid, or free",
    ),
    "misspelt rigid": (
        "{axial: rigid",
        "{axial: ridig",
        "joints[1] (J2).stiffness.axial: found 'ridig', expected",
    ),
    "stiffness as one number": (
        'stiffness: {torsional: "3.8e9 N*mm/rad"}',
        "stiffness: 3.8e6",
        "joints[0] (J1).stiffness: found 3800000.0, expected keys with values",
    ),
    "limits the wrong way round": (
        '["-170 deg", "170 deg"]',
        '["170 deg", "-170 deg"]',
        "variables[0] (q1).limits: found ['170 deg', '-170 deg'], expected the lower limit below the upper",
    ),
    "one limit": (
        '["-170 deg", "170 deg"]',
        '["-170 deg"]',
        "variables[0] (q1).limits: found ['-170 deg'], expected two values: [lower, upper]",
    ),
    "limits of the wrong kind": (
        '["-170 deg", "170 deg"]',
        '["-170 mm", "170 mm"]',
        "variables[0] (q1).limits: found the unit 'mm', expected a unit of angle such as rad",
    ),
    "guess of the wrong kind": (
        'guess: "0.5 m"',
        'guess: "30 deg"',
        "variables[2] (s8).guess: found the unit 'deg', expected a unit of length",
    ),
}
# where the message's line is not the new text's: a key that is missing, a duplicate
NEAREST = {
    "no version": "name: everything",
    "missing key": "{name: J1,",
    "missing tcp": "beamstiff: 1",
    "missing name": "beamstiff: 1",
    "duplicate key": "tcp: n1",
    "unknown key": "TCP: n1",
    "number as a key": "5: 6",
    "map as a key": "{a: b}",
    "list as a key": "? [a]",
    "empty key": "? \n",
    "duplicate material": "  steel: {E: 1.2e11",
    "negative density": "  steel: {",
}


@pytest.mark.parametrize("case", SPOILED)
def test_the_message_names_line_key_and_what_would_be_right(
    case: str, everything: str, message_for: Callable[[str], str]
) -> None:
    old, new, expected = SPOILED[case]
    assert everything.count(old) == 1, "the place to spoil"
    text = everything.replace(old, new)
    line = text[: text.index(NEAREST.get(case, new))].count("\n") + 1
    message = message_for(text)
    assert message.startswith(f"{line}: "), message
    assert expected in message


def test_the_robot_that_is_spoiled_is_good(everything: str) -> None:
    assert parse_robot(everything).name == "everything"
