"""The robot as it stands, with deviations of places in space: readings, a tool path."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.report.html.links import CAMERAS, DIAGONAL, joint_lines, link_lines
from beamstiff.report.html.parts import Figure, css, label, numbers, places, shared
from beamstiff.report.html.robot_view import AROUND, FURTHER, RobotView, base_and_tool, lines, space
from beamstiff.report.tables import Table, nice
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

DEVIATION = 0.1  # of the size: the largest deviation to begin with
FAR, NEAR, NEAREST = 1.0, 1.4, 0.2  # of the camera that looks at them from near
SMALLEST = 20.0  # times what it begins with at most, to see the smallest deviations


@dataclass(frozen=True)
class Deviations:
    """Places and how far each is off: (n, 3), m."""

    key: str  # by which the page holds them
    name: str
    colour: str  # of the theme
    # places, away: (n, 3), m
    places: Array
    away: Array
    texts: Sequence[str]  # what each is
    path: bool = False  # one line from place to place; else a line from each place to where it went
    dash: str = "solid"  # of plotly

    def lines(self) -> tuple[Array, Array, list[str]]:
        """Return the points of the lines (k, 3), how they move (k, 3), and what each is."""
        texts = [label(text) for text in self.texts]
        if self.path:
            return self.places, self.away, texts
        gap = np.full_like(self.places, np.nan)
        points = np.stack([self.places, self.places, gap], axis=1).reshape(-1, 3)
        moved = np.stack([0 * self.away, self.away, 0 * self.away], axis=1).reshape(-1, 3)
        return points, moved, [text for text in texts for _ in range(3)]


def still_view(
    robot: Robot,
    postures: Sequence[tuple[str, Array]],
    deviations: Sequence[Deviations],
    slider: str,
    caption: str,
    table: Table,
) -> RobotView | None:
    """Return a robot in some postures and deviations that a slider magnifies; None without a posture.

    `postures` (str, (A,)): what each is, and its actuated values. `deviations`: in the base frame. `slider`:
    what is magnified. `table`: the numbers.
    """
    if not postures:
        return None
    where = posture(compile_kinematics(robot), np.array([q for _, q in postures])).node_positions
    around = np.concatenate([where.reshape(-1, 3), *(one.places for one in deviations)])
    size = float(np.ptp(around, axis=0).max()) or 1.0
    low, high = around.min(axis=0) - AROUND * size, around.max(axis=0) + AROUND * size
    magnification, most = _magnification(size, deviations)
    cameras = dict(CAMERAS)
    if close := _close(deviations, magnification, 0.5 * (low + high), float(np.linalg.norm(high - low))):
        cameras["close"] = close
    ranges = {name: numbers(np.array([low[k], high[k]])) for k, name in enumerate("xyz")}
    held: dict[str, list[Any]] = {}
    own = []
    for one in deviations:
        points, moved, texts = one.lines()
        columns = places(points, moved if np.any(moved) else None, 6) | {"hovertext": texts}
        own.append({name: shared(_kept(held, f"{one.key}_{name}", value)) for name, value in columns.items()})
    views = [
        {"name": name, "traces": [*_robot(robot, q, at, size), *own], "labels": [], "ranges": ranges}
        for (name, q), at in zip(postures, where, strict=True)
    ]
    figure = Figure(
        "robot",
        "The robot",
        caption,
        _styles(deviations),
        space(CAMERAS["oblique"], legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "top"}),
        table,
    )
    return RobotView(figure, views, magnification, most, cameras, slider=slider, shared=held)


def _kept(held: dict[str, list[Any]], name: str, values: list[Any]) -> str:
    """Keep values under a name, or return the name under which they are kept already."""
    for known, others in held.items():
        if others == values:
            return known
    held[name] = values
    return name


def _magnification(size: float, deviations: Sequence[Deviations]) -> tuple[float, float]:
    """Return what to begin with, by the largest deviation, and the most, by the smallest kind of them."""
    found = [float(np.linalg.norm(one.away, axis=1).max(initial=0.0)) for one in deviations]
    found = [value for value in found if value > 0.0]
    if not found:
        return 0.0, 0.0
    begin = nice(DEVIATION * size / max(found))
    return begin, max(FURTHER * begin, min(SMALLEST * begin, nice(DEVIATION * size / min(found))))


def _close(
    deviations: Sequence[Deviations], magnification: float, middle: Array, diagonal: float
) -> dict[str, Any] | None:
    """Return the camera that looks at the deviations from near, None where they are all over the picture."""
    places = np.concatenate([one.places + magnification * one.away for one in deviations])
    if not len(places):
        return None
    scale = DIAGONAL / diagonal  # the figure's own lengths
    extent = scale * float(np.ptp(places, axis=0).max())
    if extent > FAR:
        return None
    at = scale * (0.5 * (places.min(axis=0) + places.max(axis=0)) - middle)
    eye = at + max(NEAR * extent, NEAREST) * np.array([0.6, -0.7, 0.4])
    return {
        name: dict(zip("xyz", numbers(value), strict=True)) for name, value in (("eye", eye), ("center", at))
    }


def _robot(robot: Robot, q: Array, positions: Array, size: float) -> list[dict[str, Any]]:
    still, names = np.zeros((len(positions), 6)), [node.name for node in robot.nodes]
    ends = positions[[names.index(robot.fixed[0]), names.index(robot.tcp)]]
    lines = link_lines(robot, positions, still), joint_lines(robot, q, positions, still, size)
    parts = [one.moving(still=True) | {"hovertext": [label(name) for name in one.names]} for one in lines]
    return [*parts, places(ends) | {"hovertext": ["base", "tool"]}]


def _styles(deviations: Sequence[Deviations]) -> list[dict[str, Any]]:
    """Return the looks of the traces; where they are comes from the posture shown."""
    robot = [
        lines("links", width=8, color=css("part")),
        lines("joints", width=18, color=css("muted")),
        base_and_tool(color=css("soft")),
    ]
    away = [lines(label(one.name), width=5, color=css(one.colour), dash=one.dash) for one in deviations]
    return [*(one | {"showlegend": False} for one in robot), *away]
