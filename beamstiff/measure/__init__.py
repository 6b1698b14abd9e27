"""What was seen: measurement tables, and what is computed from raw readings before they become one."""

from beamstiff.measure.plausibility import doubts
from beamstiff.measure.points import (
    PointDisplacement,
    displacement_from_points,
    frame_from_points,
    subtract_sensor_deflection,
)
from beamstiff.measure.reader import parse_measurements, read_measurements
from beamstiff.measure.registration import Registration, register
from beamstiff.measure.rows import concatenate, history_order, subset
from beamstiff.measure.samples import (
    AveragedStates,
    average_samples,
    difference_of_states,
)
from beamstiff.measure.swapped_labels import mend_labels
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.measure.wrench import (
    transport_wrench,
    wrench_from_dead_weight,
    wrench_from_force,
    wrench_from_sensor,
)
from beamstiff.measure.writer import measurements_to_csv, write_measurements

__all__ = [
    "AveragedStates",
    "Measurements",
    "PointDisplacement",
    "Registration",
    "average_samples",
    "concatenate",
    "difference_of_states",
    "displacement_from_points",
    "doubts",
    "frame_from_points",
    "history_order",
    "make_measurements",
    "measurements_to_csv",
    "mend_labels",
    "parse_measurements",
    "read_measurements",
    "register",
    "subset",
    "subtract_sensor_deflection",
    "transport_wrench",
    "wrench_from_dead_weight",
    "wrench_from_force",
    "wrench_from_sensor",
    "write_measurements",
]
