"""The parts of a robot description, one frozen class a concept, used by YAML and Python alike.

Every class checks its own fields; what they say of each other is checked in `checks`. Values are SI; text
with a unit is accepted wherever a quantity is expected.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from beamstiff.errors import BeamstiffError, shown
from beamstiff.robot.fields import (
    RIGID,
    Correlation,
    Density,
    Described,
    DescriptionError,
    Direction,
    Identifier,
    LeastLength,
    Name,
    Number,
    ParameterValue,
    Point,
    PositiveForce,
    PositiveMass,
    PositiveModulus,
    PositiveNumber,
    RotationalStiffness,
    Scale,
    TranslationalStiffness,
    Truth,
    check_has_unit,
    described,
)
from beamstiff.units import UNITS, number

FRAME_PARAMETERS = {
    "gamma": "angle",
    "b": "length",
    "alpha": "angle",
    "d": "length",
    "theta": "angle",
    "r": "length",
    "beta": "angle",
}
STIFFNESS_KINDS = ("axial", "radial", "torsional", "tilting")
# the six directions of a joint, first axis along the joint (seed 003, eq. 18: Ka Kr Kr Kar Krr Krr)
JOINT_DIRECTIONS = ("axial", "radial", "radial", "torsional", "tilting", "tilting")


def _linear(value: Any) -> float | str:
    """Return an expression as it is given: a finite number, or text for the grammar of `expression`."""
    return value if isinstance(value, str) else number(value)


class Variable(Described):
    """A joint variable: actuated, passive (solved by loop closure) or coupled (`equals`).

    Attributes
    ----------
    name : str
    type : "revolute" or "prismatic"
        Needed unless `equals` is given.
    passive : bool
        Solved by the loops, not driven.
    equals : str
        A linear expression of other variables, such as ``"10 deg - 2*q5"``.
    limits : pair
        Lower and upper.
    guess : float
        Of a passive variable: which way the loop is put together.
    speed : float
        The largest, by which plans judge the time for moving.
    """

    name: Identifier
    type: Literal["revolute", "prismatic"] | None = None
    passive: Truth = False
    equals: Annotated[str, BeforeValidator(lambda value: str(_linear(value)))] | None = None
    limits: tuple[float, float] | None = None
    guess: float = 0.0
    speed: float | None = None

    @property
    def kind(self) -> str:
        """Kind of its quantity: ``"angle"`` or ``"length"``."""
        return "length" if self.type == "prismatic" else "angle"

    @property
    def actuated(self) -> bool:
        """Whether it is driven: its value is an input."""
        return not self.passive and self.equals is None

    @field_validator("limits", mode="before")
    @classmethod
    def _limits(cls, value: Any, info: Any) -> Any:
        if value is None:
            return None
        kind = "length" if info.data.get("type") == "prismatic" else "angle"
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise BeamstiffError(f"found {shown(value)}, expected two values: [lower, upper]")
        low, high = (described(item, kind) for item in value)
        if low >= high:
            raise BeamstiffError(f"found {shown(value)}, expected the lower limit below the upper one")
        return low, high

    @field_validator("guess", mode="before")
    @classmethod
    def _guess(cls, value: Any, info: Any) -> Any:
        return described(value, "length" if info.data.get("type") == "prismatic" else "angle")

    @field_validator("speed", mode="before")
    @classmethod
    def _speed(cls, value: Any, info: Any) -> Any:
        if value is None:
            return None
        speed = described(value, "speed" if info.data.get("type") == "prismatic" else "angular speed")
        if speed <= 0:
            raise BeamstiffError(f"found {shown(value)}, expected a positive speed")
        return speed

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.equals is None and self.type is None:
            raise DescriptionError([(("type",), "is missing: expected revolute or prismatic (or `equals`)")])
        if self.equals is not None and self.passive:
            raise DescriptionError([(("passive",), f"{self.name} cannot be passive and coupled by `equals`")])
        return self


def _frame_parameter(value: Any, info: ValidationInfo) -> float | str:
    check_has_unit(value, UNITS[FRAME_PARAMETERS[str(info.field_name)]])
    return _linear(value)


FrameParameter = Annotated[float | str, BeforeValidator(_frame_parameter)]


class Frame(Described):
    """A frame after Khalil and Kleinfinger, by six elementary motions from its parent.

    rot(z, gamma) trans(z, b) rot(x, alpha) trans(x, d) rot(z, theta) trans(z, r);
    `beta` (Hayati) is a rotation about y after rot(z, theta), for near-parallel axes. Every parameter is a
    quantity or a linear expression of variables.
    """

    name: Name
    parent: Name = "base"
    gamma: FrameParameter = 0.0
    b: FrameParameter = 0.0
    alpha: FrameParameter = 0.0
    d: FrameParameter = 0.0
    theta: FrameParameter = 0.0
    r: FrameParameter = 0.0
    beta: FrameParameter = 0.0


class Loop(Described):
    """Frames or nodes that must coincide: as points, as poses, or in the x-y plane of `a`."""

    name: Name
    a: Name
    b: Name
    constrain: Literal["position", "pose", "plane"]


class Material(Described):
    """Elastic constants, Pa, and density, kg/m^3."""

    E: PositiveModulus
    G: PositiveModulus
    density: Density = 0.0


class Node(Described):
    """A point that moves with its frame; `at` is in that frame."""

    name: Name
    frame: Name = "base"
    at: Point = (0.0, 0.0, 0.0)


class Beam(Described):
    """A beam between two nodes; the width of its section points along `up` (frame of the first node)."""

    name: Name
    nodes: tuple[Name, Name]
    section: Name
    material: Name
    up: Direction | None = None


class Rigid(Described):
    """A rigid body between two nodes; it may have zero length."""

    name: Name
    nodes: tuple[Name, Name]


class JointStiffness(Described):
    """Six-direction spring: along and across the joint's axis, about it and about the axes across it.

    What is not named is rigid.
    """

    axial: TranslationalStiffness = RIGID
    radial: TranslationalStiffness = RIGID
    torsional: RotationalStiffness = RIGID
    tilting: RotationalStiffness = RIGID


AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def _axis(value: Any) -> Any:
    if isinstance(value, str):
        if value.lower() not in AXES:
            raise BeamstiffError(f"found {shown(value)}, expected x, y, z or three numbers")
        return AXES[value.lower()]
    return value


class Joint(Described):
    """An elastic joint: a six-direction spring between two coincident nodes.

    Attributes
    ----------
    name : str
    nodes : pair of str
        The node before the joint, and the one that moves with it.
    frame : str
        In which `axis` stands.
    axis : "x", "y", "z" or three numbers
    variable : str
        The joint variable; none where the joint only deforms.
    stiffness : JointStiffness
    """

    name: Name
    nodes: tuple[Name, Name]
    frame: Name
    axis: Annotated[Direction, BeforeValidator(_axis)] = AXES["z"]
    variable: Identifier | None = None
    stiffness: JointStiffness


class Strut(Described):
    """An axial two-force member (ball screw, tie rod) between two distinct nodes.

    With `EA`, N, its own length is compliant too, but for `fixed_length`, m: its compliance is
    ``1/stiffness + (L - fixed_length) / EA``. So a screw that a bearing holds at one end follows where its
    nut stands, and `stiffness` is that of bearing and nut in series.
    """

    name: Name
    nodes: tuple[Name, Name]
    stiffness: TranslationalStiffness
    EA: PositiveForce | None = None
    fixed_length: LeastLength = 0.0

    @model_validator(mode="after")
    def _free_length(self) -> Self:
        if self.EA is None and self.fixed_length:
            raise DescriptionError([(("fixed_length",), "found one without EA, expected EA with it")])
        return self

    @property
    def rigid(self) -> bool:
        """Whether the strut never changes its length."""
        return self.stiffness == RIGID and self.EA is None


class Mass(Described):
    """A point mass; `at` is in the frame of the node, from the node."""

    node: Name
    mass: PositiveMass
    at: Point = (0.0, 0.0, 0.0)


class Obstacle(Described):
    """A box, sides along the base frame's axes, that no part may touch in a posture that is proposed.

    Parts are lines between nodes: enlarge the box by the radius of the arm.
    """

    name: Name
    low: Point
    high: Point

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if low >= high:
                raise DescriptionError(
                    [(("high",), f"{axis}: found {high:g} m, expected more than {low:g} m of low")]
                )
        return self


class AddedShape(Described):
    """A shape of an effect with its parameters; see `AddedEffect`.

    `weight`: by which it counts, where several shapes of an effect are averaged.
    """

    shape: Name
    weight: Number = 1.0
    parameters: Annotated[Mapping[Name, ParameterValue], Field(min_length=1)]
    std: Mapping[Name, ParameterValue] = {}
    scales: Mapping[Name, Scale] = {}


class AddedEffect(Described):
    """An effect beyond beams and springs that the machine is known to have, such as backlash of a joint.

    Which effects there are, in which shapes and with which parameters, `diagnosis.effects` says and checks.
    It has one shape, or several (`shapes`) between which the data did not choose, each with its weight.

    Attributes
    ----------
    effect : str
    component : str or None
        Where; None for the machine as a whole.
    shape : str
    parameters : mapping of str to float or str
        SI numbers, or text with a unit; what is not named is 0.
    std : mapping of str to float or str
        Standard deviations of these, for whoever reads the file.
    scales : mapping of str to float or tuple of float
        What the parameters are counted against, SI: the largest torque of the rows they were fitted to, say.
    closes : float or None
        Share of the gap that it closed on held-out postures when it was found: what `verify` holds it to.
    absorbed : mapping of str to float
        What a calibration without it puts into geometry, base frame and compliances instead, SI.
    found_from : "positions", "displacements" or None
        Readings that it was found from; displacements do not show what it does to the unloaded tool.
    shapes : tuple of AddedShape
        In place of `shape`, `parameters`, `std` and `scales`.
    """

    effect: Name
    component: Name | None = None
    shape: Name | None = None
    parameters: Mapping[Name, ParameterValue] = {}
    std: Mapping[Name, ParameterValue] = {}
    scales: Mapping[Name, Scale] = {}
    closes: float | None = None
    absorbed: Mapping[Name, float] = {}
    found_from: Literal["positions", "displacements"] | None = None
    shapes: tuple[AddedShape, ...] = ()

    @model_validator(mode="after")
    def _one_or_several(self) -> Self:
        if self.shapes:
            for name in ("shape", "parameters", "std", "scales"):
                if getattr(self, name):
                    raise DescriptionError([((name,), "found it beside `shapes`, expected one of the two")])
        elif self.shape is None:
            raise DescriptionError([(("shape",), "is missing")])
        elif not self.parameters:
            raise DescriptionError([(("parameters",), "is missing: expected a parameter with its value")])
        return self

    @property
    def label(self) -> str:
        """As people read and type it: ``backlash:q2``, ``base-compliance``."""
        return self.effect if self.component is None else f"{self.effect}:{self.component}"

    @property
    def each(self) -> tuple[AddedShape, ...]:
        """Its shapes: the several, or the one."""
        if self.shape is None:
            return self.shapes
        return (
            AddedShape.model_construct(
                shape=self.shape, weight=1.0, parameters=self.parameters, std=self.std, scales=self.scales
            ),
        )

    def with_shapes(self, shapes: tuple[AddedShape, ...]) -> Self:
        """Return the effect with other shapes, as it is written: one that counts in full as its own."""
        if len(shapes) == 1 and shapes[0].weight == 1.0:
            own = {name: getattr(shapes[0], name) for name in ("shape", "parameters", "std", "scales")}
            return self.model_copy(update={**own, "shapes": ()})
        none: dict[str, Any] = {"shape": None, "parameters": {}, "std": {}, "scales": {}}
        return self.model_copy(update={**none, "shapes": shapes})


class CalibratedParameter(Described):
    """A parameter that `calibrate` fitted, such as ``base.x``, ``q2`` or ``f3.d``; its value is the robot's.

    Attributes
    ----------
    name : str
    std : float
        Standard deviation, SI, with the effects of the robot as they are.
    correlation : tuple of float
        With each of the parameters before it; default 0.
    """

    name: Name
    std: PositiveNumber
    correlation: tuple[Correlation, ...] = ()
