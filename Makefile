# mesoslip: `make demo` and `make test` need nothing but make, git and Python 3.11.

PYTHON ?= python3
VENV := .venv
UV := $(VENV)/bin/uv
MESOSLIP := $(VENV)/bin/mesoslip
ENVIRONMENT := $(VENV)/.environment
INSTALLED := $(VENV)/.installed
SYSTEM := gcc gfortran libsundials-dev libsundials-fortran-dev

SOURCES := $(wildcard meson.build meson.options pyproject.toml fortran/* python/* python/mesoslip/*)
FIGURE_RUNS := $(patsubst runs/%.toml,out/%.nc,$(wildcard runs/S*.toml))

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

.PHONY: help
help: ## Show the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/\1\t\2/' | expand -t 16

.PHONY: setup
setup: $(INSTALLED) ## Install what is missing, and build

.PHONY: demo
demo: out/klein.nc out/klein.png ## Simulate Klein's experiment, and draw it

.PHONY: test
test: test-python test-fortran test-debug ## Build, and pass all tests

.PHONY: test-python
test-python: $(INSTALLED)
	$(VENV)/bin/pytest -n 2 -q

.PHONY: test-fortran
test-fortran: build/test/build.ninja
	$(VENV)/bin/meson test -C build/test --print-errorlogs

.PHONY: test-debug
test-debug: build/debug/build.ninja ## Fortran unit tests with all run-time checks
	$(VENV)/bin/meson test -C build/debug --print-errorlogs

.PHONY: test-sanitize
test-sanitize: build/sanitize/build.ninja ## Fortran unit tests under the address and undefined-behaviour sanitizers
	ASAN_OPTIONS=detect_leaks=0 $(VENV)/bin/meson test -C build/sanitize --print-errorlogs

.PHONY: figures
figures: $(FIGURE_RUNS) ## Draw the source's figures into out/figures
	$(MESOSLIP) figures -o out/figures

.PHONY: bench
bench: $(INSTALLED) ## Measure the cost of a contact event
	$(VENV)/bin/python tests/bench/bench.py

.PHONY: reference
reference: $(INSTALLED) ## Write the reference outputs of the tests anew, on purpose only
	$(VENV)/bin/python tests/python/make_reference.py

.PHONY: lint
lint: $(INSTALLED) ## Check the style of all sources
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/fortitude check fortran tests/fortran
	$(VENV)/bin/codespell

.PHONY: clean
clean: ## Remove the environment, what was built, and outputs
	rm -rf build out $(VENV)

# An output depends on its run, not on the program: a new build does not make hours of outputs stale.
out/%.nc: runs/%.toml | $(INSTALLED)
	$(MESOSLIP) run $< -o $@

out/%.png: out/%.nc | $(INSTALLED)
	$(MESOSLIP) plot $< -o $@

# The runs of the source's figures are variations of Klein's.
$(FIGURE_RUNS): runs/klein.toml

$(ENVIRONMENT): uv.lock tools/system-packages
	PYTHON=$(PYTHON) tools/system-packages $(SYSTEM)
	test -x $(VENV)/bin/python || $(PYTHON) -m venv $(VENV)
	test -x $(UV) || $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check uv
	$(UV) sync --quiet --locked --no-install-project
	@touch $@

$(INSTALLED): $(ENVIRONMENT) $(SOURCES)
	@mkdir -p build/package
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" $(UV) pip install --quiet --python $(VENV)/bin/python \
	  --no-deps --no-build-isolation --reinstall-package mesoslip -Cbuild-dir=build/package .
	@touch $@

# Debug information costs nothing; checks and sanitizers need their own builds.
MESON_SETUP = PATH="$(CURDIR)/$(VENV)/bin:$$PATH" $(VENV)/bin/meson setup --reconfigure -Dpython=false -Dtests=true

build/test/build.ninja: $(ENVIRONMENT) meson.build meson.options fortran/meson.build tests/fortran/meson.build
	$(MESON_SETUP) build/test >/dev/null

build/debug/build.ninja: $(ENVIRONMENT) meson.build meson.options fortran/meson.build tests/fortran/meson.build
	$(MESON_SETUP) --buildtype=debug -Db_lto=false -Dchecks=true build/debug >/dev/null

build/sanitize/build.ninja: $(ENVIRONMENT) meson.build meson.options fortran/meson.build tests/fortran/meson.build
	$(MESON_SETUP) --buildtype=debug -Db_lto=false -Db_sanitize=address,undefined -Db_lundef=false build/sanitize >/dev/null
