"""Geometry, and compliances along with it, from measured absolute positions or poses."""

from beamstiff.identify.geometry.calibration import calibrate
from beamstiff.identify.geometry.result import Calibration, Errors, Found

__all__ = ["Calibration", "Errors", "Found", "calibrate"]
