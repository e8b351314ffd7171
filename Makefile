# One door for every check. `make demo` and `make test` set up all they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: help demo test test-fast browser check lint types floors dead fix bench cases clean

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

check: lint types floors dead test  ## all that must be green

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

floors: $(READY)
	$(BIN)/lint-imports

dead: $(READY)
	$(BIN)/vulture

fix: $(READY)  ## what a tool can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

RECORDS := docs/measurements
BENCH := $(BIN)/python -m scripts.benchmarks

bench: $(READY)  ## measure what docs/benchmarks.md reports; takes hours
	$(BENCH).matching.quality
	$(BENCH).matching.stereo_memory --views 12 100
	$(BENCH).middlebury
	$(BENCH).middlebury --without-network
	$(BENCH).middlebury --rounds 1 --output $(RECORDS)/middlebury_rounds_1.json
	$(BENCH).middlebury --passes 2 --output $(RECORDS)/middlebury_passes_2.json
	$(BENCH).middlebury --no-update-gating --output $(RECORDS)/middlebury_no_update_gating.json
	$(BENCH).middlebury --smoothness 0 --no-geom-consistency --output $(RECORDS)/middlebury_like_colmap.json
	$(BENCH).held_out
	$(BENCH).held_out --like-colmap
	$(BENCH).held_out --rounds 1 --output $(RECORDS)/held_out_rounds_1.json
	$(BENCH).held_out --rounds 2 --output $(RECORDS)/held_out_rounds_2.json
	$(BENCH).agreement
	$(BENCH).refine
	$(BENCH).workspaces
	$(BENCH).compare
	$(BENCH).cloud
	$(BENCH).commands
	$(BENCH).make_tables

cases: $(READY)  ## run the failing cases of real users, where they are at hand
	$(BENCH).cases

clean:
	rm -rf $(VENV) demo
