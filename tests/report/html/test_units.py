import re

import numpy as np
import pytest

from beamstiff.diagnosis.result import Diagnosis
from tests.report.html.test_page import Outline


def test_joints_of_a_page_are_in_degrees_as_its_figures_are(
    diagnosed: Diagnosis, diagnosis_page: str
) -> None:
    text = diagnosis_page.split("<script", 1)[0]
    assert "rad or m" not in diagnosis_page
    for k, variable in enumerate(diagnosed.baseline.nominal.actuated):
        assert variable.kind == "angle"
        q = np.degrees(diagnosed.baseline.rows.q[:, k])
        if np.ptp(q) == 0:
            continue
        table = text[text.index(f"{variable.name}, deg") :].split("</table>", 1)[0]
        ends = [float(end) for end in re.findall(r"-?\d+(?:\.\d+)?(?= to|<)", table)]
        assert min(ends) == pytest.approx(q.min(), rel=1e-3)


def test_none_and_unknown_are_among_the_bars(diagnosis_page: str) -> None:
    bars = Outline(diagnosis_page).scripts["figures"]
    assert '"none"' in bars
    assert '"unknown"' in bars
