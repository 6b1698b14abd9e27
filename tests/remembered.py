"""Functions that calculate once what several runs of a command or a script ask of them."""

import pickle
from collections.abc import Callable
from copy import deepcopy
from functools import wraps
from typing import Any


def remembered(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that gives the same result again for arguments that are the same to the byte."""
    known: dict[bytes, Any] = {}

    @wraps(function)
    def once(*arguments: Any, **named: Any) -> Any:
        key = pickle.dumps((arguments, named))
        if key not in known:
            known[key] = function(*arguments, **named)
        return deepcopy(known[key])  # whoever changes it changes its own

    return once
