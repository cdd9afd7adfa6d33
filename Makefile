# Everything from a fresh checkout: `make demo` and `make test` need cargo and python3 (3.10 or later, with venv),
# and the network the first time. What they install goes to .venv; only `make system` touches anything else.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV ?= .venv
PYTEST_ARGS ?=

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')
STAMPS := $(VENV)/stamps-$(VERSION)
RUST := Cargo.toml Cargo.lock pyproject.toml $(shell find src shaders -type f)

# maturin installs into the active environment: that is ours, whatever else is active in the caller's shell.
export VIRTUAL_ENV := $(abspath $(VENV))
unexport CONDA_PREFIX PYTHONHOME PYTHONPATH
export PYO3_PYTHON := $(abspath $(BIN)/python)
# rustup's directory, for shells that have not read its profile yet.
export PATH := $(PATH):$(HOME)/.cargo/bin

.PHONY: help
help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "PYTHON=python3.x says which Python, PYTEST_ARGS='-k camera' goes to pytest"

.PHONY: demo
demo: $(STAMPS)/build ## build, and render out/demo.png
	$(BIN)/python examples/demo.py --output out/demo.png

.PHONY: build
build: $(STAMPS)/build ## build in release mode, into .venv

.PHONY: test
test: system $(STAMPS)/build $(STAMPS)/test ## set up what tests need, and run them all
	cargo test --no-default-features -- --quiet
	$(BIN)/python -m pytest -q $(SELECTED) $(PYTEST_ARGS)

.PHONY: test-quick
test-quick: SELECTED := -m 'not slow'
test-quick: test ## the same without the tests that take over 10 seconds

.PHONY: lint
lint: $(STAMPS)/test ## formatting, clippy, ruff, and which file may name which crate
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	cargo clippy --all-targets --no-default-features -- -D warnings
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	@! grep -rnE '\b(pyo3|numpy)::' src | grep -v '^src/python/' || { echo "only src/python may name pyo3 and numpy"; exit 1; }
	@! grep -rnE '\bwgpu::' src | grep -vE '^src/(gpu|shader)/' || { echo "only src/gpu and src/shader may name wgpu"; exit 1; }

.PHONY: peers
peers: system $(STAMPS)/build ## time and error of other renderers beside ours, to out/peers.md
	$(BIN)/python benchmarks/peers.py --markdown out/peers.md --json out/peers.json

# ---- products and sums in one rounding ----

BITS := .cache/bits
.PHONY: fma
fma: ## fragments keep their bits where a·b + c is rounded once, and colours do not
	mkdir -p $(BITS)/plain $(BITS)/fma
	cargo run --quiet --no-default-features --example bits -- $(BITS)/plain
	cargo run --quiet --no-default-features --features fma --example bits -- $(BITS)/fma
	cmp $(BITS)/plain/fragments $(BITS)/fma/fragments
	@for what in colors image; do \
		! cmp --silent $(BITS)/{plain,fma}/$$what || { echo "$$what: no bit differs, so that this shows nothing"; exit 1; }; \
	done

# ---- the oldest numpy ----

# The one that pyproject.toml names; a later Python has wheels of later ones only.
OLDEST_NUMPY_3.12 := 1.26.0
OLDEST_NUMPY_3.13 := 2.1.0
OLDEST_NUMPY_3.14 := 2.3.2
NAMED_NUMPY := $(shell sed -nE 's/^dependencies = .*"numpy>=([0-9.]+)".*/\1/p' pyproject.toml)
OLDEST_NUMPY ?= $(or $(OLDEST_NUMPY_$(VERSION)),$(NAMED_NUMPY))
OLDEST := .cache/oldest-numpy-$(VERSION)
# These need no trimesh.
OLDEST_TESTS := $(wildcard $(patsubst %,tests/test_%.py,oracle_agreement mesh fragments frame camera))

.PHONY: oldest-numpy
oldest-numpy: $(OLDEST)/wheel ## the wheel with the oldest numpy that it supports
	$(OLDEST)/bin/python -c 'import numpy; print("numpy", numpy.__version__)'
	$(OLDEST)/bin/python -m pytest -q $(OLDEST_TESTS) $(PYTEST_ARGS)

$(OLDEST)/wheel: $(STAMPS)/build $(RUST) $(shell find python -name '*.py*' -not -path '*/__pycache__/*')
	test -x $(OLDEST)/bin/pip || $(PYTHON) -m venv $(OLDEST)
	rm -rf target/wheels
	$(BIN)/maturin build --quiet --release --out target/wheels
	$(OLDEST)/bin/python -m pip install --disable-pip-version-check --quiet --only-binary numpy \
		--force-reinstall --no-deps target/wheels/*.whl
	$(OLDEST)/bin/python -m pip install --disable-pip-version-check --quiet --only-binary numpy \
		abuffer numpy==$(OLDEST_NUMPY) pytest hypothesis
	touch $@

# ---- setting up ----

$(STAMPS)/venv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
		|| { echo "Python 3.10 or later is needed, as $(PYTHON): make PYTHON=python3.x says which"; exit 1; }
	@# An environment of another Python goes; any other is kept and added to.
	@test ! -x $(BIN)/python || $(BIN)/python -c 'import sys; sys.exit("%d.%d" % sys.version_info[:2] != "$(VERSION)")' \
		|| { echo "$(VENV) is of another Python: making it anew"; rm -rf $(VENV); }
	@$(PYTHON) -m venv $(VENV) \
		|| { echo "$(PYTHON) cannot make virtual environments. On Debian: apt install python$(VERSION)-venv"; exit 1; }
	$(PIP) install --upgrade 'pip>=25.1' # it knows dependency groups
	mkdir -p $(STAMPS)
	touch $@

# maturin builds; trimesh and pymeshfix are for the demo (pymeshfix for its bunny alone).
$(STAMPS)/packages: $(STAMPS)/venv pyproject.toml
	$(PIP) install 'maturin>=1.9.4,<2' 'numpy>=1.24' 'trimesh>=4.8'
	$(PIP) install --no-deps 'pymeshfix>=0.18'
	touch $@

$(STAMPS)/test: $(STAMPS)/venv pyproject.toml
	$(PIP) install --group test
	touch $@

# The library lies in python/, not in .venv: where it was deleted, the stamp is worth nothing.
$(STAMPS)/build: $(STAMPS)/packages $(RUST) $(if $(wildcard python/abuffer/_core*),,FORCE)
	@command -v cargo > /dev/null || { echo "Rust is needed: https://rustup.rs"; exit 1; }
	$(BIN)/maturin develop --release
	touch $@

.PHONY: FORCE
FORCE:

# Vulkan in software, for the GPU tests, EGL for the comparison with pyrender, and a browser for the page of comparisons.
APT := mesa-vulkan-drivers libvulkan1 libegl1 libegl-mesa0 libgl1-mesa-dri chromium chromium-driver

# One by one: what a system does not have keeps nothing else away.
.PHONY: system
system: ## install a software Vulkan driver, EGL and Chromium with apt, where they are missing and it can
	@if ! { command -v dpkg-query && command -v apt-get; } > /dev/null; then \
		echo "no apt here: GPU tests need a Vulkan driver (lavapipe will do), those of pages Chromium, and are skipped without"; exit 0; \
	fi; \
	missing=; \
	for package in $(APT); do \
		[[ $$(dpkg-query -W -f '$${db:Status-Status}' $$package 2> /dev/null) == installed ]] || missing+=" $$package"; \
	done; \
	[[ -n $$missing ]] || exit 0; \
	sudo=; \
	if [[ $$(id -u) != 0 ]]; then \
		sudo="sudo -n"; \
		$$sudo true 2> /dev/null || sudo=none; \
	fi; \
	if [[ $$sudo == none ]]; then \
		echo "!! Neither root nor sudo without a password: not installing$$missing"; \
	else \
		echo "installing$$missing"; \
		export DEBIAN_FRONTEND=noninteractive; \
		$$sudo apt-get update -qq || true; \
		failed=; \
		for package in $$missing; do \
			$$sudo apt-get install -qq -y --no-install-recommends $$package > /dev/null || failed+=" $$package"; \
		done; \
		missing=$$failed; \
		[[ -n $$missing ]] || exit 0; \
		echo "!! apt-get could not install$$missing"; \
	fi; \
	echo "!! Tests are skipped without, or fail with ABUFFER_REQUIRE_GPU=1 and ABUFFER_REQUIRE_BROWSER=1. As root: apt install$$missing"

.PHONY: clean
clean: ## remove all that was built, installed or written here
	rm -rf target out .cache $(VENV) python/abuffer/_core*.so .pytest_cache .ruff_cache .hypothesis
	find python tests examples benchmarks -name __pycache__ -prune -exec rm -rf {} +
