"""Several models of the same data side by side: information criteria, likelihood of what was held out.

With the likelihood L of the whitened Gaussian residual, p free values and n measured components::

    AIC = 2 p - 2 log L        AICc = AIC + 2 p (p + 1) / (n - p - 1)        BIC = p log n - 2 log L

(Akaike 1974; Hurvich and Tsai 1989; Schwarz 1978; Burnham and Anderson, "Model selection and multimodel
inference", 2002). Where no noise is stated its size is one more value that is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.identification.identify import ROUNDS
from beamstiff.identification.minimise import minimise
from beamstiff.identification.problem import Problem
from beamstiff.identification.statement import Statement
from beamstiff.identification.validation import held_out, position_rms, without_folds
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Score:
    """What one model is worth.

    Attributes
    ----------
    count : int
        Values fitted; of parameters that only act together, the combinations that are known.
    aic, aicc, bic : float
        AICc is infinite where there are too few measured components for it.
    weight : float
        Akaike weight, from AICc, among the models compared.
    held_out : float or None
        Log-likelihood of the rows of poses left out of the fit, all folds together; None with fewer than
        three poses, or too little left to fit.
    rms : float, m
        Root mean square of the position residual over the fitted rows.
    rms_held_out, rms_held_out_load : float or None, m
        The same on poses, and on loads, left out of the fit.
    stiffness : (m,) array
    """

    name: str
    count: int
    log_likelihood: float
    aic: float
    aicc: float
    bic: float
    weight: float
    held_out: float | None
    rms: float
    rms_held_out: float | None
    rms_held_out_load: float | None
    stiffness: Array


@dataclass(frozen=True)
class Comparison:
    """Models of the same data.

    Attributes
    ----------
    scores : tuple of Score
        In the order given.
    components : int
        Measured components n.
    source : str
        The data.
    """

    scores: tuple[Score, ...]
    components: int
    source: str

    def __getitem__(self, name: str) -> Score:
        """Return the score of a model."""
        by_name = {score.name: score for score in self.scores}
        if name not in by_name:
            raise BeamstiffError(f"there is no model {name!r}{suggest(name, by_name)}")
        return by_name[name]

    @property
    def best(self) -> Score:
        """The model that says most of data it did not see; by AICc where nothing could be left out."""
        if all(score.held_out is not None for score in self.scores):
            return max(self.scores, key=lambda score: score.held_out or 0.0)
        return min(self.scores, key=lambda score: score.aicc)


def compare(models: Mapping[str, Statement], folds: int = 5) -> Comparison:
    """Fit several models to the same data and compare them.

    Parameters
    ----------
    models : mapping of str to Statement
        By name, each from `state_identification` with the same measurements: other robots, other parameters,
        ties, or errors of the inputs.
    folds : int
        Of the poses, and of the loads, held out.

    Examples
    --------
    >>> from beamstiff import load_robot
    >>> from beamstiff.identification.statement import state_identification
    >>> from beamstiff.measure import make_measurements
    >>> from beamstiff.model.linear import predict_displacements
    >>> robot, random = load_robot("kr240-2"), np.random.default_rng(0)
    >>> q, wrench = random.uniform(-1, 1, (12, 6)), random.normal(size=(12, 6)) * 800
    >>> names = [variable.name for variable in robot.actuated]
    >>> noise = {"tcp": robot.tcp, "sigma_position": 3e-5}
    >>> still = make_measurements(names, q, wrench=wrench, **noise)
    >>> seen = predict_displacements(robot, still)[:, :3] + 3e-5 * random.normal(size=(12, 3))
    >>> table = make_measurements(names, q, wrench=wrench, displacement=seen, **noise)
    >>> found = compare(
    ...     {
    ...         "five drives": state_identification(robot, table, robot.identify[:5]),
    ...         "wrist as published": state_identification(robot, table, robot.identify[:3]),
    ...     }
    ... )
    >>> [score.count for score in found.scores]
    [5, 3]
    """
    if not models:
        raise BeamstiffError("compare: found no model, expected one or more")
    names = list(models)
    first = models[names[0]].problem
    for name in names:
        problem = models[name].problem
        if models[name].loss != "linear":
            raise BeamstiffError(
                f"compare: found the loss {models[name].loss!r} in {name!r}, expected least squares, which "
                "has a likelihood"
            )
        same = (
            np.array_equal(problem.used, first.used)
            and np.array_equal(problem.measured, first.measured)
            and np.array_equal(problem.sigma, first.sigma)
            and np.array_equal(problem.sharing, first.sharing)
            and problem.sigma_known == first.sigma_known
        )
        if not same:
            raise BeamstiffError(
                f"compare: {listed([names[0], name])} are of different data or noise, expected the same "
                "components of the same rows"
            )
    scores = [_score(name, statement, folds) for name, statement in models.items()]
    least = min(score.aicc for score in scores)
    if not np.isfinite(least):
        return Comparison(tuple(scores), first.count, first.source)
    share = np.array([np.exp(-0.5 * (score.aicc - least)) for score in scores])
    weights = (share / share.sum()).tolist()
    return Comparison(
        tuple(replace(score, weight=weight) for score, weight in zip(scores, weights, strict=True)),
        first.count,
        first.source,
    )


def _score(name: str, statement: Statement, folds: int) -> Score:
    theta = minimise(statement.objective).theta
    for _ in range(ROUNDS if statement.response is not None else 0):
        statement = statement.weighed(statement.parameters.stiffness(theta))
        theta = minimise(statement.objective, begin=theta).theta
    problem, objective = statement.problem, statement.objective
    stiffness = statement.parameters.stiffness(theta)
    n, squares = problem.count, float((problem.residuals(stiffness) ** 2).sum())
    variance = 1.0 if problem.sigma_known else squares / n
    count = theta.size + (not problem.sigma_known)
    value = log_likelihood(problem, stiffness, variance)
    aic = 2 * count - 2 * value
    correction = 2 * count * (count + 1) / (n - count - 1) if n > count + 1 else np.inf
    unseen: float | None = 0.0
    try:
        for out, test, without in without_folds(objective, problem.pose, folds, theta):
            there = statement.parameters.stiffness(without)
            if not problem.sigma_known:
                rest = problem.rows(~out)
                own = float((rest.residuals(there) ** 2).sum())
                variance = own / max(rest.count - theta.size, 1)
            unseen = (unseen or 0.0) + log_likelihood(test, there, variance)
    except BeamstiffError:
        unseen = None
    by_pose, by_load = (held_out(objective, groups, folds, theta) for groups in (problem.pose, problem.load))
    return Score(
        name=name,
        count=count,
        log_likelihood=value,
        aic=aic,
        aicc=aic + correction,
        bic=count * float(np.log(n)) - 2 * value,
        weight=np.nan,
        held_out=unseen,
        rms=position_rms(problem, stiffness),
        rms_held_out=None if by_pose is None else by_pose.rms,
        rms_held_out_load=None if by_load is None else by_load.rms,
        stiffness=stiffness,
    )


def log_likelihood(problem: Problem, stiffness: Array, variance: float = 1.0) -> float:
    """Return the logarithm of the density of the measured components, by a multivariate normal distribution.

    Parameters
    ----------
    stiffness : (m,) array
    variance : float
        Of the whitened residuals: 1 where the noise is as stated.
    """
    residuals = problem.residuals(stiffness)
    determinant = problem.whitening.log_determinant()
    scale = max(variance, np.finfo(float).tiny)
    squares = float(residuals @ residuals) / scale
    return determinant - 0.5 * (squares + residuals.size * float(np.log(2 * np.pi * scale)))
