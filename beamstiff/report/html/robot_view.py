"""The robot in three dimensions: its parts, its load, its deformed shape, the ellipsoid of its compliance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beamstiff.diagnosis.effects.torque_laws import component_of
from beamstiff.errors import BeamstiffError
from beamstiff.fem.beam_element import beam_axes
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.placed_structure import beam_directions
from beamstiff.fem.static_response import Response, nodal_loads, respond
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import Measurements
from beamstiff.report.html.links import CAMERAS, Lines, across, joint_lines, link_lines
from beamstiff.report.html.parts import Figure, axis, css, label, numbers, places, plain_layout
from beamstiff.report.html.places import line_of
from beamstiff.report.html.shapes import beam_solids, force_and_moment, solids_style
from beamstiff.report.tables import Table, millimetres, nice, number
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import RIGID
from beamstiff.robot.kinematics import posture
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

DEFLECTION = "where the deflection is seen"  # the camera
TOOL = ("tool", "tool point", "target-slip", "load", "payload")  # places at the tool
POSES = 5  # that are shown, the worst
LABELLED = 3
SEEN = 0.005  # share that is worth a label
CHARACTERS = 16  # characters of a name in a label: a phone's figure is some 40 wide
DEFORMED = 0.12  # of the robot's size: the deformed shape to begin with
FURTHER = 2.0  # times this at most
ELLIPSOID = 0.12  # of the robot's size: its longest half axis
AROUND = 0.16  # of the robot's size: room about it
LEAST_SCALE = 0.05  # share that gets the full colour at least
ELLIPSOID_MEANS = (
    "The ellipsoid at the tool is its compliance: how far a unit force in each direction displaces the tool."
)
APART = 8 * "\u00a0"  # moves the title of the upright axis away from its ticks


@dataclass(frozen=True)
class Shown:
    """A posture to show."""

    name: str
    q: Array  # (A,): actuated values
    wrench: Array  # (6,): on a node
    load_point: str
    shares: Mapping[str, float] | None = None  # of the parts; None: of the strain energy
    marks: Mapping[str, str] = field(default_factory=dict)  # where shares of no part are drawn: a node each


@dataclass(frozen=True)
class RobotView:
    """The figure, and for each posture where its traces are and how they move."""

    figure: Figure
    # ``name``; ``traces``: what differs, with ``dx, dy, dz`` for the way at magnification 1 and ``shares``
    # for the colours; ``labels``; ``ranges`` of the axes
    views: list[dict[str, Any]]
    # magnification, most: to begin with, and at most; 0 where nothing moves
    magnification: float
    most: float
    cameras: Mapping[str, Any]  # by name, where the robot is seen from
    # note, slider: what is to be said, and what the slider magnifies
    note: str = ""
    slider: str = "Magnification of the deformed shape"
    shared: Mapping[str, Sequence[Any]] = field(default_factory=dict)  # arrays that its traces draw


def worst_postures(rows: Measurements, size: Array, what: str = "") -> list[Shown]:
    """Return the worst poses by the size of their rows (N,), mm, each at its worst row."""
    order = np.argsort(-np.nan_to_num(size))
    first = np.sort(np.unique(rows.pose[order], return_index=True)[1])
    worst = order[first][:POSES].tolist()
    names = [f"{line_of(rows, at)}: {what}{size[at]:.3g} mm" for at in worst]
    return [
        Shown(name, rows.q[at], rows.wrench[at], str(rows.load_point[at]))
        for name, at in zip(names, worst, strict=True)
    ]


def robot_view(
    robot: Robot, shown: Sequence[Shown], share: str, gravity: bool = False, model: str = "the fitted model"
) -> RobotView | None:
    """Return a robot in some postures, or None where there is none to show.

    `share`: what the shares are of, such as "share of the gap"; empty where there are none. `gravity`: let
    the dead weight deform it as well. `model`: whose deformed shape it is.
    """
    if not shown:
        return None
    structure = compile_structure(robot)
    where = posture(structure.kinematics, np.array([one.q for one in shown]))
    loads = np.concatenate([nodal_loads(structure, 1, {one.load_point: one.wrench}) for one in shown])
    response, compliance, note = None, np.zeros((len(shown), 6, 6)), ""
    if any(0.0 < value < RIGID for value in stiffness_parameters(robot).values()):
        try:
            response = respond(structure, where, loads, gravity)
            compliance = tcp_compliance(structure, where)
        except BeamstiffError as error:
            note = f"No deformed shape: {error}."
    else:
        note = "No deformed shape: every part of the model is rigid."
    moved = np.zeros((*where.node_positions.shape[:2], 6)) if response is None else response.displacement
    size = float(np.ptp(where.node_positions, axis=1).max()) or 1.0
    largest = float(np.linalg.norm(moved[..., :3], axis=-1).max(initial=0.0))
    magnification = nice(DEFORMED * size / largest) if largest > 0.0 else 0.0
    axes = beam_axes(*beam_directions(structure, where))
    views = []
    for at, one in enumerate(shown):
        shares = one.shares if one.shares is not None else _energy(robot, response, at)
        view = _View(robot, axes[at], where.node_positions[at], moved[at], size)
        views.append(view.made(one, shares, compliance[at]))
    most = max(LEAST_SCALE, *(view.pop("largest") for view in views))
    weight = " and its own weight" if gravity else ""
    told = [f"Colour shows each part's {share}."] if share else []
    if largest > 0.0:
        under = f"under the load shown{weight}, magnified; the undeformed one is dashed"
        told += [f"The deformed shape is that of {model} {under}.", ELLIPSOID_MEANS]
    if any(robot.gravity[:2]) or robot.gravity[2] > 0.0:
        told.append(f"Gravity acts along {list(robot.gravity)} m/s^2, not downwards in this picture.")
    figure = Figure(
        "robot",
        "The robot",
        " ".join(told),
        _styles(share, most, solid=bool(robot.beams)),
        space(views[0]["camera"], showlegend=False),
        _table(shown, moved, compliance, structure.kinematics.node_index[robot.tcp]),
    )
    cameras = {DEFLECTION: views[0]["camera"], **CAMERAS}
    return RobotView(figure, views, magnification, FURTHER * magnification, cameras, note)


def _energy(robot: Robot, response: Response | None, at: int) -> dict[str, float]:
    """Return shares of the strain energy by component."""
    result: dict[str, float] = {}
    if response is not None:
        names = {joint.name: component_of(robot, joint) for joint in robot.joints}
        for name, value in response.energy_shares().items():
            key = name if name not in names and "." not in name else name.rpartition(".")[0] or name
            key = names.get(key, key)
            result[key] = result.get(key, 0.0) + float(value[at])
    return result


@dataclass(frozen=True)
class _View:
    robot: Robot
    axes: Array  # (B, 3, 3): base frame from local beam axes
    positions: Array  # (N, 3)
    moved: Array  # (N, 6)
    size: float

    def made(self, one: Shown, shares: Mapping[str, float], compliance: Array) -> dict[str, Any]:
        """Return the traces of a posture, in the order of `_styles`."""
        index = {node.name: at for at, node in enumerate(self.robot.nodes)}
        links = link_lines(self.robot, self.positions, self.moved)
        joints = joint_lines(self.robot, one.q, self.positions, self.moved, self.size)
        tool, base = index[self.robot.tcp], index[self.robot.fixed[0]]
        own = [name for name in shares if name in index and name not in (*links.names, *joints.names)]
        marks = {name: node for name, node in one.marks.items() if name in shares}
        ends = np.array([base, tool, *(index[name] for name in (*own, *marks.values()))])
        own += marks
        load = index[one.load_point]
        arrows = force_and_moment(one.wrench, self.positions[load], 0.2 * self.size)
        told = {name: f"{label(name)}: {100 * value:.1f} %" for name, value in shares.items()}
        ghost = links.moving(still=True) | {"hovertext": None}
        solids = []
        if self.robot.beams:
            solids = [beam_solids(self.robot, self.axes, self.positions, self.moved, shares, told)]
        return {
            "name": one.name,
            "traces": [
                ghost,
                _coloured(links, shares, told),
                _coloured(joints, shares, told),
                {
                    **places(self.positions[ends], self.moved[ends, :3]),
                    "shares": [
                        shares.get("base", 0.0),
                        max(shares.get(name, 0.0) for name in TOOL),
                        *(shares[name] for name in own),
                    ],
                    "hovertext": [
                        f"base {told.get('base', '')}",
                        "<br>".join(["tool", *(told[name] for name in TOOL if name in told)]),
                        *(told[name] for name in own),
                    ],
                },
                arrows.lines(self.moved[load, :3]),
                arrows.heads(self.moved[load, :3]),
                *solids,
                self._ellipsoid(compliance, tool),
            ],
            "labels": self._labels(shares, links, joints, index, marks),
            "camera": across(self.moved[tool, :3], self.positions[tool] - self.positions[base]),
            "ranges": self._ranges(),
            "largest": max(shares.values(), default=0.0),
        }

    def _ranges(self) -> dict[str, list[float | None]]:
        """Return the ranges of the axes: the magnified shape stays in them."""
        low = self.positions.min(axis=0) - AROUND * self.size
        high = self.positions.max(axis=0) + AROUND * self.size
        return {name: numbers(np.array([low[k], high[k]])) for k, name in enumerate("xyz")}

    def _labels(
        self,
        shares: Mapping[str, float],
        links: Lines,
        joints: Lines,
        index: Mapping[str, int],
        marks: Mapping[str, str],
    ) -> list[dict[str, Any]]:
        """Return where the parts with the largest shares are named."""
        nodes = dict.fromkeys(TOOL, self.robot.tcp) | {"base": self.robot.fixed[0], **marks}
        ends = {
            name: (self.positions[index[node]], self.moved[index[node], :3])
            for name, node in ({name: name for name in index} | nodes).items()
        }
        seen = {**ends, **links.middles(), **joints.middles()}
        first = sorted(shares.items(), key=lambda item: -item[1])[:LABELLED]
        return [
            {
                "text": f"{label(shortened(name))} {100 * value:.0f} %",
                "at": numbers(seen[name][0]),
                "by": numbers(seen[name][1]),
            }
            for name, value in first
            if name in seen and value >= SEEN
        ]

    def _ellipsoid(self, compliance: Array, tool: int) -> dict[str, Any]:
        """Return the surface that a turning unit force moves the tool to, scaled to a share of the robot."""
        part = 0.5 * (compliance + compliance.T)[:3, :3]
        values, directions = np.linalg.eigh(part)
        largest = float(values.max())
        scale = ELLIPSOID * self.size / largest if largest > 0.0 else 0.0
        around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
        sphere = np.stack([np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)])
        axes = scale * directions * values
        surface = np.einsum("ij,jab->iab", axes, sphere) + self.positions[tool][:, None, None]
        rows = {name: [numbers(row, 6) for row in part] for name, part in zip("xyz", surface, strict=True)}
        return rows | {f"d{name}": numbers(self.moved[tool, :3])[k] for k, name in enumerate("xyz")}


def _coloured(lines: Lines, shares: Mapping[str, float], told: Mapping[str, str]) -> dict[str, Any]:
    value = [float(f"{shares.get(name, 0.0):.4g}") for name in lines.names]
    text = [told.get(name, label(name)) for name in lines.names]
    return lines.moving() | {"shares": value, "hovertext": text}


def lines(name: str, hover: str = "text", **line: Any) -> dict[str, Any]:
    """Return the look of lines in space."""
    looks = {"type": "scatter3d", "mode": "lines", "connectgaps": False}
    return {**looks, "name": name, "line": line, "hoverinfo": hover}


def base_and_tool(**marker: Any) -> dict[str, Any]:
    """Return the look of the two ends of a robot."""
    symbols = {"symbol": ["square", "diamond"], "size": [9, 7], **marker}
    looks = {"type": "scatter3d", "mode": "markers", "name": "base and tool"}
    return {**looks, "marker": symbols, "hoverinfo": "text"}


def _styles(share: str, most: float, solid: bool) -> list[dict[str, Any]]:
    """Return the looks of the traces; where they are comes from the posture shown."""
    scale = [[0.0, css("part")], [0.12, css("warm")], [1.0, css("hot")]]
    coloured: dict[str, Any] = {"colorscale": scale, "cmin": 0.0, "cmax": most}
    bar = {"title": {"text": share, "side": "right"}, "tickformat": ".0%", "thickness": 12, "len": 0.7}
    bar["outlinewidth"] = 0
    return [
        lines("undeformed", "skip", color=css("muted"), width=3, dash="dash"),
        lines("links", width=9, **coloured, colorbar=bar, showscale=bool(share)),
        lines("joints", width=22, **coloured),
        base_and_tool(**coloured, line={"width": 1, "color": css("ink")}),
        lines("load", color=css("blue"), width=6),
        {
            "type": "cone",
            "name": "load",
            "anchor": "tip",
            "sizemode": "raw",
            "sizeref": 1,
            "showscale": False,
            "colorscale": [[0, css("blue")], [1, css("blue")]],
            "hoverinfo": "skip",
        },
        *([solids_style(**coloured)] if solid else []),
        {
            "type": "surface",
            "name": "compliance",
            "showscale": False,
            "opacity": 0.2,
            "colorscale": [[0, css("green")], [1, css("green")]],
            "hoverinfo": "name",
            "contours": {"x": {"highlight": False}, "y": {"highlight": False}, "z": {"highlight": False}},
        },
    ]


def space(camera: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """Return the layout of a figure in three dimensions, seen from a camera."""
    scene: dict[str, Any] = {
        f"{name}axis": axis(f"{name}, m", showbackground=False, nticks=6) for name in "xyz"
    }
    scene["zaxis"]["title"]["text"] += APART
    for one in scene.values():
        del one["automargin"], one["ticklabelstandoff"], one["title"]["standoff"]  # axes in space have none
    scene |= {"aspectmode": "manual", "camera": camera, "dragmode": "turntable"}
    return plain_layout(540, margin={"l": 0, "r": 0, "t": 0, "b": 0}, scene=scene, **more)


def _table(shown: Sequence[Shown], moved: Array, compliance: Array, tool: int) -> Table:
    rows = []
    for at, one in enumerate(shown):
        loads = (number(float(np.linalg.norm(part))) for part in (one.wrench[:3], one.wrench[3:]))
        values, directions = np.linalg.eigh(0.5 * (compliance[at] + compliance[at].T)[:3, :3])
        along = directions[:, -1] * (1.0 if max(directions[:, -1], key=abs) > 0 else -1.0)
        soft, stiff = "rigid", "-"
        if values[-1] > 0:
            soft = f"{1e6 * values[-1]:.4g} µm/N along ({', '.join(f'{part:.2f}' for part in along)})"
            stiff = f"{1e6 * max(values[0], 0.0):.4g} µm/N"
        moves = millimetres([float(np.linalg.norm(moved[at, tool, :3]))])
        rows.append([one.name, *loads, *moves, soft, stiff])
    columns = ("posture", "force, N", "moment, N m", "tool moves, mm", "softest direction", "stiffest")
    return Table("The postures shown", columns, rows, left=1, open=False)


def shortened(name: str) -> str:
    """Return a name as a label has room for; the part under the pointer tells it whole.

    >>> shortened("link2"), shortened("the column that carries the arm")
    ('link2', 'the column that…')
    """
    return name if len(name) <= CHARACTERS else name[: CHARACTERS - 1].rstrip() + "…"
