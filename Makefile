# make install | demo | test | soak | lint | docs | clean; needs make, Python 3.10 to 3.13 with venv, and a package index.
PYTHON ?= python3
WORKERS ?= 2

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: install demo test soak lint tables docs clean

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@echo "installing csm with the versions of constraints.txt into $(VENV); this takes a few minutes, once"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[dev]"
	touch $@

demo: install
	$(BIN)/csm train experiment=demo

lint: install
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

# One thread per process: the workers share the cores already.
test: lint
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --doctest-modules csm tests

# What takes longer than a test should: kills at random moments, a store that is harmed, disks that get full; SOAK=4 does
# four times as much. Then the tests that `make test` leaves out for their length.
SOAK ?= 1
soak: install
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m long -n $(WORKERS) tests
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 CSM_SOAK=$(SOAK) $(BIN)/python -m pytest -x tests/soak/soak_*.py

# The site, into build/site: pages of docs/, and those that are made from the code.
docs: install
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[docs]"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "open build/site/index.html"

# The tables of the README, from the json files under results/.
tables: install
	$(BIN)/python -m tests.readme_tables

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find csm tests data_prep benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +
