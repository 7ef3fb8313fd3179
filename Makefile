# make demo   sets everything up and lets the planner solve a task: out/demo.mp4 and out/demo.html
# make test   sets everything up and passes the checks and tests
# make docs   sets everything up and builds the documentation: build/site/index.html
# Both are quick when run again. PYTHON=... chooses the interpreter, else the first of 3.11, 3.12, 3.13 and 3.10 that
# runs is taken; VENV=... keeps the environments of several interpreters apart.

SHELL := /bin/bash
VENV := .venv
RUN := $(VENV)/bin
PEERS := build/peers
FITS := import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.10 python3 python; do \
	$$p -c '$(FITS)' 2>/dev/null && { echo $$p; break; }; done)

.PHONY: demo test check docs coverage test-slow dist test-lowest lock bench peers scaling tables assets homes clean
.DELETE_ON_ERROR:

demo: $(VENV)/.run
	$(RUN)/chmarl-pb demo --out out

test: check
	$(RUN)/python -m pytest -n 2 --dist worksteal -m "not slow"

check: $(VENV)/.dev
	$(RUN)/ruff check .
	$(RUN)/ruff format --check .
	$(RUN)/mypy

# Every warning, as of a link to a heading that is not there, fails.
docs: $(VENV)/.docs
	$(RUN)/python -m sphinx --fail-on-warning --keep-going --quiet docs build/site
	@echo "build/site/index.html"

# The same tests, with the lines counted that they run: half as slow again. Fails below the floor in pyproject.toml.
coverage: $(VENV)/.dev
	$(RUN)/python -m pytest -n 2 --dist worksteal -m "not slow" --cov --cov-report=term

test-slow: $(VENV)/.dev
	$(RUN)/python -m pytest -n 2 --dist worksteal -m slow

# Wheel and sdist in build/dist, tried in empty environments of all Pythons that are there.
dist: $(VENV)/.release
	rm -rf build/dist
	$(RUN)/python -m build --outdir build/dist
	$(RUN)/python -m twine check --strict build/dist/*
	$(RUN)/python -m tools.distribution build/dist

# The fast tests with the lowest versions that pyproject.toml allows, on the oldest Python.
test-lowest:
	rm -rf build/lowest
	$(or $(LOWEST),python3.10) -m venv build/lowest
	build/lowest/bin/python -m pip install --quiet uv
	build/lowest/bin/uv pip install --quiet --python build/lowest/bin/python --resolution lowest-direct --editable ".[train,dev]"
	build/lowest/bin/chmarl-pb doctor
	build/lowest/bin/python -m pytest -n 2 --dist worksteal -m "not slow"

# Versions that were tried together: requirements.lock.
lock: $(VENV)/.release
	$(RUN)/uv pip compile --quiet --universal --all-extras --no-header pyproject.toml --output-file requirements.lock

bench: $(VENV)/.run
	$(RUN)/chmarl-pb bench

# peers: other simulators beside this one, in an environment of their own. scaling: docs/scaling.png.
peers: $(PEERS)/.run
	$(PEERS)/bin/python -m benchmarks.peers

scaling: $(VENV)/.dev
	$(RUN)/python -m benchmarks.scaling

# Train and evaluate all rows of the tables: docs/results.md. It takes long and goes on where it was interrupted.
# ROWS="--table scene-graph --seeds 1" chooses; see docs/training_tables.md.
tables: $(VENV)/.dev
	$(RUN)/python -m training.table $(ROWS)

# Rebuild every generated file that is committed.
assets: $(VENV)/.run
	$(RUN)/python -m tools.assets.graspables
	$(RUN)/python -m tools.assets.furniture
	$(RUN)/python -m tools.assets.robots
	$(RUN)/python -m tools.assets.textures

homes: $(VENV)/.run
	rm -rf scenes/meshes
	for layout in scenes/*.toml; do $(RUN)/chmarl-pb homes build $$layout || exit 1; done
	for layout in scenes/*.toml; do \
		name=$$(basename $$layout .toml); $(RUN)/chmarl-pb homes preview $$name --out docs/homes/$$name.png || exit 1; done
	$(RUN)/python -m tools.assets.sheet --out docs/assets.png

$(VENV)/.run: pyproject.toml | $(VENV)/bin/python
	$(RUN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/python
	$(RUN)/python -m pip install --quiet --editable ".[dev,train]"
	@touch $@ $(VENV)/.run

$(VENV)/.docs: pyproject.toml | $(VENV)/bin/python
	$(RUN)/python -m pip install --quiet --editable ".[docs,train]"
	@touch $@ $(VENV)/.run

$(VENV)/.release: pyproject.toml | $(VENV)/bin/python
	$(RUN)/python -m pip install --quiet --editable ".[release]"
	@touch $@ $(VENV)/.run

$(PEERS)/.run: benchmarks/requirements.txt pyproject.toml | $(VENV)/bin/python
	$(VENV)/bin/python -m venv $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --editable . --requirement benchmarks/requirements.txt
	@touch $@

$(VENV)/bin/python:
	@$(PYTHON) -c '$(FITS)' 2>/dev/null || { \
		echo "chmarl_pb needs Python 3.10 to 3.13 with venv: PyBullet has no ready-made package for others."; \
		echo "Install one (Debian, Ubuntu: apt install python3 python3-venv; pyenv: pyenv install 3.13), or name it:"; \
		echo "  make $(or $(MAKECMDGOALS),demo) PYTHON=/path/to/python3"; exit 1; } >&2
	$(PYTHON) -m venv $(VENV)

clean:
	rm -rf $(VENV) $(PEERS) build/site out
