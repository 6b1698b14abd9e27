"""A fitted model of elasticity in a robot's file: plain data, which `beamstiff.model.model_file` acts on.

Stiffness values are those of springs of the robot, in the order of `springs`; all numbers are SI.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from beamstiff.errors import BeamstiffError, shown
from beamstiff.robot.fields import Described, DescriptionError, Name, Number, PositiveNumber, Truth, Vector

VERSION = 1  # of the key `model`
KINDS = ("fuzzy", "grid", "gray box", "gaussian process")
DISPLACEMENT, WRENCH = ("dx", "dy", "dz", "rx", "ry", "rz"), ("fx", "fy", "fz", "mx", "my", "mz")

Numbers = tuple[Number, ...]
Table = tuple[Numbers, ...]


def _whole(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise BeamstiffError(f"found {shown(value)}, expected a whole number, 0 or more")
    return value


Whole = Annotated[int, BeforeValidator(_whole)]
PositiveTable = tuple[tuple[PositiveNumber, ...], ...]


def _same(path: str, found: int, expected: int, each: str) -> None:
    """Refuse a list of another length than there are things that it has a value of."""
    if found != expected:
        raise DescriptionError([((path,), f"found {found} in the list, expected {expected}: one a {each}")])


class FittedRange(Described):
    """Least and largest value of an actuated variable in the rows that were fitted, rad or m."""

    variable: Name
    low: Number
    high: Number


class FuzzyRules(Described):
    """Rules with one partition: modal values of the inputs, and a conclusion a rule for every term.

    Attributes
    ----------
    terms : tuple of str
        ``dx/fz``: displacement along x by a force along z. Of a gray box: the springs.
    inputs : tuple of str
    sets : tuple of tuple of float
        Modal values of each input.
    conclusions : tuple of tuple of float
        By term, for each rule, the last input's sets fastest: m/N and so on; of a gray box logarithms of
        the factors on the compliances.
    support : tuple of float
        How strongly each rule fired, at most, in training; none where the rules were given.
    """

    terms: Annotated[tuple[Name, ...], Field(min_length=1)]
    inputs: Annotated[tuple[Name, ...], Field(min_length=1)]
    sets: Table
    conclusions: Table
    support: Numbers = ()

    @model_validator(mode="after")
    def _complete(self) -> Self:
        rules = 1
        for values in self.sets:
            rules *= len(values)
        _same("sets", len(self.sets), len(self.inputs), "input")
        _same("conclusions", len(self.conclusions), len(self.terms), "term")
        for row in self.conclusions:
            _same("conclusions", len(row), rules, "rule")
        if self.support:
            _same("support", len(self.support), rules, "rule")
        return self


class CubeGrid(Described):
    """Cubes side by side: least corner, m, side, m, and how many along x, y and z, the last fastest."""

    low: Vector
    size: PositiveNumber
    counts: tuple[Whole, Whole, Whole]
    rows: tuple[Whole, ...]  # measured in each

    @model_validator(mode="after")
    def _complete(self) -> Self:
        nx, ny, nz = self.counts
        _same("rows", len(self.rows), nx * ny * nz, "cube")
        return self


class CubeKinematics(Described):
    """Deviations of kinematic parameters (``f3.d``, ``q2`` an encoder's zero) by cube, m and rad."""

    parameters: Annotated[tuple[Name, ...], Field(min_length=1)]
    deviations: Table


class TaughtProcess(Described):
    """A Gaussian process: its covariance, and the readings that taught it, whitened.

    Attributes
    ----------
    follows : tuple of str
        The variable that each spring turns or slides with; `none` where it has none.
    own_spread, spread : tuple of float
        Standard deviations of the logarithms, by spring: of the part of the own angle, of the posture.
    own_length : float
    lengths, scale : tuple of float
        By actuated variable: over which the compliances vary, and what joint values are divided by first.
    noise : float
    misfit : tuple of float
        By direction: what the readings scatter beyond their stated noise, m and rad.
    postures : tuple of tuple of float
    posture, value : tuple
        By reading: its posture, counted from 0, and what was read.
    slopes : tuple of tuple of float
        By reading: its derivatives by the springs' logarithms.
    """

    follows: tuple[Name, ...]
    own_spread: Numbers
    spread: Numbers
    own_length: PositiveNumber
    lengths: tuple[PositiveNumber, ...]
    scale: tuple[PositiveNumber, ...]
    noise: PositiveNumber
    misfit: tuple[Number, Number, Number, Number, Number, Number]
    postures: Table
    posture: tuple[Whole, ...]
    value: Numbers
    slopes: Table


class FittedModel(Described):
    """How the machine deforms under load, fitted to measurements, in place of constant springs.

    Attributes
    ----------
    version : int
    kind : str
    source : str
        The tables it was fitted to.
    ranges : tuple of FittedRange
        Of the fitted rows, as is `workspace`: least and largest place of the TCP, m.
    springs : tuple of str
        That vary; none in a fuzzy model, which knows the readings alone.
    stiffness : tuple of tuple of float
        By cube, for each spring; one row of a gray box or a Gaussian process: about which the springs vary.
    """

    version: Literal[1]
    kind: Literal["fuzzy", "grid", "gray box", "gaussian process"]
    source: str = ""
    ranges: tuple[FittedRange, ...] = ()
    workspace: tuple[Vector, Vector]
    springs: tuple[Name, ...] = ()
    stiffness: PositiveTable = ()
    rules: tuple[FuzzyRules, ...] = ()
    cubes: CubeGrid | None = None
    interpolate: Truth = False
    kinematics: CubeKinematics | None = None
    process: TaughtProcess | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needs = {
            "fuzzy": ("rules",),
            "grid": ("springs", "stiffness", "cubes"),
            "gray box": ("springs", "stiffness", "rules"),
            "gaussian process": ("springs", "stiffness", "process"),
        }
        for name in needs[self.kind]:
            if not getattr(self, name):
                raise DescriptionError([((name,), f"is missing: a model of kind {self.kind} has it")])
        count = 1
        if self.cubes is not None:
            count = len(self.cubes.rows)
            if self.kinematics is not None:
                _same("kinematics", len(self.kinematics.deviations), count, "cube")
                for row in self.kinematics.deviations:
                    _same("kinematics", len(row), len(self.kinematics.parameters), "parameter")
        if self.kind != "fuzzy":
            _same("stiffness", len(self.stiffness), count, "cube" if self.cubes else "model")
            for row in self.stiffness:
                _same("stiffness", len(row), len(self.springs), "spring")
        if self.process is not None:
            _taught(self.process, len(self.springs))
        return self


def _taught(found: TaughtProcess, springs: int) -> None:
    for name in ("follows", "own_spread", "spread"):
        _same(f"process.{name}", len(getattr(found, name)), springs, "spring")
    for row in found.slopes:
        _same("process.slopes", len(row), springs, "spring")
    readings = len(found.value)
    _same("process.slopes", len(found.slopes), readings, "reading")
    _same("process.posture", len(found.posture), readings, "reading")
    if max(found.posture, default=-1) >= len(found.postures):
        last = f"found {max(found.posture)}, expected {len(found.postures) - 1} at most"
        raise DescriptionError([(("process", "posture"), last)])
    for row in (found.scale, *found.postures):
        _same("process.postures", len(row), len(found.lengths), "actuated variable")
