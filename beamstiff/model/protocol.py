"""What every model of elasticity offers: the displacement of the TCP under a wrench, in any posture."""

from dataclasses import dataclass
from typing import Protocol

from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


class Model(Protocol):
    """A model ``d(q, w)``: structural, fuzzy, gridded, corrected by a Gaussian process, or rigid."""

    def predict(self, q: Array, wrench: Array) -> Array:
        """Return the displacement of the TCP in every row, loaded minus unloaded.

        Parameters
        ----------
        q : (N, n) array
            Actuated joint values in the order of `Robot.actuated`, rad or m.
        wrench : (N, 6) array
            ``[f, m]`` at the TCP, base frame, N and N m.

        Returns
        -------
        (N, 6) array
            ``[d, r]``, base frame, m and rad.

        Raises
        ------
        BeamstiffError
            Where the model has no answer.
        """


@dataclass(frozen=True)
class StructuralModel:
    """The robot's own beams and joints as a `Model`."""

    robot: Robot
    preload: bool = False

    def predict(self, q: Array, wrench: Array) -> Array:
        """Return the (N, 6) displacements of `beamstiff.model.linear.predict_displacements`."""
        names = [variable.name for variable in self.robot.actuated]
        rows = make_measurements(names, q, tcp=self.robot.tcp, wrench=wrench)
        return predict_displacements(self.robot, rows, self.preload)


@dataclass(frozen=True)
class RigidModel:
    """The robot that is not compliant: what every other model is compared with."""

    def predict(self, q: Array, wrench: Array) -> Array:  # noqa: ARG002 (the protocol's)
        """Return zeros, one row each wrench."""
        return 0.0 * wrench
