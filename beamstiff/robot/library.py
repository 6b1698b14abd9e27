"""The bundled robots: one YAML file each, found by name."""

from pathlib import Path

from beamstiff.errors import BeamstiffError, listed, suggest

_PACKAGE = Path(__file__).resolve().parents[1]


def robot_names() -> list[str]:
    """Return the names of the robots that come with the package, sorted: what `load_robot` takes."""
    return sorted(path.stem for path in _robots_folder(_PACKAGE).glob("*.yaml"))


def robot_path(name: str) -> Path:
    """Return the YAML file of a robot that comes with the package, one of `robot_names`."""
    names = robot_names()
    if name not in names:
        raise BeamstiffError(
            f"robot {name!r}: no robot of this name comes with beamstiff{suggest(name, names)}; "
            f"there are: {listed(names, most=20)}"
        )
    return _robots_folder(_PACKAGE) / f"{name}.yaml"


def _robots_folder(package: Path) -> Path:
    """Return the folder with the robots' files: inside an installed package, beside it in a checkout."""
    # Inside first: beside an installed package lies site-packages, where `robots` would be someone else's.
    for folder in (package / "robots", package.parent / "robots"):
        if folder.is_dir():
            return folder
    raise BeamstiffError(
        f"{package / 'robots'}: the robots that come with beamstiff are missing, expected a folder of YAML "
        "files; install beamstiff again"
    )
