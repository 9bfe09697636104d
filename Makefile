# Two commands: make study, make test. Needs Python 3.11 or newer and make, nothing else.
PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
# Compiled once, when first imported: of what is installed half is never, and each process that starts needs the rest.
unexport PYTHONDONTWRITEBYTECODE
# Which of the slow tests: .ci/run names fewer.
SLOW := slow
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable

.PHONY: help study test slow coverage guard speed lint types docs package lowest bench clean

help:
	@echo "make study   install into $(VENV) and run the Saturn V study: results/saturn-v/report.html"
	@echo "make test    install into $(VENV) and run the tests"
	@echo "make slow    what takes too long for every change: repeated kills, statistics of many trials"
	@echo "make coverage the tests with the lines of the library that none of them runs"
	@echo "make guard   coverage of the bands and the blind diagnosis in small, against committed floors"
	@echo "make speed   commands beside an earlier tree (the last tag's): none 1.5 times slower"
	@echo "make docs    the documentation: docs/_build/index.html"
	@echo "make package wheel and sdist, tried in empty environments"
	@echo "make lowest  a part of the tests with the lowest versions of everything that is needed"
	@echo "make lint    ruff;  make types  mypy;  make bench  speed against named peers"

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; name it with: make PYTHON=/path/to/python3.11 study" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing (once)"
	$(INSTALL) '.[fleet,formats]'
	@touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing with the tools for development (once)"
	$(INSTALL) '.[dev,docs,fleet,formats]'
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-bench: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing with the peers that speed is measured against (once)"
	$(INSTALL) '.[bench,fleet,formats]'
	@touch $@ $(VENV)/.installed

study: $(VENV)/.installed
	$(BIN)/damping study

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --numprocesses auto --dist loadgroup

slow: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --numprocesses auto --dist loadgroup -m "$(SLOW)"

# Python 3.12 and later count lines at next to no cost (sysmon); 3.11 traces, several times as long.
coverage: $(VENV)/.installed-dev
	COVERAGE_CORE=$$($(BIN)/python -c 'import sys; print("sysmon" if sys.version_info >= (3, 12) else "ctrace")') \
		$(BIN)/python -m pytest --numprocesses auto --dist loadgroup --cov --cov-report=term-missing:skip-covered

guard: $(VENV)/.installed-dev
	$(BIN)/python -m damping_validation.guard

speed: $(VENV)/.installed
	$(BIN)/python -m benchmarks --guard

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy

docs: $(VENV)/.installed-dev
	$(BIN)/python -m sphinx --fail-on-warning --quiet docs docs/_build
	@echo "docs/_build/index.html written"

package: $(VENV)/.installed-dev
	tests/packaging/try_wheel.sh $(CURDIR)/$(BIN)/python

lowest:
	tests/packaging/try_lowest.sh $(PYTHON)

bench: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis
