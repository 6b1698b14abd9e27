"""Open parameters and those of causes in one least squares solution, and what causes move."""

from collections.abc import Sequence

import numpy as np

from beamstiff.diagnosis.decomposition.fit import ROUNDING, build_choice, fit_step
from beamstiff.diagnosis.decomposition.folds import unweighed
from beamstiff.diagnosis.decomposition.forms import Form
from beamstiff.diagnosis.decomposition.open_model import OpenModel, inverse_of
from beamstiff.se3 import Array


def solved(model: OpenModel, chosen: Sequence[Form]) -> tuple[Array, Array]:
    """Return the open parameters and those of the causes, (t + c,), and their covariance, noise as stated.

    The causes first, of what the open parameters leave: what is all but absorbed by these stays what is known
    of it beforehand, however it is shared in the least squares solution of both.
    """
    choice = build_choice(model, chosen)
    step = fit_step(choice, range(len(chosen)))
    used = np.concatenate([step.drives, *step.free])
    size = np.concatenate([np.ones(choice.drives), *(form.sizes for form in chosen)]) / choice.units
    theta, own = np.zeros(used.size), np.zeros((used.size, used.size))
    theta[used] = step.theta
    root = np.linalg.inv(step.triangle)
    own[np.ix_(used, used)] = root @ root.T
    theta, own = theta / size, own / np.outer(size, size)
    seen = np.linalg.norm(model.drives, axis=0)
    # a drive that no load turns stays as it is: beside nothing that it moves, rounding would make it anything
    seen = seen > ROUNDING * seen.max(initial=0.0)
    theta[: choice.drives] = np.where(seen, theta[: choice.drives] - model.present, 0.0)
    opened = inverse_of(model.geometry)
    toward = opened @ np.concatenate([model.drives, *(form.columns for form in chosen)], axis=1)
    change = opened @ model.residual - toward @ theta
    covariance = np.block(
        [[opened @ opened.T + toward @ own @ toward.T, -toward @ own], [-own @ toward.T, own]]
    )
    return np.concatenate([change, theta]), covariance


def gap_with(model: OpenModel, chosen: Sequence[Form]) -> Array:
    """Return measured minus predicted, (N, 6), m and rad, with some causes and all that is open fitted.

    Without a cause: what a calibration by itself leaves. 0 where nothing was measured.
    """
    columns = np.concatenate([model.tangent, *(form.columns for form in chosen)], axis=1)
    left = (model.residual - columns @ solved(model, chosen)[0])[: model.count]
    result = np.zeros(model.used.shape)
    result[model.used] = unweighed(model, left)
    return result
