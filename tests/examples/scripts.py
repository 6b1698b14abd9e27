"""Examples run as scripts, but in this process: what they import is loaded already."""

import io
import runpy
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SIBLING = "geometric_calibration"  # which another example imports, with the shared data that it was told


def run_script(name: str, *arguments: Path | str, **environment: str) -> str:
    """Return what an example prints; nothing on stderr, and it ends well."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patched, redirect_stdout(out), redirect_stderr(err):
        patched.setattr(sys, "argv", [name, *map(str, arguments)])
        patched.syspath_prepend(EXAMPLES)
        for key, value in environment.items():
            patched.setenv(key, value)
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    sys.modules.pop(SIBLING, None)
    assert err.getvalue() == ""
    return out.getvalue()
