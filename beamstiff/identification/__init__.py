"""What fits the model to measurements, with its uncertainty and what cannot be known."""

from beamstiff.identification.pareto import Front, pareto_front

__all__ = ["Front", "pareto_front"]
