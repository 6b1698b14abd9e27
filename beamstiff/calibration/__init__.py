"""Geometry, and compliances along with it, from measured absolute positions or poses."""

from beamstiff.calibration.calibrate import calibrate
from beamstiff.calibration.result import Calibration, Errors, Found

__all__ = ["Calibration", "Errors", "Found", "calibrate"]
