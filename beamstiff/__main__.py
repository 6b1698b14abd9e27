"""`python -m beamstiff`: the command line where scripts are not on the path."""

from beamstiff.cli.main import app

if __name__ == "__main__":
    app(prog_name="beamstiff")
