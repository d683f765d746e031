# `make demo` and `make test` work on a fresh clone: system parts, virtual environment and installation included.

VENV   := .venv
BIN    := $(VENV)/bin
# The first Python that is new enough; another one by `make PYTHON=...`.
PYTHON ?= $(shell for python in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$python && break; done)
PIP    := $(BIN)/python -m pip install -qq --no-input --disable-pip-version-check

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test quick lint types pixels pictures bench soak look clean

help:  ## this list
	@echo "deferred-ir: global illumination on OpenGL"
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1	\2/p' Makefile

demo: $(VENV)/installed  ## install, render the Cornell box to out/cornell.png
	@$(BIN)/python tools/system.py opengl
	@mkdir -p out
	@$(BIN)/deferred-ir render cornell -o out/cornell.png
	@echo "$(CURDIR)/out/cornell.png"

test: lint types  ## install, check style and types, run all tests
	@$(BIN)/python tools/system.py opengl
	@$(BIN)/python tools/system.py display
	@$(BIN)/python -m pytest -n auto --maxprocesses 8 --dist loadfile

quick: $(VENV)/installed-dev  ## lint, types, an image of each graph and the tests without OpenGL, in under a minute on two cores
	@$(BIN)/python tools/system.py opengl
	@$(BIN)/python tools/quick.py

pixels: $(VENV)/installed  ## prove that a change moves no pixel: run it before and after; SCENES="a.toml b.toml" adds scenes
	@$(BIN)/python tools/system.py opengl
	@$(BIN)/python tools/pixels.py $(SCENES)

pictures: $(VENV)/installed-dev  ## render the pictures of README and docs again
	@$(BIN)/python tools/system.py display
	@$(BIN)/python tools/pictures.py

bench: $(VENV)/installed  ## measure how far from the limits the passes are, for docs/bench.md
	@$(BIN)/python tools/system.py opengl
	@$(BIN)/python tools/bench.py

soak: $(VENV)/installed  ## 20,000 frames and 500 loads of scenes in one process, half an hour at most: nothing may grow
	@$(BIN)/python tools/system.py opengl
	@$(BIN)/python -m deferred_ir.profiling.checks.soak

look: $(VENV)/installed-dev  ## screenshot of a small report to out/report.png
	@$(BIN)/python tools/system.py opengl
	@$(BIN)/python tools/system.py browser
	@$(BIN)/python tools/look.py

lint: $(VENV)/installed-dev
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --quiet --check . || { echo "not formatted; run $(BIN)/ruff format ."; exit 1; }

types: $(VENV)/installed-dev
	@$(BIN)/python tools/typecheck.py

clean:  ## remove the environment, caches and output
	@rm -rf $(VENV) build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/created:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: install it, or make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "$(PYTHON) is too old, Python 3.11 or newer is needed: make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) tools/system.py venv
	@echo "Installing into $(VENV)"
	@$(PYTHON) -m venv --clear $(VENV)
	@touch $@

$(VENV)/installed: pyproject.toml | $(VENV)/created
	@$(PIP) -e . </dev/null
	@touch $@

$(VENV)/installed-dev: pyproject.toml | $(VENV)/created
	@$(PIP) -e '.[dev]' </dev/null
	@touch $@ $(VENV)/installed
