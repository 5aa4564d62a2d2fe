# mesoslip: `make demo` and `make test` need nothing but make, git and Python 3.11 or later.

PYTHON ?= python3
# Options of meson.options, after make clean: MESON_ARGS=-Dnative=true
MESON_ARGS ?=
VENV := .venv
MESOSLIP := $(VENV)/bin/mesoslip
UV := $(VENV)/bin/uv

# Stamps: the locked Python packages, and mesoslip itself, built from these sources.
ENVIRONMENT := $(VENV)/.environment
INSTALLED := $(VENV)/.installed
# Packages that only the documentation needs, and only wheels.
DOCUMENTATION := $(VENV)/.documentation
WHEEL_TOOLS := $(VENV)/.wheel-tools
# Other programs that read outputs.
FORMATS := $(VENV)/.formats
# Stamp: a wheel of these sources in dist.
WHEEL := build/wheel/.built

# .git/logs/HEAD, as outputs have the commit of the program.
SOURCES := meson.build meson.options pyproject.toml \
  $(wildcard fortran/meson.build fortran/*.f90 fortran/*.in fortran/*/* fortran/*/*/* python/meson.build python/f2cmap) \
  $(wildcard $(addsuffix /*.py,python/mesoslip python/mesoslip/* python/mesoslip/*/*)) \
  $(wildcard python/mesoslip/*.py.in python/mesoslip/*.pyi runs/meson.build .git/logs/HEAD)

SYSTEM_PACKAGES := gcc gfortran libc6-dev libsundials-dev
# meson and meson-python find ninja here.
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export UV_PROJECT_ENVIRONMENT := $(CURDIR)/$(VENV)
export UV_PYTHON_DOWNLOADS := never
# Or the first start of each command compiles what it imports.
export UV_COMPILE_BYTECODE := 1
# Nor do tests have to be compiled again each time, as where a shell asks Python to keep nothing.
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PRECIOUS: out/%.nc
.PHONY: help setup dev demo test test-python test-fortran test-debug test-sanitize test-browser test-formats figures \
  gallery doc-pictures claims campaign docs docs-examples docs-pages bench fuzz mutants reference lint wheel test-wheel test-sdist \
  release-check clean

help: ## Show the targets
	@sed -nE 's/^([a-z-]+):.*## (.*)/\1\t\2/p' $(MAKEFILE_LIST) | expand -t 16
	@printf 'out/NAME.nc\tSimulate runs/NAME.toml\n' | expand -t 16
	@printf '\nDependencies, from left to right (docs/architecture.md lists the files to change for an addition):\n'
	@printf 'fortran/\tnumerics, contacts and sliders, recording, loop, boundary; theory\n' | expand -t 16
	@printf 'python/\tconfiguration, execution, simulation, output, analysis and theory, measured, inference and plots,\n\tcampaign, reports and explorer, command_line\n' | expand -t 16

setup: $(INSTALLED) ## Install missing packages, and build
	@:

# Imports compile what has changed since. Without its stamp, make setup installs the optimized build again.
dev: $(ENVIRONMENT) ## Install an editable build, quick to compile, for work on the program
	@rm -f $(INSTALLED)
	@$(UV) pip install --quiet --python $(VENV)/bin/python --no-deps --no-build-isolation \
	  --reinstall-package mesoslip -Cbuild-dir=build/dev -Csetup-args=-Dbuildtype=plain \
	  -Csetup-args=-Doptimization=1 -Csetup-args=-Db_lto=false --editable .

demo: out/klein.nc out/klein.png ## Simulate Klein's experiment, and draw it
	@:

test: test-debug test-python ## Build, and pass all tests

test-python: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/pytest -n 2 --dist worksteal -q

test-fortran: build/release/build.ninja ## Run the Fortran unit tests as optimized
	@ninja --quiet -C build/release
	$(VENV)/bin/meson test -C build/release --no-rebuild --print-errorlogs

test-debug: build/debug/build.ninja ## Run the Fortran unit tests with all run-time checks
	@ninja --quiet -C build/debug
	$(VENV)/bin/meson test -C build/debug --no-rebuild --print-errorlogs

test-sanitize: build/sanitize/build.ninja ## Run the Fortran unit tests with the sanitizers
	@ninja --quiet -C build/sanitize
	$(VENV)/bin/meson test -C build/sanitize --no-rebuild --print-errorlogs

test-browser: $(INSTALLED) ## Test the explorer in a real Chromium, installed if allowed
	@PYTHON=$(PYTHON) tools/system-packages chromium chromium-driver
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/pytest -q -s tests/browser

test-formats: $(INSTALLED) $(FORMATS) ## Read and check outputs with other programs: CF, ArviZ, Zarr, ObsPy
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/pytest -q tests/formats

# Some of them, by parts of their names: make gallery PICTURES="sweep lattice".
PICTURES ?=
gallery: $(INSTALLED) ## Draw every picture that a command makes, of small runs, into build/gallery
	$(VENV)/bin/python tests/gallery/gallery.py $(PICTURES)

# Others than stale ones: make doc-pictures PICTURES="klein response".
doc-pictures: $(INSTALLED) ## Draw the pictures of the documentation whose runs have changed
	tools/doc-pictures $(PICTURES)

bench: $(INSTALLED) ## Measure the cost of a contact event
	$(VENV)/bin/python tests/bench/bench.py

# Some cases of some attacks: make fuzz FUZZ="signals=20 --seed 7"; one of them: FUZZ="--only signals:7:3".
FUZZ ?=
fuzz: $(INSTALLED) $(if $(FUZZ),,test-fortran) ## Attack the program with some thousand random cases
	$(VENV)/bin/python tests/fuzz/fuzz.py $(FUZZ)
	$(if $(FUZZ),,OPENBLAS_NUM_THREADS=1 $(VENV)/bin/pytest -n 2 -q -m long \
	  --ignore=tests/python/test_documentation.py)

# A part of a file's name or of a mutant's text: make mutants MUTANTS=likelihood.
MUTANTS ?=
mutants: $(INSTALLED) ## Break the program in some fifty places, and report which the tests notice
	$(VENV)/bin/python tests/mutants/mutants.py $(MUTANTS)

reference: $(INSTALLED) ## Rewrite the reference outputs of the tests, on purpose only
	$(VENV)/bin/python tests/python/make_reference.py

lint: $(INSTALLED) ## Check the style of all sources
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/fortitude check fortran tests/fortran
	$(VENV)/bin/codespell

# Examples and pages at the same time, as most of either takes one processor. Every warning is an
# error, and what browsers would load from elsewhere is one.
docs: $(INSTALLED) $(DOCUMENTATION) $(FORMATS) ## Build the documentation into out/docs, and run its long pages
	@$(MAKE) --no-print-directory --output-sync -j2 docs-examples docs-pages

docs-examples: test-formats
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/pytest -n 2 --dist worksteal -q -m long tests/python/test_documentation.py

docs-pages: $(INSTALLED) $(DOCUMENTATION)
	$(VENV)/bin/python -m sphinx -b html -W --keep-going -q -d build/docs docs out/docs
	$(VENV)/bin/python tools/self-contained out/docs

wheel: $(WHEEL) ## Build a wheel that needs neither gfortran nor SUNDIALS, into dist
	@ls -sh1 dist/*.whl

test-wheel: $(WHEEL) ## Test the wheel where neither gfortran nor SUNDIALS can be found
	PYTHON=$(VENV)/bin/python tools/test-wheel dist/*.whl

test-sdist: $(ENVIRONMENT) ## Build from the source archive of the last commit, without a network
	PYTHON=$(VENV)/bin/python tools/test-sdist

release-check: lint test docs test-wheel test-sdist ## Check all that a release consists of
	$(VENV)/bin/python tools/release-check

clean: ## Remove the environment, what was built, and outputs
	rm -rf build dist out $(VENV) docs/examples docs/reference/generated

$(ENVIRONMENT): pyproject.toml uv.lock tools/system-packages
	@PYTHON=$(PYTHON) tools/system-packages $(SYSTEM_PACKAGES)
	@echo "Installing Python packages into $(VENV)"
	@test -x $(VENV)/bin/python || $(PYTHON) -m venv $(VENV)
	@test -x $(UV) || $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check uv
	@$(UV) sync --quiet --locked --no-install-project
	@touch $@

$(INSTALLED): $(ENVIRONMENT) $(SOURCES)
	@echo "Building and installing mesoslip"
	@mkdir -p build/package
	@$(UV) pip install --quiet --python $(VENV)/bin/python --no-deps --no-build-isolation \
	  --reinstall-package mesoslip -Cbuild-dir=build/package \
	  $(addprefix -Csetup-args=,$(MESON_ARGS)) .
	@touch $@

$(DOCUMENTATION): $(ENVIRONMENT)
	@echo "Installing what builds the documentation"
	@$(UV) sync --quiet --locked --inexact --no-install-project --group docs
	@touch $@

$(FORMATS): $(ENVIRONMENT)
	@echo "Installing other programs that read outputs"
	@$(UV) sync --quiet --locked --inexact --no-install-project --group formats
	@touch $@

$(WHEEL_TOOLS): $(ENVIRONMENT)
	@echo "Installing what builds wheels"
	@$(UV) sync --quiet --locked --inexact --no-install-project --group wheel
	@touch $@

# auditwheel copies the libraries into the wheel and finds out the oldest glibc that it runs with.
$(WHEEL): $(WHEEL_TOOLS) $(SOURCES)
	@echo "Building a wheel"
	@mkdir -p build/wheel
	@rm -f build/wheel/*.whl dist/*.whl
	@$(UV) build --quiet --wheel --no-build-isolation --python $(VENV)/bin/python --out-dir build/wheel \
	  -Cbuild-dir=build/wheel/meson $(addprefix -Csetup-args=,$(MESON_ARGS)) .
	@$(VENV)/bin/auditwheel repair --wheel-dir dist build/wheel/*.whl
	@touch $@

# The Fortran tests, without Python, in three profiles.
# Without link-time optimization, which each test would repeat; Python tests run it.
build/release/build.ninja: PROFILE := --buildtype=release
# With checks the tests take half the time if they are optimized a little.
# The checks name file and line themselves; without debugging symbols the build takes a quarter less.
build/debug/build.ninja: PROFILE := --buildtype=debug -Doptimization=1 -Ddebug=false -Dchecks=true
build/sanitize/build.ninja: PROFILE := --buildtype=debug -Db_sanitize=address,undefined \
  -Db_lundef=false
build/%/build.ninja: Makefile | $(ENVIRONMENT)
	@mkdir -p $(@D)
	@meson setup --reconfigure -Dpython=false -Dtests=true $(PROFILE) $(MESON_ARGS) $(@D) \
	  >$(@D)/setup.log || { cat $(@D)/setup.log; exit 1; }
	@touch $@

# Outputs of runs, figures, claims, sweeps.
include runs/campaign.mk
