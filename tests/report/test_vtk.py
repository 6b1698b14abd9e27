"""VTU of the deformed structure. Truth: the closed form of a cantilever; read back as XML, and by meshio."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from beamstiff import Beam, Joint, JointStiffness, Material, Node, Rigid, Robot, Section, Variable, load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.report.vtk import beam_shape, vtu_text, write_vtu
from beamstiff.robot.parts import Frame
from beamstiff.se3 import Array

E, G, INERTIA, J, A, LENGTH = 2.1e11, 8e10, 2e-6, 3e-6, 1e-3, 1.5


def cantilever() -> Robot:
    return Robot(
        name="<cantilever>",
        materials={"steel": Material(E=E, G=G)},
        sections={"rod": Section(A=A, Iy=INERTIA, Iz=INERTIA, J=J)},
        nodes=[Node(name="root", at=(0.2, 0, 0)), Node(name="tip", at=(0.2, LENGTH, 0))],
        beams=[Beam(name="beam", nodes=("root", "tip"), section="rod", material="steel")],
        fixed=["root"],
        tcp="tip",
    )


def arrays(text: str) -> dict[str, Array]:
    """Return the arrays of a VTU by name."""
    found = {}
    for item in ET.fromstring(text).iter("DataArray"):
        values = np.array((item.text or "").split(), dtype=np.float64)
        width = int(item.get("NumberOfComponents", 1))
        found[item.get("name", item.get("Name", ""))] = values.reshape(-1, width) if width > 1 else values
    return found


def test_a_cantilever_bends_along_its_closed_form_between_the_nodes() -> None:
    force, moment = 700.0, 90.0
    data = arrays(vtu_text(cantilever(), {}, [0, 0, -force, 0, moment, 0]))
    y = data["position"][:, 1]
    # w(y) = -F y^2 (3 L - y) / 6 E I, and the twist M y / G J about y
    np.testing.assert_allclose(
        data["displacement"][:, 2],
        -force * y**2 * (3 * LENGTH - y) / (6 * E * INERTIA),
        rtol=1e-9,
        atol=1e-15,
    )
    np.testing.assert_allclose(data["rotation"][:, 1], moment * y / (G * J), rtol=1e-9, atol=1e-15)
    # and the slope, w' = -F y (2 L - y) / 2 E I, turns about x
    slope = -force * y * (2 * LENGTH - y) / (2 * E * INERTIA)
    np.testing.assert_allclose(data["rotation"][:, 0], slope, rtol=1e-9, atol=1e-15)


def test_the_rotation_of_a_beam_is_the_slope_of_its_displacement() -> None:
    generator = np.random.default_rng(3)
    start, end, first, second = (generator.normal(size=n) for n in (3, 3, 6, 6))
    at, step = np.array([0.0, 0.3, 1.0]), 1e-6
    shape = beam_shape(start, end, first, second, at)
    np.testing.assert_allclose(shape[[0, 2]], [first, second], atol=1e-12)
    length = np.linalg.norm(end - start)
    along = (end - start) / length
    moved = beam_shape(start, end, first, second, at + step) - beam_shape(
        start, end, first, second, at - step
    )
    rate = moved[:, :3] / (2 * step * length)
    np.testing.assert_allclose(
        np.cross(shape[:, 3:], along), rate - (rate @ along)[:, None] * along, rtol=1e-6, atol=1e-6
    )


def test_cells_say_what_they_are_and_where_the_energy_is() -> None:
    robot = Robot(
        name="arm",
        variables=[Variable(name="q1", type="revolute")],
        frames=[Frame(name="f1", theta="q1")],
        nodes=[Node(name="n0"), Node(name="n1", frame="f1"), Node(name="n2", frame="f1", at=(1.0, 0, 0))],
        rigids=[Rigid(name="arm", nodes=("n1", "n2"))],
        joints=[
            Joint(name="J", nodes=("n0", "n1"), frame="f1", stiffness=JointStiffness(torsional="1e5 N*m/rad"))
        ],
        fixed=["n0"],
        tcp="n2",
    )
    data = arrays(vtu_text(robot, {"q1": np.pi / 2}, [-100.0, 0, 0, 0, 0, 0]))
    np.testing.assert_allclose(data["kind"], [1, 2])
    np.testing.assert_allclose(data["energy_share"], [0, 1])
    np.testing.assert_allclose(data["types"], [3, 1])
    np.testing.assert_allclose(data["position"][2], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(data["displacement"][2], [-1e-3, 0, 0], atol=1e-12)


def test_meshio_reads_what_was_written(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    robot = load_robot("ir663")
    write_vtu(robot, {"q2": 0.2, "q8": 0.8}, [0, 0, -900.0, 0, 0, 0], tmp_path / "ir663.vtu", gravity=True)
    mesh = meshio.read(tmp_path / "ir663.vtu")
    assert mesh.point_data["displacement"].shape == mesh.points.shape
    assert {block.type for block in mesh.cells} == {"line", "vertex"}
    assert sum(map(len, mesh.cell_data["kind"])) == sum(len(block.data) for block in mesh.cells)


@pytest.mark.parametrize(
    ("wrench", "point", "message"),
    [([0, 0, 1], None, "six numbers"), ([np.nan] * 6, None, "six numbers"), ([1.0] * 6, "tap", "mean 'tip'")],
)
def test_bad_input_is_refused(wrench: list[float], point: str | None, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        vtu_text(cantilever(), {}, wrench, point=point)
