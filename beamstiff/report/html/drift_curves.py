"""The course of a drift over time or temperature, where one is among the causes."""

from collections.abc import Iterator

import numpy as np

from beamstiff.diagnosis.drift_course import DRIFT, drift_courses
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.report.diagnosis_tables import course_title
from beamstiff.report.html.charts import along
from beamstiff.report.html.parts import Figure
from beamstiff.report.tables import number
from beamstiff.report.verdict import rounded

PARTS = 24  # of a campaign, each a point of the curve
MARKS = (("circle", "orange"), ("square", "blue"), ("diamond", "green"))


def drift_curves(result: Diagnosis) -> Iterator[Figure]:
    """Yield for each drift what it adds to the readings along x, y and z, part by part of the campaign."""
    for count, course in enumerate(drift_courses(result, PARTS), 1):
        at = course.at[course.ends].mean(axis=1)
        what = "time, s" if course.unit == "s" else "temperature, degC"
        if (np.diff(at) < 0.0).any():  # each table has a clock of its own
            at, what = np.arange(1.0, len(at) + 1.0), "part of the campaign"
        texts = [f"from {number(float(one))} {course.unit}" for one in course.at[course.ends[:, 0]]]
        values = {axis: 1e3 * course.means[:, k] for k, axis in enumerate("xyz")}
        caption = f"{course_title(course)}, along the axes of the base frame; mean of each part. "
        caption += f"Between two parts it moves them by up to {rounded(1e3 * course.travel)} mm."
        yield along(
            f"drift-{count}", f"Course of {DRIFT}", caption, at, values, (what, "mm"), texts, True, MARKS
        )
