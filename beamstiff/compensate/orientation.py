"""How robot programs write an orientation; the conventions are those of measured frames."""

from beamstiff.measure.orientation import (
    KUKA,
    LOCKED,
    NORM_TOLERANCE,
    EulerAngles,
    Orientation,
    Quaternion,
    RotationVector,
    RowError,
    ToolAxis,
    named_orientation,
)

__all__ = [
    "KUKA",
    "LOCKED",
    "NORM_TOLERANCE",
    "EulerAngles",
    "Orientation",
    "Quaternion",
    "RotationVector",
    "RowError",
    "ToolAxis",
    "named_orientation",
]
