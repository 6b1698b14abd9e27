import subprocess
import sys
from pathlib import Path

import pytest

import beamstiff


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
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("name", sorted(set(beamstiff.__all__) - {"__version__"}))
def test_no_folder_or_module_of_the_package_hides_a_public_name(name: str) -> None:
    folder = Path(beamstiff.__file__).parent
    assert not (folder / name).exists()
    assert not (folder / f"{name}.py").exists()
