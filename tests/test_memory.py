"""Memory grows with the rows of a table, not with their square."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import identify, load_robot
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.identification.whitening import whitening
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.description import Robot

FEW, MANY, MOST = 1_000, 2_000, 2.5  # rows, and how much more memory twice as many may take

LEFT_OUT = sorted(set(EFFECTS) - {"backlash", "load-error"})  # few columns are weighed, of as many rows


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Return an arm of which one drive alone gives way, so that few effects are weighed."""
    whole = load_robot("kr240-2")
    stiff = {name: np.inf for name in whole.identify if name != "J2.torsional"}
    return whole.with_parameters(stiff).model_copy(update={"identify": ("J2.torsional",)})


def table(robot: Robot, rows: int, a_posture: int, shared: bool = False) -> Measurements:
    """Return noisy readings of so many rows, so many in each posture."""
    rng = np.random.default_rng(0)
    number = np.arange(rows) // a_posture
    q = rng.uniform(-1, 1, (number[-1] + 1, 6))[number]
    wrench = rng.normal(size=(rows, 6)) * [500, 500, 500, 0, 0, 0]
    names = [variable.name for variable in robot.actuated]
    nothing = np.full((rows, 6), np.nan)
    nothing[:, :3] = 0.0
    still = make_measurements(
        names, q, tcp=robot.tcp, wrench=wrench, displacement=nothing, sigma_position=3e-5, pose=number
    )
    seen = predict_displacements(robot, still) + 3e-5 * rng.standard_normal((rows, 6))
    metadata = {"unloaded_reading": "shared"} if shared else {}
    return replace(still, displacement=seen + nothing, metadata=metadata)


def peak(work: Callable[[], object]) -> int:
    """Return the most memory, B, that Python and numpy hold during some work."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def grown(work: Callable[[int], Callable[[], object]]) -> float:
    """Return by how much the memory of some work grows with the rows."""
    work(FEW)()  # what is loaded and kept the first time does not count
    return peak(work(MANY)) / peak(work(FEW))


@pytest.mark.parametrize(("a_posture", "shared"), [(5, False), (5, True), (MANY, True)])
def test_identification_of_twice_the_rows_takes_twice_the_memory(a_posture: int, shared: bool) -> None:
    robot = load_robot("kr240-2")

    def work(rows: int) -> Callable[[], object]:
        data = table(robot, rows, min(a_posture, rows), shared)
        return lambda: identify(robot, data, folds=0)

    assert grown(work) < MOST


@pytest.mark.slow
@pytest.mark.parametrize("a_posture", [5, MANY])
def test_diagnosis_of_twice_the_rows_takes_twice_the_memory(robot: Robot, a_posture: int) -> None:
    def work(rows: int) -> Callable[[], object]:
        data = table(robot, rows, min(a_posture, rows))
        return lambda: diagnose(robot, data, without=LEFT_OUT)

    assert grown(work) < MOST


def test_a_shared_reading_is_whitened_as_its_covariance_says() -> None:
    sigma = np.random.default_rng(1).uniform(1, 2, (7, 6))
    used = np.ones((7, 6), dtype=np.bool_)
    used[2, 1] = used[5] = False
    sharing = np.array([0, 0, 0, -1, 4, 4, -1])
    white = whitening(sigma, used, sharing)
    row, component = np.nonzero(used)
    same = (component[:, None] == component) & (sharing[row][:, None] == sharing[row]) & (sharing[row] >= 0)
    alone = np.eye(row.size)
    covariance = np.where(same, 0.5 * (1 + alone), alone) * np.outer(sigma[used], sigma[used])
    matrix = white.toarray()
    np.testing.assert_allclose(matrix @ covariance @ matrix.T, alone, atol=1e-12)
    np.testing.assert_allclose(
        matrix @ white.solve(np.arange(1.0, 1 + row.size)), np.arange(1.0, 1 + row.size)
    )
    np.testing.assert_allclose(white.among(np.array([[0, 5], [6, 10]]))[1], matrix[np.ix_([6, 10], [6, 10])])
