"""Causes and remainder as plain data, for the report's JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition
from beamstiff.diagnosis.effects import Quantity


def parameters_of(cause: Cause) -> Iterator[tuple[str, Quantity, float, float, tuple[float, float]]]:
    """Yield name, quantity, value, standard deviation and realistic sizes of each parameter, SI."""
    told = Counter(item.name for form in cause.forms for item in form.shape.parameters)
    for at, (form, theta, std) in enumerate(zip(cause.forms, cause.theta, cause.std, strict=True)):
        sizes = zip(*(ends.tolist() for ends in form.realistic), strict=True)
        every = zip(form.shape.parameters, theta.tolist(), std.tolist(), sizes, strict=True)
        for item, value, error, realistic in every:
            name = f"{item.name}_{at + 1}" if told[item.name] > 1 else item.name
            yield name, item, value * item.size, error * item.size, realistic


def causes_dict(found: Decomposition) -> dict[str, Any]:
    """Return the keys ``causes`` and ``remainder``."""
    remainder = found.remainder
    return {
        "causes": [_cause(found, cause) for cause in found.causes],
        "remainder": {
            "rms_mm": 1e3 * remainder.rms,
            "share": remainder.share,
            "follows": [{"what": what, "share": share} for what, share in remainder.follows],
            "where": [{"component": name, "share": share} for name, share in remainder.where],
            "unclear": [
                {"one_of": [cause.key, *cause.indistinguishable], "closes": cause.closes}
                for cause in found.unclear
            ],
            "outside_library": [_law(found, law) for law in found.unmodelled],
        },
    }


def _law(found: Decomposition, law: Cause) -> dict[str, Any]:
    """Return a law outside the library; `lifts_at`, of a base that opens, is rad from its x axis about z."""
    if not law.nameless:
        return {"what": law.looks_like, **_cause(found, law)}
    more: dict[str, Any] = {} if law.lifted_side is None else {"lifts_at": law.lifted_side}
    if law.past:
        more["when"] = law.shape
    return {"what": law.forms[0].component, "closes": law.closes, **more}


def _cause(found: Decomposition, cause: Cause) -> dict[str, Any]:
    form = cause.forms[0]
    parameters: dict[str, Any] = {
        name: {"value": value, "std": std, "unit": item.unit}
        for name, item, value, std, _ in parameters_of(cause)
    }
    if cause.rows:
        parameters["rows"] = [found.model.baseline.rows.place(row) for row in cause.rows]
    return {
        "effect": form.effect,
        "component": form.component,
        "probability": cause.probability,
        "closes": min(cause.closes, 1.0),  # of held-out squares more than all may close
        "closes_interval": [min(end, 1.0) for end in cause.closes_interval],
        "rms_after_mm": 1e3 * cause.rms_after,
        "parameters": parameters,
        "shape": cause.shape,
        "indistinguishable": list(cause.indistinguishable),
        "found_again": cause.found_again,
    }
