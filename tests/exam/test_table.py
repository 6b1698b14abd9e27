import json

from beamstiff.exam.names import NONE, UNKNOWN
from beamstiff.exam.rates import Figure
from beamstiff.exam.table import Row, banded, controls, groups, headline, table_dict
from tests.exam.answered import answered


def test_a_figure_is_held_against_what_is_asked_from_the_right_side() -> None:
    def met(value: float | None, better: str) -> object:
        return Row("", Figure(value, None, None, 1), 0.9, 0.97, better).met

    assert [met(value, "high") for value in (0.97, 0.9, 0.8999, None)] == ["aim", "required", "missed", None]
    low = [Row("", Figure(v, None, None, 1), 0.05, 0.02, "low").met for v in (0.02, 0.05, 0.0501)]
    assert low == ["aim", "required", "missed"]
    assert Row("", Figure(0.5, None, None, 1)).met is None


def test_the_headline_asks_what_the_project_asks() -> None:
    asked = {row.name: (row.required, row.aim) for row in headline([]) if row.required is not None}
    assert sorted(asked.values()) == sorted(
        [
            (0.05, 0.02),  # false alarms
            (0.90, 0.97),  # exact
            (0.97, 0.99),  # family
            (0.97, 0.99),  # set holds the truth
            (0.97, 0.99),  # and of the names given
            (1.8, 1.3),  # its size
            (0.92, 0.97),  # outside
            (0.75, 0.90),  # removed
            (0.65, 0.85),  # pairs: both
            (0.96, 0.98),  # pairs: nothing false
            (0.07, 0.03),  # promises
            (0.05, 0.03),  # calibration
        ]
    )


def test_of_lean_designs_only_false_alarms_and_the_set_are_asked() -> None:
    asked = [row.name for row in headline([], lean=True) if row.required is not None]
    assert asked == ["false alarms on null data", "the same, of verdicts that name an effect"]


def test_cases_are_grouped_by_design_and_rich_ones_by_robot_and_readings() -> None:
    records = [
        answered("none", NONE, robot="kr240-2"),
        answered("none", NONE, robot="ir663", readings=3),
        answered("none", NONE, robot="ir663", readings=3, design="lean"),
    ]
    sizes = {name: len(cases) for name, cases in groups(records).items()}
    assert sizes == {
        "lean, all": 1,
        "rich, all": 2,
        "rich, kr240-2": 1,
        "rich, ir663": 1,
        "rich, 6 components": 1,
        "rich, 3 components": 1,
        "rich, displacement": 2,
        "rich, noise claimed: true": 2,
    }


def test_effects_of_forms_that_the_diagnosis_does_not_know_are_a_group_of_their_own() -> None:
    records = [answered(), answered(author=2), answered("none"), answered(author=2, design="lean")]
    sizes = {name: len(cases) for name, cases in groups(records).items()}
    assert (sizes["rich, all"], sizes["rich, forms of author 1"], sizes["rich, forms of author 2"]) == (
        3,
        1,
        1,
    )
    assert not {"lean, forms of author 1", "lean, forms of author 2"} & set(sizes)


def test_bands_hold_every_single_once() -> None:
    records = [answered("backlash:q3", NONE, gap=gap) for gap in (0.0, 0.29, 0.3, 0.99, 1.0, 2.99, 3.0, 50.0)]
    assert [(band, len(cases)) for band, cases in banded(records)] == [
        ("0 to 0.3", 2),
        ("0.3 to 1", 2),
        ("1 to 3", 2),
        ("above 3", 2),
    ]


def test_controls_stand_beside_the_diagnosis_on_the_same_cases() -> None:
    records = [
        answered("backlash:q3", "backlash:q3", gap=2.0, controls={"bic": "hardening:q3"}),
        answered("backlash:q3", UNKNOWN, gap=0.5, controls={"bic": "backlash:q3"}),
        answered("none", NONE, controls={"bic": "hardening:q3"}),
    ]
    values = {row.name: row.figure.value for row in controls(records)}
    assert values["bic, gap >= 1 sigma"] == 0.0
    assert values["diagnosis, gap >= 1 sigma"] == 1.0
    assert values["bic, 0.3 to 1 sigma"] == 1.0
    assert values["diagnosis, 0.3 to 1 sigma"] == 0.0
    assert values["bic, right on nulls"] == 0.0
    assert values["chance"] == 1.0


def test_the_table_is_plain_data_without_nan() -> None:
    records = [
        answered("backlash:q3", "backlash:q3"),
        answered("none", UNKNOWN, error="ValueError: x"),
        answered("backlash:q3 hardening:q2", "backlash:q3", also=["hardening:q2"]),
    ]
    data = json.loads(json.dumps(table_dict(records), allow_nan=False))
    assert (data["cases"], data["failed"]) == (3, 1)
    assert data["headline"]["all"]["false alarms on null data"]["met"] == "missed"
    assert data["headline"]["rich, all"]["pairs: both"]["value"] == 1.0
    assert data["effects"][0]["effect"] == "backlash"
    assert data["confusion"]["none"] == {"unknown": 1}
    assert json.dumps(table_dict([]), allow_nan=False)
