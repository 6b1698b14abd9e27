"""The benchmark of maps measures what it says, on a small map."""

import pytest

from benchmarks import map_scaling


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every map take a hundredth of a millisecond a pose."""

    def cost(
        work: dict[str, object], processes: int, scheduler: str | None = None
    ) -> tuple[map_scaling.Cost, float]:
        poses = 1
        for axis in work["over"].values():
            poses *= len(axis)
        wall = 1e-5 * poses / processes
        return map_scaling.Cost(wall, 1e-5 * poses, 0.0 if processes == 1 else 1e-5 * poses), 1.0

    def on_workers(work: dict[str, object], workers: int, _: int) -> tuple[map_scaling.Cost, float]:
        return cost(work, workers)

    monkeypatch.setattr(map_scaling, "cost", cost)
    monkeypatch.setattr(map_scaling, "_on_workers", on_workers)


@pytest.mark.usefixtures("small")
def test_growth_and_speed_up_are_judged_by_what_was_asked() -> None:
    head, *rows = map_scaling.growth(100_000, 1)
    assert [row[0] for row in rows] == ["10,000", "100,000"]
    assert float(rows[-1][3]) == pytest.approx(1.0, abs=0.002)
    assert rows[-1][4].endswith("reached")
    head, *rows = map_scaling.speed_up(map_scaling.over_joints(10_000), 4, 1)
    assert {len(row) for row in rows} == {len(head)}
    assert [row[2:4] for row in rows] == [("1", "1"), ("2.00", "1.00"), ("4.00", "1.00")]
    assert rows[-1][4] == ">= 0.8: reached"
    head, row = map_scaling.over_cluster({"joints": map_scaling.over_joints(10_000)}, 4, 1)
    assert len(row) == len(head)
    assert row[3:] == ("4.00", "1.00", ">= 0.8: reached")


def test_both_maps_have_a_value_at_every_pose() -> None:
    for work in (map_scaling.over_joints(36), map_scaling.over_positions(8)):
        told, total = map_scaling.cost(work, 1)
        assert told.wall > 0
        assert total > 0
        assert map_scaling.cost(work, 1)[1] == total
