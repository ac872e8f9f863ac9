# `make demo` and `make test` need Python 3.11 or newer, make and a package index; all else they bring along, into .venv.
# Stamp files in .venv say what is installed: a second call does only what a change in pyproject.toml, constraints.txt
# or src asks for.  The package is installed as a user gets it, with bytecode, so start-up times and tests are honest.

PYTHON ?= python3
WORKERS ?= 2
ARGS ?=

BIN := .venv/bin
PIP_INSTALL := $(BIN)/python -m pip --quiet --quiet --no-input --disable-pip-version-check install
# Bytecode of the dependencies: on all cores, where pip uses one, and without their tests, which are nearly half of it
FETCH := $(PIP_INSTALL) --no-compile --no-build-isolation --constraint constraints.txt
COMPILE := $(BIN)/python -m compileall -q -q -j 0 -x /tests/ .venv/lib || true
PYTEST := $(BIN)/python -m pytest --numprocesses $(WORKERS) --dist worksteal
# Folders too: one is newer after a file in it was removed
SOURCES := $(shell find src -name __pycache__ -prune -o -print)

# Tests and demo see the installed package, never src
unexport PYTHONPATH PYTHONHOME

.DEFAULT_GOAL := help
.NOTPARALLEL:
.DELETE_ON_ERROR:
.PHONY: help demo docs docs-site wheel test test-slow test-all lint format bench constraints clean distclean

help: ## list what can be made
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' Makefile

demo: .venv/.package ## write figures, tables and data of a first run into demo/
	@$(BIN)/piazzi demo -o demo

docs: .venv/.docs .venv/.package ## build the documentation into build/docs, without a network and strictly
	@rm -rf build/docs
	@PIAZZI_CACHE="$${PIAZZI_CACHE:-$(CURDIR)/.cache/tests}" $(BIN)/sphinx-build --quiet --fail-on-warning --fresh-env \
		--jobs auto --doctree-dir .cache/doctrees docs build/docs
	@echo "Open build/docs/index.html"

docs-site: docs ## put build/docs into build/site, beside the versions that are there already
	@$(BIN)/python docs/machinery/versions.py build/docs build/site

wheel: .venv/.runtime ## build dist/piazzi-*.whl, for pip install
	@rm -rf dist && $(BIN)/python -m pip --quiet --quiet --no-input --disable-pip-version-check wheel --no-build-isolation --no-deps --wheel-dir dist .
	@ls dist/*.whl

test: .venv/.dev .venv/.package ## fast tests (ARGS='tests/test_structure.py -k upstream' narrows them)
	@$(PYTEST) -m "not slow" $(ARGS)

test-slow: .venv/.dev .venv/.package ## slow tests only
	@$(PYTEST) -m slow $(ARGS)

test-all: .venv/.dev .venv/.package ## fast and slow tests
	@$(PYTEST) $(ARGS)

lint: .venv/.dev ## rules, format and types
	@echo "ruff check" && $(BIN)/ruff check --quiet --output-format concise .
	@echo "ruff format --check" && $(BIN)/ruff format --quiet --check .
	@echo "mypy --strict src" && $(BIN)/mypy --strict src

format: .venv/.dev ## mend format and the rules that mend themselves
	@$(BIN)/ruff check --quiet --fix . ; $(BIN)/ruff format .

bench: .venv/.bench .venv/.package ## time Piazzi against hand-written C and other libraries
	@$(BIN)/python benchmarks/run.py $(ARGS)

constraints: ## resolve every pin in constraints.txt anew
	@echo "Resolving the newest versions that work together (a few minutes)"
	@rm -rf .cache/pins && "$(PYTHON)" -m venv .cache/pins
	@.cache/pins/bin/python -m pip -qq --no-input install --no-compile '.[dev,bench,cluster,docs]'
	@{ sed -n '/^#/p' constraints.txt; .cache/pins/bin/python -m pip freeze --all --exclude pip --exclude piazzi | sed '/\.dev[0-9]/d' | LC_ALL=C sort -f; } > .cache/pins.txt
	@mv .cache/pins.txt constraints.txt && rm -rf .cache/pins

clean: ## remove what was made, but keep .venv
	@rm -rf .cache .hypothesis build demo dist docs/*/made
	@find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## remove .venv too
	@rm -rf .venv

.venv/.created:
	@"$(PYTHON)" -c 'import sys; v = sys.version_info[:3]; v >= (3, 11) or sys.exit("Piazzi needs Python 3.11 or newer and $(PYTHON) is %d.%d.%d: name another, as in make PYTHON=python3.12" % v)'
	@echo "Making .venv"
	@"$(PYTHON)" -m venv .venv
	@touch $@

.venv/.runtime: .venv/.created pyproject.toml constraints.txt
	@echo "Installing what Piazzi needs (the first time takes about a minute)"
	@$(FETCH) hatchling
	@$(FETCH) .
	@$(COMPILE)
	@touch $@

.venv/.dev: .venv/.runtime
	@echo "Installing what its tests need"
	@$(FETCH) 'setuptools>=70.1' # oem and filterpy are published as source alone, and are built in here
	@$(FETCH) '.[dev]'
	@$(COMPILE)
	@touch $@

.venv/.docs: .venv/.runtime
	@echo "Installing what its documentation needs"
	@$(FETCH) '.[docs]'
	@$(COMPILE)
	@touch $@

.venv/.bench: .venv/.runtime
	@echo "Installing what its benchmarks compare with"
	@$(FETCH) 'setuptools>=70.1'
	@$(FETCH) '.[bench]'
	@$(COMPILE)
	@touch $@

.venv/.package: .venv/.runtime $(SOURCES)
	@echo "Installing Piazzi from src"
	@$(PIP_INSTALL) --compile --no-build-isolation --no-deps --force-reinstall .
	@touch $@
