# Every target sets up what it needs: `make demo` and `make test` work on a fresh clone.
# Needs make and Python 3.11 or newer as `python3`; another one: make PYTHON=python3.12 test

PYTHON ?= python3
JOBS ?= 2
PYTEST_ARGS ?=
BIN := .venv/bin
STAMP := .venv/.installed

# The package's linear algebra is many small matrices: threads inside BLAS only get in the way of JOBS.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: venv demo test slow lint clean

venv: $(STAMP)

$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "beamstiff needs Python 3.11 or newer, $(PYTHON) is not: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

demo: venv
	$(BIN)/python examples/demo.py

test: venv
	$(BIN)/python -m pytest -n $(JOBS) $(PYTEST_ARGS)

slow: venv
	$(BIN)/python -m pytest -n $(JOBS) -m slow $(PYTEST_ARGS)

lint: venv
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict beamstiff
	$(BIN)/lint-imports

clean:
	rm -rf .venv build dist .pytest_cache .hypothesis .mypy_cache .ruff_cache .import_linter_cache examples/out
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
