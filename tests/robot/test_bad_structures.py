"""Sections, names, expressions and structures that are wrong in a robot file.

Each case spoils one place of `everything.yaml`: old text, new text, what the message must hold. The message
must also name the file, and the line of the spoiled place.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

SPOILED = {
    # sections
    "negative second moment": (
        "{A: 2.1e-2, Iy: 1.9e-4",
        "{A: 2.1e-2, Iy: -1.9e-4",
        "sections.given.Iy: found -0.00019, expected a positive second moment of area",
    ),
    "missing property": (
        "{A: 2.1e-2, Iy: 1.9e-4, Iz: 1.9e-4, J: 3.1e-4}",
        "{A: 2.1e-2, Iy: 1.9e-4, Iz: 1.9e-4}",
        "sections.given.J: is missing: a section given by its properties needs A, Iy, Iz, J",
    ),
    "missing dimension": (
        '{shape: tube, outer: "300 mm", wall: "12 mm"}',
        '{shape: tube, outer: "300 mm"}',
        "sections.tube.wall: is missing: the shape tube needs outer, wall",
    ),
    "dimension of another shape": (
        '{shape: tube, outer: "300 mm",',
        '{shape: tube, outer: "300 mm", width: 0.1,',
        "sections.tube.width: does not belong to the shape tube, which needs outer, wall",
    ),
    "shape and properties": (
        '{shape: tube, outer: "300 mm",',
        '{shape: tube, outer: "300 mm", A: 0.1,',
        "sections.tube.A: does not belong to the shape tube",
    ),
    "unknown shape": (
        "{shape: tube,",
        "{shape: pipe,",
        "sections.tube.shape: found 'pipe', expected 'tube', 'circle', 'box', 'rectangle' or 'I'",
    ),
    "wall too thick": (
        'wall: "12 mm"',
        'wall: "150 mm"',
        "sections.tube.wall: found 0.15 m, expected less than 0.15 m for this tube",
    ),
    "web too thick": (
        'web: "6 mm"',
        'web: "0.1 m"',
        "sections.profile.web: found 0.1 m, expected less than 0.1 m",
    ),
    "flange too thick": (
        'flange: "9 mm"',
        'flange: "0.1 m"',
        "sections.profile.flange: found 0.1 m, expected less than 0.1 m",
    ),
    "section beyond the range of numbers": (
        'outer: "300 mm", wall: "12 mm"',
        "outer: 1e200, wall: 1e198",
        "sections.tube.outer: found 1e+200: its section properties leave the range of numbers",
    ),
    "section below the range of numbers": (
        'outer: "300 mm", wall: "12 mm"',
        "outer: 1e-200, wall: 1e-202",
        "sections.tube.outer: found 1e-200: its section properties leave the range of numbers",
    ),
    # names that do not exist, or twice
    "unknown node": (
        "{name: column, nodes: [n0, n0b]",
        "{name: column, nodes: [n0, n0c]",
        "beams[0] (column).nodes[1]: unknown node 'n0c' (did you mean 'n0'?)",
    ),
    "unknown section": (
        "section: box,",
        "section: bax,",
        "beams[1] (swing).section: unknown section 'bax' (did you mean 'box'?)",
    ),
    "unknown material": (
        "section: shear, material: carbon",
        "section: shear, material: carbn",
        "beams[2] (arm).material: unknown material 'carbn' (did you mean 'carbon'?)",
    ),
    "unknown frame of a node": (
        "{name: n3b, frame: f3}",
        "{name: n3b, frame: f33}",
        "nodes[5] (n3b).frame: unknown frame 'f33' (did you mean 'f3'?)",
    ),
    "unknown frame of a joint": (
        "nodes: [n0b, n1], frame: f1,",
        "nodes: [n0b, n1], frame: frame1,",
        "joints[0] (J1).frame: unknown frame 'frame1'",
    ),
    "unknown parent": (
        "parent: f8",
        "parent: g8",
        "frames[5] (f9).parent: unknown frame 'g8'",
    ),
    "unknown variable of a joint": (
        "axis: z, variable: q2",
        "axis: z, variable: q22",
        "joints[1] (J2).variable: unknown variable 'q22' (did you mean 'q2'?)",
    ),
    "unknown end of a loop": (
        "b: n9,",
        "b: n99,",
        "loops[0] (closure).b: unknown frame or node 'n99' (did you mean 'n9'?)",
    ),
    "unknown node of a mass": (
        "{node: tip,",
        "{node: top,",
        "masses[0].node: unknown node 'top' (did you mean 'tip'?)",
    ),
    "unknown fixed node": ("fixed: [n0]", "fixed: [n0, m0]", "fixed[1]: unknown node 'm0'"),
    "unknown tcp": ("tcp: tip", "tcp: tipp", "tcp: unknown node 'tipp' (did you mean 'tip'?)"),
    "unknown parameter": (
        "J33.radial,",
        "J33.radal,",
        "identify[1]: unknown stiffness parameter 'J33.radal' (did you mean 'J33.radial'?)",
    ),
    "duplicate node": (
        "- {name: n1, frame: f1}",
        "- {name: n0, frame: f1}",
        "nodes[2] (n0).name: duplicate name 'n0'",
    ),
    "duplicate variable": (
        "{name: q2, type: revolute}",
        "{name: q1, type: revolute}",
        "variables[1] (q1).name: duplicate name 'q1'",
    ),
    "duplicate frame": ("{name: f9, parent", "{name: f8, parent", "frames[5] (f8).name: duplicate name 'f8'"),
    "duplicate element of another kind": (
        "{name: screw, nodes",
        "{name: arm, nodes",
        "struts[0] (arm).name: duplicate name 'arm', already used in beams",
    ),
    "strut with a joint's stiffness name": (
        "{name: rod, nodes",
        "{name: J2.axial, nodes",
        "struts[1] (J2.axial).name: 'J2.axial' is also the name of another stiffness: rename it",
    ),
    "strut with a beam's stiffness name": (
        "{name: rod, nodes",
        "{name: arm.E, nodes",
        "struts[1] (arm.E).name: 'arm.E' is also the name of another stiffness: rename it",
    ),
    "frame called base": (
        "{name: f9, parent",
        "{name: base, parent",
        "frames[5] (base).name: the name 'base' is the",
    ),
    "fixed twice": ("fixed: [n0]", "fixed: [n0, n0]", "fixed[1]: 'n0' is named twice"),
    "identified twice": ("J33.radial,", "J2.torsional,", "identify[1]: 'J2.torsional' is named twice"),
    "identify what is rigid": (
        "J33.radial,",
        "J2.axial,",
        "identify[1]: 'J2.axial' is rigid: give it a number to start from",
    ),
    "identify what is free": (
        "J33.radial,",
        "J33.torsional,",
        "identify[1]: 'J33.torsional' is free: give it a number to start from",
    ),
    # variables, expressions, frames
    "variable without a type": (
        "{name: q2, type: revolute}",
        "{name: q2}",
        "variables[1] (q2).type: is missing: expected revolute or prismatic (or `equals`)",
    ),
    "passive and coupled": (
        '{name: q6, equals: "-q2 + 5 deg"}',
        '{name: q6, equals: "-q2 + 5 deg", passive: true}',
        "variables[5] (q6).passive: q6 cannot be passive and coupled by `equals`",
    ),
    "coupled to itself": (
        'equals: "-q2 + 5 deg"',
        'equals: "-q6"',
        "variables[5] (q6).equals: 'q6' is coupled to itself: q6 -> q6",
    ),
    "coupled to nothing": (
        'equals: "-q2 + 5 deg"',
        'equals: "-q22 + 5 deg"',
        "variables[5] (q6).equals: found the unknown variable 'q22' in '-q22 + 5 deg' (did you mean 'q2'?)",
    ),
    "passive without a loop": (
        "loops:\n  - {name: closure, a: f3, b: n9, constrain: position}\n",
        "",
        "loops: is missing: the passive variables th3, th9 are solved by loop closure",
    ),
    "loop of one place": (
        "a: f3, b: n9",
        "a: n9, b: n9",
        "loops[0] (closure).b: found 'n9' at both ends, expected two different frames or nodes",
    ),
    "cycle of frames": ("parent: base, theta", "parent: f3, theta", "cycle of frames: f1 -> f3 -> f2 -> f1"),
    "frame that is its own parent": (
        "parent: base, theta",
        "parent: f1, theta",
        "frames[0] (f1).parent: cycle of frames: f1 -> f1",
    ),
    "unknown variable in a frame": (
        '"q2 - 90 deg"',
        '"Q2 - 90 deg"',
        "frames[1] (f2).theta: found the unknown variable 'Q2' in 'Q2 - 90 deg' (did you mean 'q2'?)",
    ),
    "product of variables": (
        '"q2 - 90 deg"',
        '"q2*q1 - 90 deg"',
        "frames[1] (f2).theta: found 'q2*q1 - 90 deg', expected a linear expression of variables such as",
    ),
    "function of a variable": (
        '"q2 - 90 deg"',
        '"sin(q2)"',
        "frames[1] (f2).theta: found the unknown variable 'sin'",
    ),
    "code for an expression": (
        '"q2 - 90 deg"',
        "\"__import__('os').system('true')\"",
        "frames[1] (f2).theta: found the unknown variable '__import__'",
    ),
    "lambda for an expression": (
        '"q2 - 90 deg"',
        '"(lambda: 0)()"',
        "frames[1] (f2).theta: found '(lambda: 0)()', expected a linear expression",
    ),
    "division by zero": ('"pi/2"', '"pi/0"', "frames[3] (f6).gamma: found a division by zero in 'pi/0'"),
    "wrong unit in an expression": (
        '"q2 - 90 deg"',
        '"q2 - 90 mm"',
        "frames[1] (f2).theta: found the unit 'mm', expected a unit of angle such as rad",
    ),
    "angle for a length": (
        "r: s8",
        "r: q2",
        "frames[4] (f8).r: found 'q2': an angle where a length is expected; give the coefficient a unit",
    ),
    "expression that overflows": (
        '"q2 - 90 deg"',
        '"q2 * 1e300 * 1e300"',
        "frames[1] (f2).theta: found 'q2 * 1e300 * 1e300', expected finite numbers",
    ),
    "endless expression": ('"q2 - 90 deg"', f'"{"+".join(["q2"] * 500)}"', "expected at most 500"),
    "true for an expression": (
        '"q2 - 90 deg"',
        "true",
        "frames[1] (f2).theta: found true, expected a number",
    ),
    "list for an expression": (
        '"q2 - 90 deg"',
        "[q2]",
        "frames[1] (f2).theta: found ['q2'], expected a number",
    ),
    # structure
    "beam from a node to itself": (
        "nodes: [n2, n3], section: box",
        "nodes: [n2, n2], section: box",
        "beams[1] (swing).nodes: found 'n2' at both ends of 'swing', expected two nodes",
    ),
    "up along the beam": (
        "material: steel, up: [0, 0, 1]",
        "material: steel, up: [2, 0, 0]",
        "beams[1] (swing).up: found [2.0, 0.0, 0.0], which is parallel to the beam 'swing'",
    ),
    "up missing": (
        "material: steel, up: [0, 0, 1]",
        "material: steel",
        "beams[1] (swing).up: is missing: the section 'box' of 'swing' is not alike in all directions",
    ),
    "zero up": (
        "material: steel, up: [0, 0, 1]",
        "material: steel, up: [0, 0, 0]",
        "beams[1] (swing).up: found a zero",
    ),
    "joint of nodes apart": (
        "{name: J1, nodes: [n0b, n1], frame",
        "{name: J1, nodes: [n0, n0b], frame",
        "joints[0] (J1).nodes: the nodes 'n0' and 'n0b' of the joint 'J1' are 0.885 m apart, expected",
    ),
    "passive joint that is rigid by default": (
        "torsional: free, tilting: 3e6",
        "tilting: 3e6",
        "joints[2] (J33).stiffness.torsional: is missing: 'th3' is passive, say free, a stiffness or rigid",
    ),
}
# where the message's line is not the new text's: a key that is missing, a duplicate
NEAREST = {
    "passive without a loop": "beamstiff: 1",
    "duplicate frame": "{name: f8, parent: f8",
    "duplicate element of another kind": "{name: arm, nodes: [n9",
    "true for an expression": "{name: f2, parent",
    "up missing": "{name: swing",
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
