# Every target sets up what it needs, in a virtual environment of its own. A second call is
# instant; a change of pyproject.toml or constraints.txt installs again.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
# One worker a core; beyond 8, starting them costs more than they save.
TEST   := $(BIN)/python -m pytest -n auto --maxprocesses 8 --dist worksteal

# Each process that a test starts would compile all that it imports again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test test-all lint bench mutants docs pictures figures reproduce clean

help:  ## show this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' Makefile | expand -t 18

demo: $(VENV)/.installed  ## the tour: DIM beside a fixed-time signal, table, plot and animation
	$(BIN)/minisim demo --out out

test: $(VENV)/.installed-all  ## the tests, without the slow ones
	$(TEST) -m "not slow"

test-all: $(VENV)/.installed-all  ## all tests, properties on more examples
	$(TEST) --hypothesis-profile thorough

lint: $(VENV)/.installed-dev  ## style, format, types, layer contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.installed-all  ## speed, beside SUMO and C in the same run; BENCH="--append FILE" keeps a line
	$(BIN)/python -m tests.bench.bench $(BENCH)

mutants: $(VENV)/.installed-mutants  ## do the tests notice when dim is changed? A long run; a second call continues it
	$(BIN)/python tests/mutants.py run
	$(BIN)/python tests/mutants.py table

docs: $(VENV)/.installed-docs  ## the site, in out/site; warnings are errors, and no network is needed
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs out/site

pictures: demo  ## the pictures of README and docs, redrawn from out/runs.sqlite (make reproduce)
	cp out/demo.png out/demo.gif docs
	$(BIN)/minisim decide four-way a1 b2 c2 d2 --plot docs/decision.png
	$(BIN)/minisim benchmark --out out/benchmark
	cp out/benchmark/figures/cells.png docs/benchmark.png
	$(BIN)/minisim figures waiting-balanced perception optimum gap humans messages \
	  --store out/runs.sqlite --out out/figures
	cp out/figures/waiting-balanced.png docs/waiting.png
	for name in perception optimum gap humans messages; do cp out/figures/$$name.png docs; done

figures: $(VENV)/.installed  ## every figure and table, from out/runs.sqlite (make reproduce) or else a quick run
	if [ -f out/runs.sqlite ]; then $(BIN)/minisim figures --store out/runs.sqlite --out out/figures; \
	else $(BIN)/minisim reproduce --quick --out out/quick; fi

reproduce: $(VENV)/.installed  ## the paper's experiments and ours: out/report.md and out/figures
	$(BIN)/minisim reproduce --out out

clean:  ## remove the environment, caches and results
	rm -rf $(VENV) out build dist mutants .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps form a chain, so that `make -j` never installs twice at the same time.
$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "minisim needs Python 3.11 or newer: make PYTHON=…")'
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.installed: $(VENV)/.created pyproject.toml constraints.txt
	$(PIP) -e .
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(PIP) -e '.[dev]'
	@touch $@

$(VENV)/.installed-all: $(VENV)/.installed-dev
	$(PIP) -e '.[dev,sumo,dask,docs,notebook]'
	@touch $@

$(VENV)/.installed-mutants: $(VENV)/.installed-all
	$(PIP) -e '.[mutants]'
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(PIP) -e '.[docs]'
	@touch $@
