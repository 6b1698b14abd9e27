"""What a robot file means, as tables for people."""

from collections.abc import Iterator
from math import degrees
from typing import Any

from rich.console import RenderableType
from rich.tree import Tree

from beamstiff.errors import counted, listed
from beamstiff.report.tables import MOST_ROWS, Table, millimetres, number, table

MOST_LOOPS = 5
MOST_PASSIVE = 6


def overview_tables(facts: dict[str, Any]) -> list[RenderableType]:
    """Return tables of what `overview.describe` found; those without rows are left out."""
    before = [_variables(facts), _frames(facts), _loops(facts), _assemblies(facts)]
    after = [_beams(facts), _springs(facts)]
    return [
        f"Robot {facts['name']}",
        *(item for item in before if item.rows),
        _tree(facts),
        *(item for item in after if item.rows),
        table("Summary", "", "", left=2, rows=_summary_rows(facts)),
    ]


def _variables(facts: dict[str, Any]) -> Table:
    heads, rows = ("name", "type", "role", "limits", "reference"), map(_variable, facts["variables"])
    return table("Joint variables", *heads, left=5, rows=rows)


def _variable(item: dict[str, Any]) -> list[str]:
    turning = item["type"] == "revolute"
    unit = "deg" if turning else "mm"

    def shown(value: float) -> str:
        return f"{degrees(value) if turning else 1e3 * value:.6g}"

    role = f"coupled: {item['equals']}" if item["equals"] else item["role"]
    limits = "none" if item["role"] == "actuated" else ""
    if item["limits"] is not None:
        limits = f"{' to '.join(map(shown, item['limits']))} {unit}"
    return [item["name"], item["type"], role, limits, f"{shown(item['reference'])} {unit}"]


def _frames(facts: dict[str, Any]) -> Table:
    title, heads = "Origins of the frames at the reference, mm, base frame", ("name", "parent", "x", "y", "z")
    rows = ([item["name"], item["parent"], *millimetres(item["position"])] for item in facts["frames"])
    return table(title, *heads, left=2, rows=rows)


def _loops(facts: dict[str, Any]) -> Table:
    rows = ([item["name"], f"{item['a']}, {item['b']}", item["constrain"]] for item in facts["loops"])
    return table("Closed loops", "name", "between", "constrains", left=3, rows=rows)


def _assemblies(facts: dict[str, Any]) -> Table:
    kinds = {item["name"]: item["type"] for item in facts["variables"]}
    passive = list(facts["assemblies"][0]["passive"]) if facts["assemblies"] else []
    shown = passive[:MOST_PASSIVE]
    units = [f"{name}, {'deg' if kinds[name] == 'revolute' else 'mm'}" for name in shown]
    title = "Assemblies where they come nearest to the guesses"
    if len(passive) > MOST_PASSIVE:
        title += f" ({len(passive) - MOST_PASSIVE} more passive variables in the JSON)"
    result = table(title, "name", "", *units, "TCP x, mm", "y", "z", left=2)
    for item in facts["assemblies"]:
        values = item["passive"]
        at = (degrees(values[name]) if kinds[name] == "revolute" else 1e3 * values[name] for name in shown)
        taken = "taken" if item["taken"] else ""
        rounded = (f"{round(value, 2) + 0.0:.2f}" for value in at)  # no minus before nothing
        result.add_row(item["name"], taken, *rounded, *millimetres(item["tcp"]))
    return result


def _beams(facts: dict[str, Any]) -> Table:
    rows = (
        [item["name"], ", ".join(item["nodes"]), item["section"], *millimetres([item["length"]])]
        for item in facts["beams"]
    )
    return table("Beams", "name", "nodes", "section", "length, mm", left=3, rows=rows)


def _springs(facts: dict[str, Any]) -> Table:
    def shown(value: float | str) -> str:
        return value if isinstance(value, str) else number(value)

    kinds = ("axial", "radial", "torsional", "tilting")
    joints = (
        [item["name"], item["variable"] or "", *(shown(item["stiffness"][kind]) for kind in kinds)]
        for item in facts["joints"]
    )
    struts = ([item["name"], "", shown(item["stiffness"])] for item in facts["struts"])
    title, heads = "Joints and struts, N/m and N m/rad", ("name", "variable", *kinds)
    return table(title, *heads, left=2, rows=[*joints, *struts])


def _tree(facts: dict[str, Any]) -> Tree:
    """Return the structure from the fixed nodes outward, with the elements that hold each node."""
    tree = Tree("Structure (each node with the element that holds it; x y z at the reference, mm)")
    nodes = {item["name"]: item for item in facts["nodes"]}
    below: dict[str | None, list[str]] = {}
    for name, item in nodes.items():
        below.setdefault(item["hangs_on"], []).append(name)
    branches: dict[str | None, Tree] = {None: tree}
    waiting = below.get(None, [])
    for name in waiting:
        if len(branches) > MOST_ROWS:
            tree.add(f"... {len(nodes) - MOST_ROWS} more nodes")
            break
        item = nodes[name]
        held = f" by {', '.join(item['through'])}" if item["through"] else ""
        marks = " [fixed]" * item["fixed"] + " [TCP]" * (name == facts["tcp"]["node"])
        label = f"{name}{held}: {' '.join(millimetres(item['position']))}{marks}"
        branches[name] = branches[item["hangs_on"]].add(label)
        waiting += below.get(name, [])  # grows while it is gone through: nearest to the base first
    return tree


def _summary_rows(facts: dict[str, Any]) -> Iterator[list[str]]:
    kinds = ("nodes", "beams", "rigids", "joints", "struts")
    yield ["structure", ", ".join(counted(len(facts[kind]), kind[:-1]) for kind in kinds if facts[kind])]
    held = {item["name"] for item in facts["nodes"] if item["fixed"]}
    loops = [
        " - ".join(loop) + " - ground" * ({loop[0], loop[-1]} <= held) for loop in facts["structural_loops"]
    ]
    if len(loops) > MOST_LOOPS:
        loops[MOST_LOOPS:] = [f"{len(loops) - MOST_LOOPS} more"]
    yield ["closed loops of the structure", "; ".join(loops) or "none"]
    full = 6 * len(facts["nodes"])
    yield ["unknowns", f"{facts['unknowns']} (of {full}: fixed nodes and rigid directions have none)"]
    condition = "not computed" if facts["condition"] is None else number(facts["condition"])
    yield ["condition of the scaled stiffness", condition]
    weightless = f"; without density: {listed(facts['weightless'])}" if facts["weightless"] else ""
    yield ["mass of beams and masses", f"{facts['mass']:.4g} kg{weightless}"]
    gravity = ", ".join(f"{value:g}" for value in facts["gravity"])
    yield ["gravity", f"{gravity} m/s^2" if any(facts["gravity"]) else "none"]
    yield ["TCP", f"{facts['tcp']['node']} at {', '.join(millimetres(facts['tcp']['position']))} mm"]
    reach = facts["reach"]
    ends = zip("xyz", millimetres(reach["lower"]), millimetres(reach["upper"]), strict=True)
    yield ["reach of the TCP", ", ".join(f"{axis} {low} to {high}" for axis, low, high in ends) + " mm"]
    yield ["", f"farthest from the base: {millimetres([reach['farthest']])[0]} mm"]
    sampled = f"{reach['samples']} sampled postures"
    if facts["loops"]:
        sampled = f"the {reach['closing']} of {sampled} whose loops close"
    yield ["", f"over {sampled} (seed {reach['seed']})"]
    nothing = "nothing listed: name stiffness values with --parameters"
    yield ["identify", ", ".join(facts["identify"]) or nothing]
