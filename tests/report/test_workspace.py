import numpy as np
import pytest
import xarray
from matplotlib.colors import LogNorm

from beamstiff import load_robot, map_workspace, plot
from beamstiff.errors import BeamstiffError
from beamstiff.report.workspace import map_figure
from tests.maps.robots import planar_arm

AXIS = np.linspace(-2.5, 2.5, 11)


def meshes(figure: object) -> list[np.ma.MaskedArray]:
    return [axes.collections[0].get_array() for axes in figure.axes if axes.get_label() != "<colorbar>"]


def crosses(figure: object) -> list[tuple[str, float, float]]:
    return [
        (axes.get_title(), float(line.get_xdata()[0]), float(line.get_ydata()[0]))
        for axes in figure.axes
        for line in axes.lines
        if line.get_marker() == "X"
    ]


def test_a_picture_shows_values_where_they_are_and_marks_the_worst() -> None:
    found = map_workspace(planar_arm(limits=(-2.2, 2.2)), {"q1": [0.0, 1.0, 2.0], "q2": AXIS})
    figure = map_figure(found)
    (mesh,) = meshes(figure)
    np.testing.assert_allclose(np.ma.filled(mesh, np.nan).reshape(3, 11), found.stiffness / 1e3)
    assert mesh.mask.reshape(3, 11)[0].tolist() == (np.abs(AXIS) > 2.2).tolist()
    ((_, q2, q1),) = crosses(figure)
    worst = np.unravel_index(np.nanargmin(found.stiffness), (3, 11))
    assert (np.radians(q1), np.radians(q2)) == pytest.approx((worst[0], AXIS[worst[1]]))
    assert figure.axes[0].get_xlabel() == "q2, deg"
    assert figure.axes[1].get_ylabel() == "stiffness, N/mm"


def test_three_axes_are_slices_with_that_of_the_worst_pose() -> None:
    over = {"q2": np.linspace(0.2, 1.3, 12), "q3": np.linspace(-2, -0.5, 7), "q5": np.linspace(0.2, 1.6, 6)}
    found = map_workspace(load_robot("kr240-2"), over, quantities=["stiffness", "manipulability"])
    figure = map_figure(found, ["stiffness"])
    assert len(meshes(figure)) == 5
    ((title, *_),) = crosses(figure)
    worst = np.unravel_index(np.nanargmin(found.stiffness), found.stiffness.shape)
    assert title == f"q2 = {np.degrees(over['q2'][worst[0]]):.4g} deg"
    assert len(meshes(map_figure(found))) == 10


def test_four_axes_hold_what_lies_between_where_the_worst_pose_is() -> None:
    over = {name: [0.3, 0.6, 0.9] for name in ("q2", "q4", "q5")} | {"q3": [-2.0, -1.0]}
    found = map_workspace(load_robot("kr240-2"), over)
    figure = map_figure(found)
    assert len(meshes(figure)) == 3
    worst = np.unravel_index(np.nanargmin(found.stiffness), found.stiffness.shape)
    held = f"q4 = {np.degrees(over['q4'][worst[1]]):.4g} deg"
    assert any(held in axes.get_ylabel() for axes in figure.axes)


def test_a_condition_that_runs_to_infinity_is_drawn_by_its_logarithm() -> None:
    over = {"q5": np.linspace(-1.0, 1.0, 21) ** 5, "q2": [0.5, 1.0]}
    found = map_workspace(load_robot("kr240-2"), over, quantities=["kappa"], held={"q3": -1.0}, length=0.7)
    assert (
        np.isinf(found.kappa.values[10]).all() or (found.kappa.values[10] > 1e12).all()
    )  # a stretched wrist
    found.kappa.values[10] = np.inf
    figure = map_figure(found)
    norm = figure.axes[0].collections[0].norm
    assert isinstance(norm, LogNorm)
    assert norm.vmax < 1e12
    figure.canvas.draw()


def test_plot_draws_maps_and_no_other_dataset() -> None:
    found = map_workspace(planar_arm(), {"q1": AXIS, "q2": [1.0, 2.0]}, quantities=["stiffness", "dexterity"])
    assert len(meshes(plot(found))) == 2
    assert len(meshes(plot(found, quantities=["dexterity"]))) == 1
    with pytest.raises(BeamstiffError, match="found Dataset"):
        plot(xarray.Dataset({"stiffness": ("q1", [1.0])}))


def test_what_cannot_be_drawn_is_said() -> None:
    found = map_workspace(planar_arm(), {"q1": AXIS, "q2": [1.0, 2.0]}, quantities=["compliance"])
    with pytest.raises(BeamstiffError, match="matrices alone"):
        map_figure(found)
    with pytest.raises(BeamstiffError, match="'compliance' is not drawn"):
        map_figure(found, ["compliance"])


def test_a_map_read_back_draws_the_same(tmp_path: object) -> None:
    found = map_workspace(planar_arm(), {"q1": AXIS, "q2": [1.0, 2.0]}, out=f"{tmp_path}/map.nc")
    with xarray.open_dataset(f"{tmp_path}/map.nc") as read:
        (a,), (b,) = meshes(map_figure(found)), meshes(map_figure(read))
    np.testing.assert_array_equal(a, b)
