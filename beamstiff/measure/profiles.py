"""Lists of points from trackers and their programs, by a profile that says what the columns are.

Every program lets its user choose the columns of an export, so that no name of a program tells them: a
profile does, in YAML, with the unit of everything that has one.

.. code-block:: yaml

    comment: "//"                       # lines that begin so are passed over
    separator: ["::", comma]            # text between cells; comma (default), semicolon, tab, whitespace
    columns: {point: 2, pose: 3, x: 4, y: 5, z: 6}    # numbers from 1, or names of the header
    units: {length: mm}                 # of lengths, angles, ... or of one column: {x: mm, t: s}
    points: {SMR1: tool, SMR2: wrist}   # their points, our nodes; others are left out
    base: {B1: [0, 0, 0], B2: ["1 m", 0, 0], B3: [0, "1 m", 0]}   # points known in the robot's base frame

With `samples: true` the rows are those of a running machine (`measure.logs`): columns t, joints, loads,
points; the profiles `ur-rtde` and `kuka-rsi` come with the package.

With `base` the list is carried to the base frame (`measure.registration`); without it, it is taken to be in
it. Orientations: columns a b c with `orientation` (KUKA ABC, Euler ZYX, fixed XYZ, rotation vector), or a
quaternion as columns qw qx qy qz.

``units: {fz: kg}`` says that `fz` holds masses that hang from the tool: they pull along -z of the base.
"""

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.files import read_text
from beamstiff.measure.columns import LABELS, QUANTITIES, unit_fault
from beamstiff.measure.orientation import named_orientation
from beamstiff.robot.fields import Described, DescriptionError, Name, Point
from beamstiff.robot.yaml_text import parse_yaml
from beamstiff.units import UNITS, quantity

JOINTS = "joints"  # of `units`: of all joint variables that have none of their own
SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "whitespace": " "}
SIGMAS = {"sigma_position": "length", "sigma_rotation": "angle"}  # keys of noise, and what it is of
POSITION, ANGLES, QUATERNION = ("x", "y", "z"), ("a", "b", "c"), ("qw", "qx", "qy", "qz")


def _texts(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _separators(value: Any) -> tuple[str, ...]:
    """Return separators by their names, or else as the text between cells that each is."""
    names = {text: name for name, text in SEPARATORS.items()}
    found = list[str]()
    for one in value if isinstance(value, list | tuple) and value else [value]:
        known = names.get(one, one) if isinstance(one, str) else ""
        # neither letters and digits nor the signs of a number, which it would cut
        if known not in SEPARATORS and (not known.strip() or re.search(r'[^\W_]|[.+"-]', known)):
            raise BeamstiffError(
                f"found {shown(one)}, expected {listed(SEPARATORS)}, or the text between cells, without "
                "letters, digits and signs of numbers, such as '::' or '_'"
                f"{suggest(one, SEPARATORS)}"
            )
        found.append(known)
    return tuple(dict.fromkeys(found))


def _column(value: Any) -> Any:
    numbered = isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 1000
    if not numbered and not isinstance(value, str):
        raise BeamstiffError(f"found {shown(value)}, expected the number of a column, from 1, or its name")
    return value


class Profile(Described):
    """What the columns of a list of points are.

    `columns`: our columns, and theirs: numbers from 1, or names of the header.
    `units`: unit by column, by kind of quantity (length, angle, time, ...), or of all `joints`.
    `separator`: what stands between cells, by name or as text, such as ``::``; or several of these.
    `decimal`, `comment`, `skip`: form of the file; `skip` lines at its beginning hold neither names nor
        points.
    `orientation`: what a b c are.
    `points`: their names of points to nodes of the robot. `point`: the node of all rows, without such names.
        `load_point`: the node at which all loads act.
    `base`: points known in the base frame, m.
    `sigma_position`, `sigma_rotation`: standard deviations, such as ``0.03 mm`` and ``0.1 mrad``, written
        along.
    `history`, `unloaded_reading`: written along, as of a table of measurements.
    `samples`: whether the rows are samples of a running machine.
    """

    columns: Mapping[str, Annotated[int | str, BeforeValidator(_column)]]
    units: Mapping[str, str]
    separator: Annotated[tuple[str, ...], BeforeValidator(_separators)] = ("comma",)
    decimal: Literal["point", "comma"] = "point"
    comment: Annotated[tuple[str, ...], BeforeValidator(_texts)] = ("#",)
    skip: int = 0
    orientation: str | None = None
    points: Mapping[str, Name] | None = None
    point: Name | None = None
    load_point: Name | None = None
    history: Literal["unloaded", "continuous"] | None = None
    unloaded_reading: Literal["independent", "shared"] | None = None
    base: Mapping[str, Point] | None = None
    sigma_position: str | None = None
    sigma_rotation: str | None = None
    samples: bool = False

    def unit_of(self, column: str) -> str | None:
        """Return the unit of a column; None where none is stated."""
        return self.units.get(column, self.units.get(QUANTITIES.get(column, JOINTS)))

    @property
    def hung_mass(self) -> bool:
        """Whether `fz` holds masses that hang from the tool, and not forces."""
        return "fz" in self.columns and not unit_fault(self.unit_of("fz") or "", ("mass",))


# Logs of controllers, whose columns are always called so.
NAMED = {
    # recorder of Universal Robots' RTDE client: rad, seconds since the controller started
    "ur-rtde": """
separator: whitespace
samples: true
columns: {t: timestamp, q1: actual_q_0, q2: actual_q_1, q3: actual_q_2, q4: actual_q_3, q5: actual_q_4,
  q6: actual_q_5}
units: {angle: rad, time: s, q1: rad, q2: rad, q3: rad, q4: rad, q5: rad, q6: rad}
""",
    # RobotSensorInterface: AIPos (deg) of a log in columns, IPOC in ms
    "kuka-rsi": """
separator: semicolon
samples: true
columns: {t: IPOC, q1: AIPos.A1, q2: AIPos.A2, q3: AIPos.A3, q4: AIPos.A4, q5: AIPos.A5, q6: AIPos.A6}
units: {time: ms, q1: deg, q2: deg, q3: deg, q4: deg, q5: deg, q6: deg}
""",
}


def named_profile(name: str) -> Profile:
    """Return a profile that comes with the package, or that of a file.

    >>> named_profile("kuka-rsi").columns["q1"]
    'AIPos.A1'
    """
    return parse_profile(NAMED[name], name) if name in NAMED else read_profile(name)


def read_profile(path: str | os.PathLike[str]) -> Profile:
    """Return the profile of a YAML file."""
    return parse_profile(read_text(Path(path)), str(path))


def parse_profile(text: str, name: str = "<profile>") -> Profile:
    """Return the profile of a YAML text; otherwise as `read_profile`."""
    data, lines = parse_yaml(text, name)
    if not isinstance(data, dict):
        raise BeamstiffError(f"{name}:{lines.at(())}: found {shown(data)}, expected keys with values")
    try:
        profile = Profile(**data)
        if fault := next(_faults(profile), None):
            raise DescriptionError([fault])
    except DescriptionError as error:
        path, message = error.problems[0]
        raise BeamstiffError(f"{name}:{lines.at(path)}: {'.'.join(map(str, path))}: {message}") from None
    return profile


def _faults(profile: Profile) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield what keys, each right by itself, are together: where the fault is, and what."""
    known = [*LABELS, *QUANTITIES, *QUATERNION]
    valued = [name for name in profile.columns if name not in LABELS and name not in QUATERNION]
    if bare := [name for name in valued if profile.unit_of(name) is None]:
        kinds = dict.fromkeys(f"{QUANTITIES.get(name, JOINTS)}: ..." for name in bare)
        joints = [name for name in bare if name not in QUANTITIES]
        hint = f"; {joints[0]!r} is taken for a joint variable{suggest(joints[0], known)}" if joints else ""
        units = "unit of {} is" if len(bare) == 1 else "units of {} are"
        yield (
            ("units",),
            f"the {units.format(listed(bare, 12))} missing, expected `units: {{{', '.join(kinds)}}}`{hint}",
        )
    for name in valued:
        kind, unit = QUANTITIES.get(name), profile.unit_of(name)
        if unit is None or (name == "fz" and profile.hung_mass):
            continue
        if kind is None and all(unit_fault(unit, (one,)) for one in ("angle", "length")):
            fault = f"{name}: found the unit {unit!r}, expected one of angle, such as deg, or of length"
            yield ("units",), f"{fault}; {name!r} is taken for a joint variable{suggest(name, known)}"
        elif fault := unit_fault(unit, (kind,) if kind else ("angle", "length")):
            hangs = kind == "force" and not unit_fault(unit, ("mass",))
            why = (
                ": a mass that hangs pulls along -z of the base, so that only fz may be one" if hangs else ""
            )
            yield ("units",), f"{name}: {fault}{why}"
    for key, kind in SIGMAS.items():
        try:
            quantity(getattr(profile, key) or 0.0, kind)
        except BeamstiffError as error:
            yield (key,), str(error)
    for name in profile.units:
        if name not in profile.columns and name not in UNITS and name != JOINTS:
            hint = suggest(name, [*UNITS, JOINTS, *profile.columns])
            yield ("units", name), f"is no column and no kind of quantity{hint}"
    for group in (POSITION, ANGLES, QUATERNION):
        some = [name for name in group if name in profile.columns]
        if some and len(some) < len(group):
            yield ("columns",), f"found only {listed(some)}, expected {listed(group)}"
    if ("a" in profile.columns) != (profile.orientation is not None):
        yield (
            ("orientation",),
            "columns a b c and `orientation` go together: expected KUKA ABC, Euler ZYX (or another "
            "order, about turned axes), fixed XYZ (about fixed axes) or rotation vector",
        )
    if "a" in profile.columns and "qw" in profile.columns:
        yield ("columns",), "found angles and a quaternion, expected one of the two"
    if profile.orientation is not None:
        try:
            named_orientation(profile.orientation)
        except BeamstiffError as error:
            yield ("orientation",), str(error)
    for key in ("points", "base"):
        if getattr(profile, key) is not None and "point" not in profile.columns:
            hint = ", or `point: NODE` for all rows" if key == "points" else ""
            yield (key,), f"needs a column of names: `columns: {{point: ...}}`{hint}"
    for key in ("point", "load_point"):
        if getattr(profile, key) is not None and key in profile.columns:
            yield (key,), "found beside a column of names, expected one of the two"
