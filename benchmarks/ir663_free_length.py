"""What screws by their free length leave on the IR-663's values: ``python -m benchmarks.ir663_free_length``.

The twelve displacements along x under 900 N of the paper's table 4, the coupler's spring identified with each
model and compliances no less than nothing. Screws are those of `ir663-screws` (their places are ours), 50 mm
thick where `EA` is given: ``1/k + (L - fixed) / EA`` of length L, with a bearing at one end and the nut where
it stands; the tube between nut and lug is the fixed length. Displacements are linear in the compliances here,
for statics gives the forces in the screws.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import lsq_linear

from beamstiff import Robot, identify, load_robot, read_measurements
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.robot.parts import Strut
from beamstiff.se3 import Array

DATA = Path(__file__).parents[1] / "examples" / "data" / "ir663_compliance_xx.csv"
PAPER = 0.110  # mm, table 5: its parametric model, over its own readings
SCREW = 210e9 * np.pi * 0.025**2  # N
TUBE = 0.300  # m, as in ir663-screws-beams
COUPLER = "J1010.radial"


def lengths(q: Array) -> Array:
    """Return the lengths of both screws (P, 2), m, at angles (P, 2) of axes 2 and 8: law of cosines."""
    between = np.radians([115.0 + 160.0, 147.5 + 170.0]) - q  # see ir663-screws.yaml
    lug, bracket = np.array([0.220, 0.250]), 0.750
    return np.asarray(np.sqrt(lug**2 + bracket**2 - 2 * lug * bracket * np.cos(between)))


def on_screws(screws: Robot, measured: Measurements) -> Measurements:
    """Return the same readings over the lengths of the screws."""
    return make_measurements(
        ["r2", "r8"],
        lengths(measured.q),
        tcp=screws.tcp,
        wrench=measured.wrench,
        displacement=measured.displacement,
        sigma_position=measured.sigma_position,
    )


def left(columns: Array, wanted: Array) -> tuple[float, float, Array]:
    """Return the RMS that is left, fitted and on values left out, mm, and the compliances (m,)."""
    size = np.abs(columns).max(axis=0)

    def fit(rows: Array) -> Array:
        return np.asarray(lsq_linear(columns[rows] / size, wanted[rows], (0.0, np.inf), tol=1e-14).x / size)

    every = np.arange(len(wanted))
    best = fit(every)
    tested = [wanted[at] - columns[at] @ fit(np.delete(every, at)) for at in every]
    rms = (1e3 * float(np.sqrt(np.mean(np.square(gap)))) for gap in (wanted - columns @ best, tested))
    return (*rms, best)


def with_free_lengths(screws: Robot, EA: float, fixed: float) -> Robot:
    """Return the robot with the length of its screws giving way."""
    struts = (Strut(**{**dict(strut), "EA": EA, "fixed_length": fixed}) for strut in screws.struts)
    return screws.model_copy(update={"struts": tuple(struts)})


def main() -> None:
    """Print the table."""
    springs, screws = load_robot("ir663"), load_robot("ir663-screws")
    measured = read_measurements(DATA, springs)
    rows = on_screws(screws, measured)
    wanted = measured.displacement[:, 0]
    print(f"{'mm RMS over the 12 published values':52}{'fitted':>8}{'left out':>10}  compliances, SI")

    def told(name: str, columns: Array, clamped: Array) -> float:
        fitted, tested, found = left(columns, wanted - clamped)
        print(f"{name:52}{fitted:8.3f}{tested:10.3f}  {', '.join(f'{value:.2e}' for value in found)}")
        return fitted

    def parts(robot: Robot, table: Measurements, names: tuple[str, ...]) -> tuple[Array, Array]:
        model = reduce_to_ports(robot, table, names)
        assert model.by_compliance is not None
        return model.by_compliance[:, 0], model.clamped[:, 0]

    told(
        "constant springs about axes 2 and 8",
        *parts(springs, measured, ("J12.torsional", "J18.torsional", COUPLER)),
    )
    names = ("screw2", "screw8", COUPLER)
    columns, clamped = parts(screws, rows, names)
    told("screws, constant", columns, clamped)
    for fixed in (0.0, TUBE, 0.5):
        own = columns * np.concatenate([rows.q - fixed, np.ones((len(rows), 1))], axis=1)
        told(f"screws, their free length alone (fixed {1e3 * fixed:.0f} mm)", own, clamped)
    both = np.concatenate([columns, columns[:, :2] * (rows.q - TUBE)], axis=1)
    told(f"bearing and nut, and free length (fixed {1e3 * TUBE:.0f} mm)", both, clamped)
    for name, EA in (("50 mm screws", SCREW), ("a tenth as stiff", 0.1 * SCREW)):
        robot = with_free_lengths(screws, EA, TUBE)
        fitted = told(f"struts with EA and fixed length, {name}", *parts(robot, rows, names))
        again = 1e3 * identify(robot, rows, names).rms
        assert abs(again - fitted) < 1e-3, "identify finds another: it is the same model"
    print(f"{'the paper, constant springs, over its own readings':52}{PAPER:8.3f}")


if __name__ == "__main__":
    main()
