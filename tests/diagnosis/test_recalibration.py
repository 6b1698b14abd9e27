"""What a calibration changed, told apart: geometry, and the stiffness of drives."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff import diagnose
from beamstiff.measure.table import make_measurements
from beamstiff.report.calibrated_text import changes_text
from beamstiff.report.diagnosis_text import verdict
from beamstiff.robot.parts import Node, Rigid
from tests.calibration.test_positioner import ARM, positioner

WEIGHT = 60 * 9.81  # N, along -y
CENTRE = np.array([0.1, 0.0, 0.05])  # m, of what weighs
SEEN = np.array([0.25, 0.1, 0.2])  # m, of the reflector
NOISE = 2e-5  # m


def test_drives_that_are_softer_than_described_are_told_beside_the_geometry() -> None:
    rng = np.random.default_rng(3)
    q = np.column_stack([rng.uniform(-1.0, 1.0, 60), rng.uniform(-3.0, 3.0, 60)])
    tilt = Rotation.from_rotvec(q[:, :1] * [0, 0, 1.0]) * Rotation.from_euler("x", -90, degrees=True)
    axis = tilt.apply([0, 0, 1.0])
    lever = (tilt * Rotation.from_rotvec(q[:, 1:] * [0, 0, 1.0])).apply(CENTRE)
    torque = (axis * np.cross(lever, [0, -WEIGHT, 0])).sum(axis=1)
    body = tilt * Rotation.from_rotvec((q[:, 1:] + torque[:, None] / 5e3) * [0, 0, 1.0])
    position = body.apply(SEEN) + tilt.apply([0, 0, ARM + 2e-3]) + NOISE * rng.standard_normal((60, 3))
    rows = make_measurements(["q1", "q2"], q, tcp="table", position=position, sigma_position=NOISE)
    robot = positioner().model_copy(update={"identify": ("J2.torsional",)})
    found = diagnose(robot, rows)
    changed = found.recalibration
    assert changed.stiff is not None
    table = tilt.apply([0, 0, ARM])  # the file places no reflector elsewhere
    a, b = table - table.mean(axis=0), position - position.mean(axis=0)
    assert changed.rigid == pytest.approx(Rotation.align_vectors(b, a)[1] / np.sqrt(60), rel=1e-6)
    assert changed.after == pytest.approx(np.sqrt(3) * NOISE, rel=0.15)
    # what 0.9 of the sag is, less what zeros and frames take up of it
    sag = 0.9 * np.hypot(*SEEN[:2]) * np.std(torque / 5e3)
    assert 0.2 * sag < changed.stiff < 1.1 * sag
    assert "drive stiffness" in verdict(found).headline


@pytest.mark.parametrize(("apart", "together"), [(0.0, ("left", "right")), (8e-4, ())])
def test_reflectors_that_moved_alike_say_that_their_link_is_off(
    apart: float, together: tuple[str, ...]
) -> None:
    rng = np.random.default_rng(4)
    q = np.column_stack([rng.uniform(-1.0, 1.0, 60), rng.uniform(-3.0, 3.0, 60)])
    tilt = Rotation.from_rotvec(q[:, :1] * [0, 0, 1.0]) * Rotation.from_euler("x", -90, degrees=True)
    body = tilt * Rotation.from_rotvec(q[:, 1:] * [0, 0, 1.0])
    described = {"left": np.array([0.25, 0.1, 0.2]), "right": np.array([-0.1, 0.3, 0.1])}
    off = {"left": np.array([1e-3, -5e-4, 4e-4]), "right": np.array([1e-3 - apart, -5e-4, 4e-4])}
    names = [*described] * 30
    seen = np.array([described[name] + off[name] for name in names])
    position = body.apply(seen) + tilt.apply([0, 0, ARM]) + NOISE * rng.standard_normal((60, 3))
    rows = make_measurements(
        ["q1", "q2"], q, tcp="table", position=position, point=names, sigma_position=NOISE
    )
    bare = positioner()
    nodes = [Node(name=name, frame="f2", at=tuple(at.tolist())) for name, at in described.items()]
    rigids = [Rigid(name=f"mount_{name}", nodes=("table", name)) for name in described]
    robot = bare.model_copy(update={"nodes": (*bare.nodes, *nodes), "rigids": (*bare.rigids, *rigids)})
    result = diagnose(robot, rows)
    changed = result.recalibration
    assert changed.together == together
    assert ("left, right moved alike" in changes_text(result)) == bool(together)
