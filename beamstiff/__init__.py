"""beamstiff: why the real robot does not do what the model says."""

from beamstiff.errors import BeamstiffError

__all__ = ["BeamstiffError"]
