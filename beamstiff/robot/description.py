"""The robot as its file describes it: its parts, and what they say of each other."""

from collections.abc import Collection, Iterable, Mapping
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from beamstiff.errors import BeamstiffError, listed, shown, suggest
from beamstiff.robot.checks import find_problems
from beamstiff.robot.fields import (
    FREE,
    RIGID,
    Acceleration,
    AssemblyName,
    Described,
    DescriptionError,
    LeastLength,
    Name,
    stiffness_text,
)
from beamstiff.robot.fitted_model import FittedModel, FittedRange
from beamstiff.robot.parts import (
    STIFFNESS_KINDS,
    AddedEffect,
    Beam,
    CalibratedParameter,
    Frame,
    Joint,
    JointStiffness,
    Loop,
    Mass,
    Material,
    Node,
    Obstacle,
    Rigid,
    Strut,
    Variable,
)
from beamstiff.robot.sections import Section
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.shown import Shown


class Robot(Shown, Described):
    """A robot as a graph of nodes, beams, rigids, joints and struts on moving frames.

    Attributes
    ----------
    name : str
    gravity : three numbers
        In the base frame.
    fixed : list of str
        Nodes that stand on the ground.
    tcp : str
        Node at which the tool is measured and loaded.
    identify : list of str
        Parameters that `identify` and `diagnose` fit, such as ``J2.torsional`` (of a joint), ``screw2`` (of a
        strut).
    unmeasured : list of str
        Stiffness that measurements did not determine: start values, not results. `identify`, `calibrate` and
        `diagnose` write it; `compensate` says how much of the predicted error comes from these values.
    fitted_rows : str
        Six hexadecimal digits of each measured row that a fit has used; `calibrate` and `diagnose`
        write them, and `verify` says which of its rows are among them.
    fitted_ranges : list
        Least and largest value of each actuated variable in those rows; beyond them `compensate`, `verify`
        and others say that they extrapolate.
    fitted_error : length
        Position error (RMS) that the fit left on held-out postures; `compensate` shows it.
    unexplained : str
        What that error looks like, where no effect of the library explains most of it; `diagnose` writes it,
        `compensate` and `verify` say it.
    effects : list
        What the machine is known to have beyond beams and springs.
    obstacles : list
        Boxes that no part may touch in postures that `plan`, `diagnose` and `campaign` propose.
    calibrated : list
        What `calibrate` fitted; `diagnose` keeps it open.
    model : mapping
        A fitted model of elasticity, in place of constant springs.
    assembly : str
        How closed loops are put together: a name that ``beamstiff show`` lists.

    Examples
    --------
    >>> beam = Robot(
    ...     name="cantilever",
    ...     materials={"steel": Material(E="210 GPa", G="80 GPa")},
    ...     sections={"rod": Section(A=1e-4, Iy=1e-9, Iz=1e-9, J=2e-9)},
    ...     nodes=[Node(name="root"), Node(name="tip", at=["1 m", 0, 0])],
    ...     beams=[Beam(name="beam", nodes=["root", "tip"], section="rod", material="steel")],
    ...     fixed=["root"],
    ...     tcp="tip",
    ... )
    >>> beam.nodes[1].at
    (1.0, 0.0, 0.0)
    """

    name: Name
    gravity: tuple[Acceleration, Acceleration, Acceleration] = (0.0, 0.0, -9.81)
    variables: tuple[Variable, ...] = ()
    frames: tuple[Frame, ...] = ()
    loops: tuple[Loop, ...] = ()
    assembly: AssemblyName | None = None  # how the loops are put together: a name that `beamstiff show` lists
    materials: Mapping[Name, Material] = {}
    sections: Mapping[Name, Section] = {}
    nodes: Annotated[tuple[Node, ...], Field(min_length=1)]
    beams: tuple[Beam, ...] = ()
    rigids: tuple[Rigid, ...] = ()
    joints: tuple[Joint, ...] = ()
    struts: tuple[Strut, ...] = ()
    masses: tuple[Mass, ...] = ()
    fixed: Annotated[tuple[Name, ...], Field(min_length=1)]
    tcp: Name
    identify: tuple[Name, ...] = ()
    unmeasured: tuple[Name, ...] = ()  # stiffness that was to be fitted and that no measurement determined
    fitted_rows: Annotated[str, Field(pattern=r"^([0-9a-f]{6}( [0-9a-f]{6})*)?$")] = ""
    fitted_ranges: tuple[FittedRange, ...] = ()
    fitted_error: LeastLength | None = None
    unexplained: str = ""
    effects: tuple[AddedEffect, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    model: FittedModel | None = None  # of elasticity, in place of constant springs
    calibrated: tuple[CalibratedParameter, ...] = ()  # what `calibrate` fitted: `diagnose` keeps it open
    urdf: str | None = None  # the text of the file it was read from, for `robot.urdf` to write back

    @model_validator(mode="after")
    def _cross_references(self) -> Self:
        problems = list(find_problems(self))
        if problems:
            raise DescriptionError(problems)
        return self

    @property
    def actuated(self) -> tuple[Variable, ...]:
        """Actuated variables, in the order of the columns of the Jacobian."""
        return tuple(variable for variable in self.variables if variable.actuated)

    def parameter(self, name: str) -> float:
        """Return the stiffness called ``"J12.torsional"`` (a joint's) or ``"screw2"`` (a strut's), SI.

        Raises
        ------
        BeamstiffError
            When the robot has no such stiffness.
        """
        return stiffness_parameters(self)[_known(name, stiffness_parameters(self), self.name)]

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """Return the same robot with other stiffness values, by parameter name, SI.

        What becomes rigid or free is no longer among those to `identify`: it has no number to start from.
        """
        known = stiffness_parameters(self)
        for name in values:
            _known(name, known, self.name)
        joints = tuple(
            joint.model_copy(update={"stiffness": _stiffness_with(joint, values)}) for joint in self.joints
        )
        struts = tuple(_strut_with(strut, values) for strut in self.struts)
        beams, materials = _beams_with(self, values)
        identify = tuple(name for name in self.identify if values.get(name) not in (RIGID, FREE))
        update = {
            **{"joints": joints, "struts": struts, "beams": beams, "materials": materials},
            "identify": identify,
        }
        return self.model_copy(update=update)

    def without_effects(self, *labels: str) -> Self:
        """Return the same robot without its effects, or without some of them, to predict what they do.

        `labels`: as a diagnosis names them, such as ``"backlash:q2"``, ``"base-compliance"``. The stiffness
        stays as it was fitted beside them.

        Raises
        ------
        BeamstiffError
            When the robot has no such effect.
        """
        own = [effect.label for effect in self.effects]
        for label in labels:
            if label not in own:
                raise BeamstiffError(
                    f"robot {self.name!r} has no effect {shown(label)}{suggest(label, own)}; "
                    f"expected {listed(own) or 'none, as it has no effects'}"
                )
        left = (effect for effect in self.effects if labels and effect.label not in labels)
        return self.model_copy(update={"effects": tuple(left)})

    def with_unmeasured(self, fitted: Collection[str], untouched: Collection[str]) -> Self:
        """Return the robot, of whose `fitted` stiffness values no measured load touched some."""
        open_ones = {*self.unmeasured} - {*fitted} | {*untouched}
        finite = {name for name, value in stiffness_parameters(self).items() if FREE < value < RIGID}
        return self.model_copy(update={"unmeasured": tuple(sorted(open_ones & finite))})

    def with_fitted_rows(
        self,
        digests: Iterable[str],
        ranges: Mapping[str, tuple[float, float]] = {},
        error: float | None = None,
        unexplained: str = "",
    ) -> Self:
        """Return the robot with rows added to those that were fitted: their digests, and ranges by variable.

        `error`: what the fit leaves, m. `unexplained`: what that looks like.
        """
        every = sorted({*self.fitted_rows.split(), *digests})
        wider = {one.variable: (one.low, one.high) for one in self.fitted_ranges}
        for name, (low, high) in ranges.items():
            before = wider.get(name, (low, high))
            wider[name] = (min(low, before[0]), max(high, before[1]))
        return self.model_copy(
            update={
                "fitted_rows": " ".join(every),
                "fitted_ranges": tuple(FittedRange(variable=k, low=a, high=b) for k, (a, b) in wider.items()),
                "fitted_error": None if error is None else float(f"{error:.3g}"),
                "unexplained": unexplained,
            }
        )


def _stiffness_with(joint: Joint, values: Mapping[str, float]) -> JointStiffness:
    changed: dict[str, Any] = {
        kind: stiffness_text(values.get(f"{joint.name}.{kind}", getattr(joint.stiffness, kind)))
        for kind in STIFFNESS_KINDS
    }
    try:
        return JointStiffness(**changed)
    except BeamstiffError as error:
        raise BeamstiffError(f"{joint.name}.{error}") from None


def _beams_with(robot: Robot, values: Mapping[str, float]) -> tuple[tuple[Beam, ...], dict[str, Material]]:
    """Give every beam whose modulus changes a material of its own."""
    beams, materials = [], dict(robot.materials)
    for beam in robot.beams:
        material = robot.materials[beam.material]
        modulus = values.get(f"{beam.name}.E", material.E)
        if modulus != material.E:
            own = f"{beam.material} of {beam.name}"
            try:
                materials[own] = Material(
                    E=modulus, G=material.G * modulus / material.E, density=material.density
                )
            except BeamstiffError as error:
                raise BeamstiffError(f"{beam.name}.{error}") from None
            beam = beam.model_copy(update={"material": own})
        beams.append(beam)
    return tuple(beams), materials


def _strut_with(strut: Strut, values: Mapping[str, float]) -> Strut:
    stiffness: Any = stiffness_text(values.get(strut.name, strut.stiffness))
    try:
        return Strut(**{**dict(strut), "stiffness": stiffness})
    except BeamstiffError as error:
        raise BeamstiffError(f"{strut.name}.{error}") from None


def _known(name: str, candidates: Iterable[str], robot: str) -> str:
    candidates = list(candidates)
    if name not in candidates:
        raise BeamstiffError(
            f"robot {robot!r} has no stiffness parameter {name!r}{suggest(name, candidates)}; "
            f"expected {listed(candidates, 6) or 'none, as it has no elastic part'}"
        )
    return name
