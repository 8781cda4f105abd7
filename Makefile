# `make` alone lists what there is. Every target sets up what it needs; in an environment of your own (conda), name its
# interpreter instead: make test PYTHON=python

PYTHON = .venv/bin/python
# one worker a core, each with one thread; what Python compiles is kept for the other worker and for commands in tests
TESTS = OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(PYTHON) -m pytest -q -n auto --dist worksteal

# an interpreter that is named has what it needs
SETUP = $(if $(filter file,$(origin PYTHON)),scripts/setup.sh,:)

# what is read: pages and docstrings
SPELLED = README.md CONTRIBUTING.md CHANGELOG.md docs files meshes modal rom coupling studies benchmarks paper scripts vanedamp/__init__.py

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-all test-arithmetic test-last-bits test-slow-clock test-doors test-versions check bench docs

help: ## this list
	@awk -F ':.*## ' '/^[a-z%-]+:.*## / { printf "make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## install all that is missing: system packages (apt, with sudo when not root) and .venv
	@$(SETUP)

setup-%: ## install one group: product, tests, checks, browser, peers (VTK, Siconos, CVODE, heyoka, Exudyn), docs
	@$(SETUP) $*

demo: setup-product ## the whole pipeline on the shipped mesh; the report is out/report.html
	$(PYTHON) -m vanedamp demo -o out

test: setup-tests setup-docs ## the tests, fast tier; its end says what was skipped, and which command brings it
	$(TESTS)

test-all: setup ## the tests with the slow verification tier
	$(TESTS) -m "slow or not slow"

test-arithmetic: setup-tests setup-docs ## the fast tier under the arithmetic of other processors, with a table (ARGUMENTS="generic TEST ...")
	PYTHON=$(PYTHON) scripts/test_arithmetic.sh $(ARGUMENTS)

test-last-bits: setup-tests setup-docs ## the fast tier with other last bits of the libraries, under three new seeds (ARGUMENTS="SEED ... TEST ...")
	PYTHON=$(PYTHON) scripts/test_last_bits.sh $(ARGUMENTS)

test-slow-clock: setup-tests setup-docs ## the fast tier as on a machine that is 100 times slower (ARGUMENTS="TEST ...")
	$(TESTS) $(ARGUMENTS) --slow-clock

test-doors: setup-tests ## what users install, tried: newest and oldest packages, what demo installs, dolfinx's wheel (ARGUMENTS="new ...")
	PYTHON=$(PYTHON) scripts/test_doors.sh $(ARGUMENTS)

test-versions: ## the finite element tests on Debian 13 (PyPI's dolfinx and apt's) and unstable, in root folders of their own
	scripts/test_versions.sh

check: setup-tests setup-checks ## ruff, mypy, import contracts
	$(PYTHON) -m ruff check
	$(PYTHON) -m ruff format --check
	$(PYTHON) -m mypy
	$(PYTHON) -c "from importlinter.cli import lint_imports_command as lint; lint()"

bench: setup-product ## speed and accuracy of the engine, measured here; figures in out/bench
	$(PYTHON) -m vanedamp bench engine -o out/bench

docs: setup-tests setup-docs ## the documentation site, its links and spelling checked: docs/_build/html/index.html
	$(PYTHON) -m sphinx -q -W --keep-going -n docs docs/_build/html
	$(PYTHON) docs/check_site.py docs/_build/html
	$(PYTHON) -m codespell_lib $(SPELLED)
