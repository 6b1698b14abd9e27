"""A robot as lines in a picture: beams, rigids and struts, its joints, in the plane that shows most of it."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_hex

from beamstiff.diagnosis.effects.torque_laws import component_of
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.parts import Beam, Rigid, Strut
from beamstiff.se3 import Array

COLOURS = "YlOrRd"
QUIET = "0.75"  # parts without a share
LABELLED = 3
NEAR, MOST_NAMED = 0.1, 40  # of the size: places that share a label; labels in space at most
TOOL_POINT = "tool point"  # where the tool is taken to be, which may be off


def draw_shares(axes: Axes, robot: Robot, q: Array, shares: Mapping[str, float]) -> None:
    """Draw a robot in a posture (A,), its parts (also base, tool, tool point) coloured by shares, 0 to 1."""
    positions = posture(compile_kinematics(robot), q[None]).node_positions[0]
    names = (node.name for node in robot.nodes)
    at = dict(zip(names, _flat(positions, np.array(robot.gravity)), strict=True))
    most, colour = _colours(shares)
    middle: dict[str, Array] = {}
    for part in _lines(robot):
        line = np.array([at[node] for node in part.nodes])
        middle[part.name] = line.mean(axis=0)
        wide = 4.0 if shares.get(part.name) else 2.0
        axes.plot(line[:, 0], line[:, 1], color=colour(part.name), lw=wide, solid_capstyle="round", zorder=1)
    marks = _marks(robot) + ([(TOOL_POINT, robot.tcp, "D")] if TOOL_POINT in shares else [])
    for name, node, mark in marks:
        x, y = middle[name] = at[node]
        size = 40.0 + 160.0 * shares.get(name, 0.0) / most
        axes.scatter(x, y, s=size, color=colour(name), marker=mark, edgecolors="0.2", zorder=2)
    placed = [(name, share) for name, share in shares.items() if name in middle]
    labelled = dict[tuple[float, ...], int]()  # labels of one place stand below one another
    for name, share in sorted(placed, key=lambda item: -item[1])[:LABELLED]:
        label, where = f"{name} {100 * share:.0f} %", tuple(middle[name])
        below = labelled[where] = labelled.get(where, -1) + 1
        offset = (8, 6 - 10 * below)
        axes.annotate(label, where, xytext=offset, textcoords="offset points", fontsize=8, zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)


def draw_in_space(axes: Any, robot: Robot, q: Array, shares: Mapping[str, float]) -> None:
    """Draw a robot in a posture (A,) on axes 3d, parts coloured by shares, joints, base and tool named."""
    positions = posture(compile_kinematics(robot), q[None]).node_positions[0]
    at = dict(zip((node.name for node in robot.nodes), positions, strict=True))
    _, colour = _colours(shares)
    for part in _lines(robot):
        axes.plot(*np.array([at[node] for node in part.nodes]).T, color=colour(part.name), lw=3.0)
    for name, node, mark in _marks(robot):
        axes.scatter(*at[node], s=36.0, color=colour(name), marker=mark, edgecolors="0.2", depthshade=False)
    size = float(np.ptp(positions, axis=0).max()) or 1.0
    places = list[tuple[Array, list[str]]]()  # what stands close together shares a label
    for name, node, _ in _marks(robot):
        near = [names for place, names in places if np.linalg.norm(place - at[node]) < NEAR * size]
        if near:
            near[0].append(name)
        else:
            places.append((at[node], [name]))
    places += [(0.5 * (at[one.nodes[0]] + at[one.nodes[1]]), [one.name]) for one in robot.struts]
    for place, names in places[:MOST_NAMED]:
        axes.text(*(place + 0.03 * size), ", ".join(names), fontsize=8)
    middle, half = 0.5 * (positions.min(axis=0) + positions.max(axis=0)), 0.55 * size
    for name, value in zip("xyz", middle.tolist(), strict=True):
        axes.locator_params(axis=name, nbins=5)
        axes.set(**{f"{name}lim": (value - half, value + half), f"{name}label": f"{name}, m"})
    axes.set_box_aspect((1, 1, 1))


def _colours(shares: Mapping[str, float]) -> tuple[float, Callable[[str], str]]:
    """Return the share that has the full colour, and what gives a part's colour by its name."""
    most = max([0.05, *shares.values()])
    colours = ScalarMappable(Normalize(0.0, most), colormaps[COLOURS])

    def colour(name: str) -> str:
        return to_hex(colours.to_rgba(np.array([shares[name]]))[0]) if shares.get(name, 0.0) > 0.0 else QUIET

    return most, colour


def _lines(robot: Robot) -> list[Rigid | Beam | Strut]:
    return [*robot.rigids, *robot.beams, *robot.struts]


def _marks(robot: Robot) -> list[tuple[str, str, str]]:
    """Return name, node and mark of joints, base and tool."""
    joints = [(component_of(robot, joint), joint.nodes[0], "o") for joint in robot.joints]
    return [*joints, ("base", robot.fixed[0], "^"), ("tool", robot.tcp, "D")]


def _flat(positions: Array, gravity: Array) -> Array:
    """Return positions (n, 3) in the upright plane in which they spread most, (n, 2): across and up."""
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    level = positions - positions.mean(axis=0)
    level = level - np.outer(level @ up, up)
    _, values, directions = np.linalg.svd(level)
    across = directions[0] if values[0] > 0 else np.cross(up, [0.0, 1.0, 0.0])
    across = across * (1.0 if across[np.argmax(np.abs(across))] > 0 else -1.0)
    return np.stack([positions @ across, positions @ up], axis=-1)
