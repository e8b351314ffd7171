# One door for every check. `make demo` and `make test` set up all they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: help demo test test-fast browser check lint types floors fix bench clean

help:  ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || (echo "Python 3.11 or newer is needed: make PYTHON=python3.11 ..." && false)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[dev]'
	$(BIN)/python -c 'import open3d' >/dev/null 2>&1 || scripts/install_system_libraries.sh
	touch $(READY)

demo: $(READY)  ## render a room, match, refine, fuse, and show what changed
	$(BIN)/resdepth-colmap demo --output demo

test: $(READY) browser  ## the whole suite
	$(BIN)/pytest

test-fast: $(READY)  ## the suite without its slow tests
	$(BIN)/pytest -m "not slow"

browser:  # the report is tested in a Chromium; those tests skip where there is none
	@scripts/install_chromium.sh

check: lint types floors test  ## all that must be green

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

floors: $(READY)
	$(BIN)/lint-imports

fix: $(READY)  ## what a tool can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)  ## measure what docs/benchmarks.md reports
	$(BIN)/python -m scripts.benchmarks.matching.quality
	$(BIN)/python -m scripts.benchmarks.matching.stereo_memory
	$(BIN)/python -m scripts.benchmarks.middlebury
	$(BIN)/python -m scripts.benchmarks.middlebury --without-network
	$(BIN)/python -m scripts.benchmarks.held_out
	$(BIN)/python -m scripts.benchmarks.agreement
	$(BIN)/python -m scripts.benchmarks.refine
	$(BIN)/python -m scripts.benchmarks.workspaces
	$(BIN)/python -m scripts.benchmarks.compare
	$(BIN)/python -m scripts.benchmarks.cloud
	$(BIN)/python -m scripts.benchmarks.commands
	$(BIN)/python -m scripts.benchmarks.make_tables

clean:
	rm -rf $(VENV) demo
