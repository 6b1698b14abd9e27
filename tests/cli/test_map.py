import json
from math import pi
from pathlib import Path

import numpy as np
import pytest
import xarray

from tests.cli.conftest import Refused, Run

CRANE = ("map", "crane.yaml", "--grid", "q1=-170deg:170deg:35")


def test_the_map_of_a_crane_holds_its_closed_form(run: Run, folder: Path) -> None:
    """Across the arm 1/radial + 1 m^2/torsional, along it 1/radial, whatever q1."""
    what = ("--quantity", "stiffness,stiffness_along", "--direction", "x")
    result = run(*CRANE, *what, "--out", "map.nc", "--json", "-")
    assert (result.exit_code, result.stderr) == (0, "")
    facts = json.loads(result.stdout)
    across, along = 1 / (1 / 2e6 + 1 / 1e6), 2e6
    told = facts["quantities"]["stiffness"]
    assert [told[key] for key in ("min", "p5", "p50", "p95", "max")] == pytest.approx([across] * 5, rel=1e-9)
    with xarray.open_dataset(folder / "map.nc") as found:
        q1 = found.q1.values
        np.testing.assert_allclose(q1, np.radians(np.linspace(-170, 170, 35)), rtol=1e-14, atol=1e-15)
        expected = 1 / (np.cos(q1) ** 2 / along + np.sin(q1) ** 2 / across)
        np.testing.assert_allclose(found.stiffness_along, expected, rtol=1e-9)
        assert (found.q1.units, found.stiffness.units, found.reason.dtype) == ("rad", "N/m", np.int8)
        assert found.attrs["command"].startswith("beamstiff map crane.yaml --grid q1=-170deg:170deg:35")
        assert len(found.attrs["robot_file_sha256"]) == len(found.attrs["robot_sha256"]) == 64
        assert found.attrs["Conventions"].startswith("CF-")
    worst = facts["quantities"]["stiffness_along"]["worst"]
    assert worst["value"] == pytest.approx(across, rel=1e-9)
    assert abs(worst["at"]["q1"]) == pytest.approx(pi / 2, rel=1e-12)
    assert (facts["poses"], facts["computed"], facts["reasons"]) == (35, 35, {})
    assert sorted(path.name for path in folder.iterdir()) == ["crane.csv", "crane.yaml", "map.nc"]


def test_people_get_a_table_with_units_and_the_worst_pose(succeed: Run) -> None:
    result = succeed(*CRANE, "--quantity", "deflection", "--wrench", "fx=1kN")
    for text in ("35 poses over q1 -170 to 170 deg (35)", "deflection", "mm", "1.5", "q1 = ", "90 deg"):
        assert text in result.stdout
    assert result.stderr == "note: --out FILE.nc keeps the map\n"


def test_poses_without_a_value_are_counted_by_reason(run: Run, told: Run) -> None:
    facts = told("map crane.yaml --grid q1=-180deg:180deg:13")
    assert facts["computed"] == 11
    assert facts["reasons"] == {
        "limits": {"count": 2, "example": "a joint variable would be outside its limits"}
    }
    assert "Poses that lack values" in run("map crane.yaml --grid q1=-180deg:180deg:13").stdout


def test_a_map_of_matrices_alone_has_no_table_of_quantities(run: Run, folder: Path) -> None:
    result = run(*CRANE, "--quantity", "compliance", "--out", "map.nc", "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    with xarray.open_dataset(folder / "map.nc") as found:
        assert found.compliance.dims == ("q1", "motion", "load")
        assert found.compliance.sel(motion="dz", load="fz").values == pytest.approx(
            np.full(35, 1 / 4e6 + 1 / 8e6), rel=1e-9
        )


def test_over_positions_the_orientation_is_held(run: Run, told: Run, folder: Path) -> None:
    held = "--q q2=60deg,q3=-200deg,q5=50deg --orientation b=90deg"
    result = run(f"map kr240-2 --grid x=1.4m:2m:3,z=0.9:1.3:2 {held} --out map.nc --quiet")
    assert (result.exit_code, result.output) == (0, "")
    with xarray.open_dataset(folder / "map.nc") as found:
        assert found.stiffness.dims == ("x", "z")
        assert found.joint.values.tolist() == ["q1", "q2", "q3", "q4", "q5", "q6"]
        turn = np.array(json.loads(found.attrs["orientation"]))
        np.testing.assert_allclose(turn, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)
        assert json.loads(found.attrs["tcp_held"]) == {"y": pytest.approx(0.0, abs=1e-12)}
        q = dict(zip(found.joint.values.tolist(), found.q.values[1, 0].tolist(), strict=True))
    text = ",".join(f"{name}={value!r}" for name, value in q.items() if np.isfinite(value))
    np.testing.assert_allclose(told("stiffness kr240-2 --q", text)["tcp"], [1.7, 0.0, 0.9], atol=1e-8)


def test_zarr_holds_the_same(succeed: Run, folder: Path, refused: Refused) -> None:
    pytest.importorskip("zarr")
    for name in ("map.nc", "map.zarr", "map.zarr"):  # written over, too
        succeed(*CRANE, "--quantity", "stiffness,displacement", "--wrench", "fx=1", "--out", name)
    with (
        xarray.open_dataset(folder / "map.nc") as a,
        xarray.open_zarr(folder / "map.zarr", consolidated=False) as b,
    ):
        for key in ("stiffness", "displacement", "reason", "q1"):
            np.testing.assert_array_equal(a[key].values, b[key].values)
            assert a[key].attrs.get("units") == b[key].attrs.get("units")
        assert b.motion.values.tolist() == ["dx", "dy", "dz", "rx", "ry", "rz"]
    (folder / "mine.zarr").mkdir()
    refused([*CRANE, "--out", "mine.zarr"], "mine.zarr: is a folder and no Zarr")
    written = (path.name for path in folder.iterdir() if path.name.startswith((".", "map")))
    assert sorted(written) == ["map.nc", "map.zarr"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--grid", "q1"], "--grid: found 'q1', expected an axis such as"),
        (["--grid", "q1=0:1"], "--grid: found 'q1=0:1', expected an axis"),
        (["--grid", "q1=0:1:1"], "--grid: q1: found '1' values, expected a number of 2 or more"),
        (["--grid", "q1=0:1:2.5"], "found '2.5' values"),
        (["--grid", "q1=1:0:5"], "expected the lower end first"),
        (["--grid", "q1=0:1mm:5"], "--grid: q1: found the unit 'mm'"),
        (["--grid", "q1=0:nan:5"], "--grid: q1: found 'nan'"),
        (["--grid", "q1=0:1:3,q1=0:1:3"], "q1 is given twice"),
        (["--grid", "q9=0:1:3"], "unknown axis 'q9', expected actuated variables (q1) or x, y, z of the TCP"),
        (["--grid", "q1=0:1:3,x=0:1:3"], "all of them joint variables or all of them x, y, z"),
        (["--grid", "q1=0:1:3", "--q", "q1=0"], "q1 is on an axis of the map and held"),
        (["--grid", "q1=0:1:3", "--quantity", "stifness"], "'stifness' (did you mean 'stiffness'?)"),
        (["--grid", "q1=0:1:3", "--quantity", "sag,sag"], "sag is given twice"),
        (["--grid", "q1=0:1:3", "--quantity", "deflection"], "needs a wrench"),
        (["--grid", "q1=0:1:3", "--quantity", "stiffness_along"], "needs a direction"),
        (["--grid", "q1=0:1:3", "--direction", "w"], "--direction: found 'w'"),
        (["--grid", "q1=0:1:3", "--direction", "0,0,0"], "--direction: found '0,0,0'"),
        (["--grid", "q1=0:1:3", "--length", "0 m"], "--length: found '0 m'"),
        (["--grid", "q1=0:1:3", "--orientation", "a=0"], "an orientation is held over x, y, z alone"),
        (["--grid", "x=0:1:3", "--orientation", "b=90deg"], "cannot hold an orientation"),
        (["--grid", "x=0:1:3", "--orientation", "x=1"], "--orientation: found a position"),
        (["--grid", "x=0:1:3", "--q", "q1=175deg"], "outside its limits"),
        (["--grid", "q1=0:1:3", "--out", "map.csv"], "map.csv: found the ending '.csv', expected .nc"),
        (["--grid", "q1=0:1:3", "--out", "nowhere/map.nc"], "there is no folder"),
        (["--grid", "q1=0:1:3", "--out", "nowhere/map.zarr"], "there is no folder"),
        (["--grid", "q1=0:1:3", "--figure", "map.txt"], "expected a figure as png, svg, pdf"),
        (["--grid", "q1=3:3.1:3"], "no pose of the map has a value: 3 x limits"),
        (["--grid", "x=3:4:3"], "no pose of the map has a value: 3 x out_of_reach"),
        (["--grid", "q1=0:1:9999999,x=0:1:2"], "all of them joint variables"),
        (["--grid", "q1=0:1:99999999"], "found 99999999 values, expected at most"),
        (["--grid", "q1=0:1:3", "--scheduler", "tcp://x:1", "--processes", "2"], "expected one of them"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(refused: Refused, arguments: list[str], told: str) -> None:
    refused(["map", "crane.yaml", *arguments], told)


def test_chunks_of_another_map_are_named(run: Run, folder: Path) -> None:
    parts = folder / "map.nc.parts"
    parts.mkdir()
    (parts / "job.json").write_text('{"format": "beamstiff-map-parts/2", "robot": "another"}')
    result = run(*CRANE, "--out", "map.nc")
    assert result.exit_code == 2
    assert 'map.nc.parts: holds chunks of another map: robot was "another", now' in result.stderr
    (parts / "job.json").unlink()
    (parts / "notes.txt").write_text("mine")
    assert "holds other files" in run(*CRANE, "--out", "map.nc").stderr
    assert (parts / "notes.txt").exists()


def test_a_rigid_robot_is_refused_but_has_a_dexterity(run: Run, succeed: Run, folder: Path) -> None:
    text = (folder / "crane.yaml").read_text().replace("identify: [J1.torsional]\n", "")
    for value in ("4e6 N/m", "2e6 N/m", "1e6 N*m/rad", "8e6 N*m/rad"):
        text = text.replace(f'"{value}"', "rigid")
    (folder / "rigid.yaml").write_text(text)
    assert run("map rigid.yaml --grid q1=0:1:3 --quantity stiffness").exit_code == 2
    result = succeed("map rigid.yaml --grid q1=0:1:3 --quantity kappa --json -")
    assert json.loads(result.stdout)["quantities"]["kappa"]["max"] == pytest.approx(1.0)
