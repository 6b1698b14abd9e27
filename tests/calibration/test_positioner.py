"""A positioner whose target sits far from where its file has it, and whose weight hangs on its TCP's node."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import Robot, calibrate
from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.elastic import felt_names
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.se3 import Array

ARM = -0.475  # m, from the first axis to the table
TARGET = np.array([0.64, 0.18, 0.5])  # m: where the target is; the file has it at the table's centre
GRID = np.array([[tilt, turn] for tilt in np.linspace(-0.5, 0.5, 6) for turn in np.linspace(0.0, 5.9, 8)])


def positioner(centre: tuple[float, float, float] = (0.1, 0.0, 0.05)) -> Robot:
    """Return a tilting axis along z and a turning axis across it, 60 kg with their centre at `centre`."""
    return Robot.model_validate(
        {
            "name": "positioner",
            "gravity": [0, -9.81, 0],
            "variables": [{"name": "q1", "type": "revolute"}, {"name": "q2", "type": "revolute"}],
            "frames": [
                {"name": "f1", "theta": "q1"},
                {"name": "f2", "parent": "f1", "alpha": "-90 deg", "theta": "q2", "r": ARM},
            ],
            "nodes": [
                {"name": "foot"},
                {"name": "tilting", "frame": "f1"},
                {"name": "seat", "frame": "f1", "at": [0, ARM, 0]},
                {"name": "table", "frame": "f2"},
            ],
            "rigids": [{"name": "arm", "nodes": ["tilting", "seat"]}],
            "joints": [
                {
                    "name": "J1",
                    "nodes": ["foot", "tilting"],
                    "frame": "f1",
                    "variable": "q1",
                    "stiffness": {},
                },
                {
                    "name": "J2",
                    "nodes": ["seat", "table"],
                    "frame": "f2",
                    "variable": "q2",
                    "stiffness": {"torsional": 5e4},
                },
            ],
            "masses": [{"node": "table", "mass": 60, "at": centre}],
            "fixed": ["foot"],
            "tcp": "table",
        }
    )


def read(q: Array, turned: bool) -> Measurements:
    """Return the target's readings in a frame of their own, by plain rotations: rigid, free of noise."""
    tilt, turn = (Rotation.from_rotvec(angle[:, None] * [0, 0, 1.0]) for angle in q.T)
    across = Rotation.from_euler("x", -90, degrees=True)
    body = tilt * across * turn
    position = body.apply(TARGET) + (tilt * across).apply([0, 0, ARM])
    stand = Rotation.from_euler("x", 90, degrees=True)
    mounted = Rotation.from_matrix([[0.2, 0, -0.98], [-0.98, 0, -0.2], [0, 1, 0]])
    rotation = (stand * body * mounted).as_rotvec()
    return make_measurements(
        ["q1", "q2"],
        q,
        tcp="table",
        position=stand.apply(position) + np.array([1.0, -2.0, 0.7]),
        rotation=rotation if turned else None,
    )


@pytest.mark.parametrize("turned", [False, True])
def test_a_target_nearly_a_metre_off_is_placed(turned: bool) -> None:
    rigid = positioner().with_parameters({"J2.torsional": np.inf})
    found = calibrate(rigid, read(GRID, turned), folds=0)
    assert found.after.position_max == pytest.approx(0, abs=1e-9)
    assert next(node.at for node in found.robot.nodes if node.name == "table") == pytest.approx(TARGET)


def test_weights_stay_where_a_reflector_on_their_node_is_found_elsewhere() -> None:
    moved = corrected(positioner(), dict(zip(("table.x", "table.y", "table.z"), TARGET, strict=True)), GRID)
    node = next(node.at for node in moved.nodes if node.name == "table")
    assert node == pytest.approx(TARGET)
    assert np.add(node, moved.masses[0].at) == pytest.approx((0.1, 0.0, 0.05))


def test_no_torque_but_rounding_is_no_load() -> None:
    rows = read(GRID, turned=False)
    assert felt_names(positioner(), rows, ["J2.torsional"]) == ["J2.torsional"]
    assert felt_names(positioner((0.0, 0.0, 0.2)), rows, ["J2.torsional"]) == []
