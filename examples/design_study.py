"""Make a portal milling machine stiffer: compare designs by mass, stiffness at the tool and who is to blame.

Run as `python examples/design_study.py [FIGURE.png]`. The machine is `robots/gantry.yaml`, a plausible one.
The way to go: see which parts give way, change one thing at a time (section, material, stiffness, topology),
keep what pays, then size the bridge.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from beamstiff import Beam, Material, Robot, Section, compile_structure, load_robot, posture, tcp_compliance
from beamstiff.fem.loads import total_mass
from beamstiff.fem.placed_structure import place
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.report.figures import BLUE, GREEN, GREY, ORANGE, new_figure, plain, save_figure
from beamstiff.report.tables import Table, table

FIGURE = Path(__file__).resolve().parent / "output" / "design_study.png"
BEST = "bridge, ram and rails together"
FORCE = 1000.0  # N, of milling, in x, y and z in turn
PARTS = {"post": "walls", "rail": "walls", "tie": "walls", "bridge": "bridge", "ram": "ram"}
COLOURS = {"walls": GREY, "bridge": BLUE, "ram": GREEN, "guides, drives": ORANGE}


# 1. The designs: the machine as it is, and one change each. `changed` checks the whole machine anew.


def changed(machine: Robot, **parts: Any) -> Robot:
    """Return the machine with other `beams`, `sections`, ... in place of its own."""
    return Robot(**(dict(machine) | parts))


def with_section(machine: Robot, name: str, section: Section) -> Robot:
    return changed(machine, sections={**machine.sections, name: section})


def with_material(machine: Robot, prefix: str, name: str, material: Material) -> Robot:
    """Return the machine with the beams whose names start with `prefix` in another material."""
    beams = [
        beam.model_copy(update={"material": name}) if beam.name.startswith(prefix) else beam
        for beam in machine.beams
    ]
    return changed(machine, materials={**machine.materials, name: material}, beams=beams)


def with_saddle_rails_apart(machine: Robot, distance: float) -> Robot:
    """Return the machine with its saddle's rails not 0.4 m apart: stiffness goes with the square of that."""
    stiffness = machine.parameter("Y.torsional") * (distance / 0.4) ** 2
    return machine.with_parameters({"Y.torsional": stiffness})


def with_tie(machine: Robot) -> Robot:
    """Return the machine with a beam between the tops of the rear posts, which closes the portal."""
    tie = Beam(
        name="tie",
        nodes=("top_left_rear", "top_right_rear"),
        section="rail",
        material="steel",
        up=(1, 0, 0),
    )
    return changed(machine, beams=[*machine.beams, tie])


def designs() -> dict[str, Robot]:
    machine = load_robot("gantry")
    aluminium = Material(E="70 GPa", G="26 GPa", density="2700 kg/m^3")
    higher = Section(shape="box", width="400 mm", height="650 mm", wall="12 mm")
    thicker = Section(shape="box", width="320 mm", height="320 mm", wall="30 mm")
    best = with_saddle_rails_apart(
        with_section(with_section(machine, "bridge", higher), "ram", thicker), distance=0.6
    )
    return {
        "as it is": machine,
        "bridge 650 mm high, 12 mm walls": with_section(machine, "bridge", higher),
        "bridge of aluminium": with_material(machine, "bridge", "aluminium", aluminium),
        "ram 320 mm, 30 mm walls": with_section(machine, "ram", thicker),
        "saddle's rails 600 mm apart": with_saddle_rails_apart(machine, 0.6),
        "tie between the rear posts": with_tie(machine),
        BEST: best,
    }


# 2. What counts: mass, stiffness over the workspace, and who gives way where it is worst.


@dataclass(frozen=True)
class Findings:
    mass: float  # kg, largest over the workspace
    stiffness: np.ndarray  # (3,) N/m, in x, y, z in the middle of the workspace
    deflection: float  # m, along FORCE, worst place and direction
    shares: dict[str, float]  # of each part in it (and in the strain energy)


def examine(machine: Robot) -> Findings:
    structure = compile_structure(machine)
    limits = np.array([variable.limits for variable in machine.actuated])
    middle = limits.mean(axis=1)
    grid = [np.linspace(low, high, 5) for low, high in limits]
    everywhere = posture(structure.kinematics, np.array(list(product(*grid))))

    compliance = tcp_compliance(structure, posture(structure.kinematics, middle))[0, :3, :3]
    pushed = tcp_compliance(structure, everywhere)[:, :3, :3]
    moved = FORCE * np.diagonal(pushed, axis1=1, axis2=2)  # (P, 3), along a force in x, y, z
    worst = np.unravel_index(np.argmax(moved), moved.shape)

    wrench = np.zeros(6)
    wrench[worst[1]] = FORCE
    loads = nodal_loads(structure, len(moved), {machine.tcp: wrench})
    shares = dict.fromkeys(COLOURS, 0.0)
    for name, share in respond(structure, everywhere, loads).energy_shares().items():
        shares[PARTS.get(name.split("_")[0], "guides, drives")] += float(share[worst[0]])
    return Findings(
        mass=float(total_mass(structure, place(structure, everywhere)).max()),
        stiffness=1.0 / np.diagonal(compliance),
        deflection=float(moved[worst]),
        shares=shares,
    )


# 3. Side by side.


def stiffness_table(found: dict[str, Findings]) -> Table:
    result = table("Mass, and stiffness in mid-workspace", "design", "kg", "x N/µm", "y N/µm", "z N/µm")
    for name, design in found.items():
        result.add_row(name, f"{design.mass:.0f}", *(f"{1e-6 * value:.1f}" for value in design.stiffness))
    return result


def blame_table(found: dict[str, Findings]) -> Table:
    title = f"Worst deflection in the workspace along {FORCE:.0f} N, and whose it is in %"
    result = table(title, "design", "µm", *COLOURS)
    for name, design in found.items():
        shares = (f"{100 * share:.0f}" for share in design.shares.values())
        result.add_row(name, f"{1e6 * design.deflection:.1f}", *shares)
    return result


# 4. One thing sized: the bridge's height and walls, on the best machine so far.


def size_bridge(machine: Robot) -> dict[float, list[tuple[float, Findings]]]:
    """Return, by thickness of the walls, heights of the bridge with what they give; lengths in m."""
    heights = np.linspace(0.3, 0.8, 6)

    def bridge(height: float, wall: float) -> Robot:
        return with_section(machine, "bridge", Section(shape="box", width=0.4, height=height, wall=wall))

    return {
        wall: [(height, examine(bridge(height, wall))) for height in heights]
        for wall in (0.008, 0.012, 0.020)
    }


def draw(found: dict[str, Findings], sized: dict[float, list[tuple[float, Findings]]]) -> Figure:
    figure = new_figure(13.0, 4.8)
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1.0))

    names = list(found)[::-1]
    start = np.zeros(len(names))
    for part, colour in COLOURS.items():
        width = np.array([1e6 * found[name].deflection * found[name].shares[part] for name in names])
        left.barh(names, width, left=start, color=colour, label=part)
        start += width
    left.set_xlabel(f"worst deflection along {FORCE:.0f} N, µm, and the parts it comes from")
    left.legend(ncols=4, loc="lower center", bbox_to_anchor=(0.4, 1.0), frameon=False)

    for (wall, sizes), marker, colour in zip(sized.items(), "os^", (ORANGE, BLUE, GREEN), strict=True):
        at = [(design.mass, 1e6 * design.deflection) for _, design in sizes]
        right.plot(*zip(*at, strict=True), marker=marker, color=colour, label=f"walls {1e3 * wall:.0f} mm")
        for end in (0, -1):
            text, place_at = f"{1e3 * sizes[end][0]:.0f} mm", (0, 7) if end == 0 else (0, -13)
            right.annotate(
                text, at[end], textcoords="offset points", xytext=place_at, ha="center", fontsize=8
            )
    right.margins(0.08, 0.12)
    right.set_xlabel("mass of the machine, kg")
    right.set_ylabel(f"worst deflection along {FORCE:.0f} N, µm")
    right.set_title("the bridge sized: 300 to 800 mm high", fontsize=10)
    right.legend(frameon=False)
    for axes in (left, right):
        plain(axes)
    return figure


def main(figure: Path = FIGURE) -> None:
    machines = designs()
    found = {name: examine(machine) for name, machine in machines.items()}
    sized = size_bridge(machines[BEST])

    console = Console(highlight=False, markup=False)
    console.print(stiffness_table(found), "", blame_table(found), sep="\n")
    before, after = found["as it is"], found[BEST]
    console.print(
        f"\nThe changes that pay take {1 - after.deflection / before.deflection:.0%} off the worst "
        f"deflection for {after.mass / before.mass - 1:.1%} more mass."
    )
    figure.parent.mkdir(parents=True, exist_ok=True)
    save_figure(draw(found, sized), figure)
    console.print(f"Designs side by side, and the bridge sized: {figure}", soft_wrap=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
