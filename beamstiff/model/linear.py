"""The displacement of every row of a table of loads, for a robot whose stiffness is known."""

from dataclasses import replace

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.beam_column import coarse_beams
from beamstiff.fem.condensation import condense
from beamstiff.fem.geometric_stiffness import loaded_displacement
from beamstiff.fem.mechanism import PoseError
from beamstiff.fem.static_response import respond
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.measure.arrays import Integers
from beamstiff.measure.table import Measurements
from beamstiff.model.pose_errors import named_by_row
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import Posture, posture
from beamstiff.se3 import Array

HEAVY = 2e4  # N; more than robots carry: written in kN by mistake
HEAVIEST = 20  # rows that are looked at for beams whose K_C is coarse


def predict_displacements(robot: Robot, loads: Measurements, preload: bool = False) -> Array:
    """Return the displacement of the measured point of every row, loaded minus unloaded.

    Without `preload` it is ``C w`` on the undeformed geometry. With it, both states are equilibria to second
    order in their loads, the loaded one under dead weight, payload and the row's wrench, the unloaded one
    under dead weight and payload: with the stiffness that the loads leave (geometric stiffness, K_C of seed
    000, eqs 9 and 10), the curved paths of the nodes and strains of second order (`fem.finite_displacement`).

    Parameters
    ----------
    robot : Robot
    loads : Measurements
        N rows: joint values, wrench at `load_point`, measured `point`.
    preload : bool
        Take into account how gravity and the load itself change the stiffness.

    Returns
    -------
    (N, 6) array
        ``[d, r]``, base frame, m and rad.

    Raises
    ------
    BeamstiffError
        When a pose cannot close its loops, the structure is a mechanism, or buckles under its load.

    Examples
    --------
    >>> from beamstiff.measure.table import make_measurements
    >>> from beamstiff.robot.reader import load_robot
    >>> robot = load_robot("kr240-2")
    >>> names = [variable.name for variable in robot.actuated]
    >>> wrench = [[900, 0, -2000, 0, 0, 0]]
    >>> push = make_measurements(names, [[0, 0.5, -1, 0, 0.5, 0]], tcp=robot.tcp, wrench=wrench)
    >>> for preload in (False, True):
    ...     print((1e3 * predict_displacements(robot, push, preload)[0, 0]).round(4))
    2.0386
    2.0398
    """
    refuse_idle_moments(robot, loads)
    structure = compile_structure(robot)
    poses, pose = np.unique(loads.q, axis=0, return_inverse=True)
    where, number = posture(structure.kinematics, poses), pose.reshape(-1).astype(np.int64)
    return (_with_preload if preload else _by_compliance)(structure, where, number, loads)


def compliance_of_rows(robot: Robot, loads: Measurements) -> Array:
    """Return the displacement of every row's point per unit wrench at its load point, (N, 6, 6), linear.

    Raises BeamstiffError as `predict_displacements`; loads on a node without a rotation are refused, whatever
    the rows carry.
    """
    refuse_idle_moments(robot, replace(loads, wrench=np.ones_like(loads.wrench)))
    structure = compile_structure(robot)
    poses, pose = np.unique(loads.q, axis=0, return_inverse=True)
    number = pose.reshape(-1).astype(np.int64)
    return _compliance(structure, posture(structure.kinematics, poses), number, loads)


def _by_compliance(structure: Structure, where: Posture, pose: Integers, loads: Measurements) -> Array:
    return (_compliance(structure, where, pose, loads) @ loads.wrench[..., None])[..., 0]


def _compliance(structure: Structure, where: Posture, pose: Integers, loads: Measurements) -> Array:
    observed = list(dict.fromkeys([*loads.point.tolist(), *loads.load_point.tolist()]))
    with named_by_row(loads, pose):
        compliance = condense(structure, where, observed).clamped
    at = {name: 6 * number + np.arange(6) for number, name in enumerate(observed)}
    seen = np.stack([at[name] for name in loads.point.tolist()])
    loaded = np.stack([at[name] for name in loads.load_point.tolist()])
    own: Array = compliance[pose[:, None, None], seen[:, :, None], loaded[:, None, :]]
    return own


def displaced_points(robot: Robot, loads: Measurements) -> tuple[Array, Array]:
    """Return how far weight, payload and the row's load move its point, and the TCP, (N, 6) each.

    Off the undeformed machine, m and rad, base frame: equilibria to second order in the loads.
    """
    structure = compile_structure(robot)
    poses, pose = np.unique(loads.q, axis=0, return_inverse=True)
    moved = _loaded(structure, posture(structure.kinematics, poses).only(pose.reshape(-1)), loads)
    index = structure.kinematics.node_index
    seen = [index[name] for name in loads.point.tolist()]
    return moved[np.arange(len(loads)), seen], moved[:, index[robot.tcp]]


def _with_preload(structure: Structure, where: Posture, pose: Integers, loads: Measurements) -> Array:
    index, rows = structure.kinematics.node_index, np.arange(len(loads))
    nothing = np.zeros((len(where.values), len(structure.robot.nodes), 6))
    with named_by_row(loads, pose):
        unloaded = loaded_displacement(structure, where, nothing, gravity=True)[pose]
    loaded = _loaded(structure, where.only(pose), loads)
    seen = [index[name] for name in loads.point.tolist()]
    return between(unloaded[rows, seen], loaded[rows, seen])


def _loaded(structure: Structure, of_row: Posture, loads: Measurements) -> Array:
    """Return the displacement of all nodes under the weight and the load of every row, (N, nodes, 6)."""
    index = structure.kinematics.node_index
    wrenches = np.zeros((len(loads), len(structure.robot.nodes), 6))
    wrenches[np.arange(len(loads)), [index[name] for name in loads.load_point.tolist()]] = loads.wrench
    try:
        return loaded_displacement(structure, of_row, wrenches, gravity=True)
    except PoseError as error:
        what = str(error).replace(error.where, "", 1)
        raise BeamstiffError(f"{loads.place(error.pose)}: {what}{_load_of(loads, error.pose)}") from None
    except BeamstiffError as error:
        raise BeamstiffError(f"{loads.source}: {error} (poses are the rows here, the first is 0)") from None


def _load_of(loads: Measurements, row: int) -> str:
    """Return the load of a row, and what may be wrong with it; empty where it has none."""
    force, moment = (float(np.linalg.norm(part)) for part in np.split(loads.wrench[row], 2))
    said = [f"{size:.0f} {unit}" for size, unit in ((force, "N"), (moment, "N m")) if size > 0.0]
    if not said:
        return ""
    meant = f" ({force / 1e3:.3g} N meant?)" if force > HEAVY else ""
    return f". The load of this row is {' and '.join(said)}{meant}: check its columns and their units"


def between(first: Array, second: Array) -> Array:
    """Return the displacement (..., 6) from one displaced state to another, r a rotation vector.

    ``log(exp(b) exp(-a))`` by the angular velocity halfway, to third order in b - a; no digit is lost where
    the states are near to one another.
    """
    change, halfway = second - first, 0.5 * (first + second)[..., 3:]
    turn = np.cross(halfway, change[..., 3:])
    change[..., 3:] += 0.5 * turn + np.cross(halfway, turn) / 6
    return change


def preload_notes(robot: Robot, loads: Measurements) -> list[str]:
    """Return notes on beams of which K_C is not known to a thousandth, under the largest of the loads."""
    if not robot.beams or not len(loads):
        return []
    structure = compile_structure(robot)
    size = structure.kinematics.size
    wrench = np.linalg.norm(loads.wrench[:, :3], axis=1) * size + np.linalg.norm(loads.wrench[:, 3:], axis=1)
    rows = np.argsort(-wrench, kind="stable")[:HEAVIEST]
    where, index = posture(structure.kinematics, loads.q[rows]), structure.kinematics.node_index
    wrenches = np.zeros((len(rows), len(robot.nodes), 6))
    wrenches[np.arange(len(rows)), [index[name] for name in loads.load_point[rows].tolist()]] = loads.wrench[
        rows
    ]
    return coarse_beams(respond(structure, where, wrenches, gravity=True))


def refuse_idle_moments(robot: Robot, loads: Measurements) -> None:
    """Refuse moments on nodes that only struts hold, which have no rotation."""
    held = np.isin(loads.load_point, list(turning_nodes(robot)))
    if (idle := ~held & loads.wrench[:, 3:].any(axis=1)).any():
        row = int(np.argmax(idle))
        raise BeamstiffError(
            f"{loads.place(row)}: a moment acts on node {str(loads.load_point[row])!r}, which struts alone "
            "hold: it has no rotation"
        )
