# Every target sets up what it needs: `make demo` and `make test` work on a fresh clone.
# Needs make and Python 3.11 or newer. Another Python: make PYTHON=/path/to/python3.12 test

PYTHON ?= $(shell for python in python3 python3.13 python3.12 python3.11; do \
	$$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$python && break; done)
JOBS ?= 2
PYTEST_ARGS ?=
BIN := .venv/bin
STAMP := .venv/.installed
DOCS_STAMP := .venv/.installed-docs

# Many small matrices: threads inside the linear algebra would only get in the way of JOBS.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: venv demo readme test slow figures lint docs pictures clean

venv: $(STAMP)

# A broken .venv (no pip in it: set-up was interrupted) is made anew.
$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "beamstiff needs Python 3.11 or newer, found none: make PYTHON=... $(MAKECMDGOALS)"; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear .venv \
		|| { echo "cannot make a virtual environment (on Debian and Ubuntu: apt install python3-venv)"; exit 1; }
	@echo "Installing beamstiff and its tools in .venv (a minute or two)"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: venv
	$(BIN)/beamstiff demo

# docs/demo.md shows what the demo prints.
readme: venv
	$(BIN)/python -m tests.cli.demo_text

test: venv
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal $(PYTEST_ARGS)

slow: venv
	$(BIN)/python -m pytest -n $(JOBS) -m slow $(PYTEST_ARGS)

# What the core must show: target and result.
figures: venv
	$(BIN)/python -m benchmarks.core_figures

# All four, whatever the first ones say.
lint: venv
	@failed=0; \
	for check in "ruff check ." "ruff format --check ." "mypy --strict beamstiff" "lint-imports"; do \
		echo "$$check"; $(BIN)/$$check || failed=1; \
	done; exit $$failed

# The pages of docs/ as build/docs/index.html; a warning is a fault.
docs: $(DOCS_STAMP)
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet --fresh-env docs build/docs

$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

# The pictures that docs/ shows.
pictures: venv
	$(BIN)/python -m docs.pictures

clean:
	rm -rf .venv build dist .pytest_cache .hypothesis .mypy_cache .ruff_cache .import_linter_cache examples/output
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
