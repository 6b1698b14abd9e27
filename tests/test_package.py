import subprocess
import sys
from pathlib import Path

import pytest

import beamstiff


def in_a_fresh_process(script: str) -> str:
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("name", beamstiff.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(beamstiff, name)
    assert name == "__version__" or value.__doc__
    assert name in dir(beamstiff)


def test_an_unknown_name_is_no_attribute() -> None:
    with pytest.raises(AttributeError, match=r"beamstiff.*'identity'"):
        _ = beamstiff.identity


def test_importing_the_package_brings_no_heavy_library() -> None:
    script = (
        "import sys, beamstiff; print(sorted({'numpy', 'scipy', 'pandas', 'pydantic'} & set(sys.modules)))"
    )
    assert in_a_fresh_process(script) == "[]\n"


@pytest.mark.parametrize(
    "first",
    [
        "from beamstiff import identify",
        "import beamstiff.identification; identify = beamstiff.identify",
        "import beamstiff.identification.identify; from beamstiff import identify",
        "from beamstiff.identification.identify import identify as fit; from beamstiff import identify",
    ],
)
def test_identify_is_the_function_whatever_comes_first(first: str) -> None:
    script = f"{first}\nimport beamstiff.identification.result as r\nprint(callable(identify), r.__name__)"
    assert in_a_fresh_process(script) == "True beamstiff.identification.result\n"


@pytest.mark.parametrize("name", sorted(set(beamstiff.__all__) - {"__version__"}))
def test_no_folder_or_module_of_the_package_hides_a_public_name(name: str) -> None:
    folder = Path(beamstiff.__file__).parent
    assert not (folder / name).exists()
    assert not (folder / f"{name}.py").exists()
