# `make demo` and `make test` are all there is to know; both set up what they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
WORKERS ?= 2
BRING = $(MAKE) --silent $(VENV)/.dev
SEED ?= 1
# One thread of linear algebra to a worker: two workers with two each wait for each other half a minute in one test.
# A file's tests stay in one worker: what its fixtures fly is flown once; conftest.py puts the longest files first.
# Byte code is kept also where the machine forbids it: hundreds of commands would read all sources again.
PYTEST := env -u PYTHONDONTWRITEBYTECODE OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder
# What a change breaks most often, in less than a minute: what flies little or nothing.
FAST := tests/aircraft tests/design tests/plant tests/results tests/scenario $(wildcard tests/test_re*.py tests/test_arch*.py)

# Kernels on plain arrays, without a compiler: to compile each by itself takes ten times as long as to try it.
# Files whose tests compile nothing are among them: together they take about as long as tests/warm.py, for which all other
# tests wait.
PLAIN := tests/design $(wildcard tests/*/test_*_kernels.py tests/*/*/test_*_kernels.py) \
  $(addprefix tests/diagnosis/,test_short_flights.py types/test_modes.py test_bounds_derived.py detection/test_likelihood.py) \
  $(addprefix tests/control/test_,decisions.py laws.py supervisor.py compiled_rivals.py) \
  tests/control/laws/test_gains.py tests/diagnosis/rivals/test_filters.py \
  $(addprefix tests/scenario/test_,dump.py given.py loader.py aircraft_folder.py) \
  tests/test_architecture.py tests/test_stages.py tests/test_readouts.py $(addprefix tests/tools/test_,reference.py docs_names.py)

.PHONY: demo check test core-test nightly promises plain acceptance cost waits test-fast coverage mutants drawn lint docs docs-check site clean help

help:
	@echo "make demo       set up, fly the published elevator case, print the verdict and where the report lies"
	@echo "make check      the tests nearest to the modules you changed: a minute at most"
	@echo "make test       set up and run every test of every day"
	@echo "make nightly    all tests with all that they draw, browsers, notebooks, pages, costs, drawn scenarios, mutants"
	@echo "make core-test  the core's tests, in a copy without the products"
	@echo "make promises   what is promised, and which tests hold each promise"
	@echo "make acceptance the installed command from outside: every scenario, page and mistake; the longest tests"
	@echo "make cost       what a flight costs beside bare JSBSim: no more than a tenth above the recorded revision?"
	@echo "make waits      how long a person waits for what: one table, beside its bars (WAITS='--beside REVISION': in pairs)"
	@echo "make test-fast  the tests that fly little or nothing: less than a minute"
	@echo "make coverage   the whole test suite, and which lines of Python it has run"
	@echo "make mutants    100 small defects put into the code on purpose: how many of them do tests find?"
	@echo "make drawn      600 scenarios drawn from the schema, flown: does each keep every promise?"
	@echo "make lint       set up and run the linters"
	@echo "make docs       set up and write anew what commands print on the pages: blocks, numbers, pictures"
	@echo "make docs-check does every page still say what its commands print, and does every name on it exist?"
	@echo "make site       set up and build docs/, with reference and notebooks, as a web site in site/"
	@echo "make clean      remove the virtual environment and what runs have written"

# uv unpacks several packages at once and compiles none of them: a fifth of pip's time. It does not read pip's configuration:
# pip installs where that names another index, and where uv is not to be had or does not find everything.
install = @echo "installing $(1) into $(VENV)"; { ! $(PIP) config list | grep -q '[.]index-url=' && $(PIP) install --quiet uv && \
  $(BIN)/uv pip install --quiet --python $(BIN)/python --editable '$(1)'; } 2>/dev/null || $(PIP) install --quiet --editable '$(1)'

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "beaver-ftc needs Python 3.11 or newer; set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: pyproject.toml | $(BIN)/python
	$(call install,.)
	touch $@

# What the first tests of `make test` need: it brings the rest while they run.
$(VENV)/.test: pyproject.toml | $(BIN)/python
	$(call install,.[test])
	touch $(VENV)/.demo $@

# Without the package itself, which tests that run meanwhile import.
$(VENV)/.dev: pyproject.toml | $(VENV)/.test
	@echo "installing what development needs besides"; $(BIN)/python -m tools.requirements dev >$(VENV)/dev.txt
	@{ test -x $(BIN)/uv && $(BIN)/uv pip install --quiet --python $(BIN)/python --requirement $(VENV)/dev.txt; } 2>/dev/null || \
	  $(PIP) install --quiet --requirement $(VENV)/dev.txt
	touch $@

demo: $(VENV)/.demo
	$(BIN)/beaver-ftc run elevator-partial-loss --out runs
	@echo "report: runs/elevator-partial-loss/report.html"

# What most flights use is compiled, and what is missing installed, while plain kernels are tried, in one process:
# the other processor is busy. The second run waits for both, and compiles the rest.
test: $(VENV)/.test
	@$(BRING) & installing=$$!; $(BIN)/python tests/warm.py >/dev/null 2>&1 & \
	  NUMBA_DISABLE_JIT=1 $(PYTEST) -n 0 -m "not nightly and not acceptance" $(PLAIN) && wait $$installing && wait
	$(PYTEST) -m "not nightly and not acceptance" $(addprefix --ignore=,tests/acceptance $(PLAIN))

# Every test with all that it draws, what tests/nightly.yaml lists too; then pages, costs, drawn scenarios, mutants.
nightly: $(VENV)/.dev
	BEAVER_FTC_NIGHT=1 NUMBA_DISABLE_JIT=1 $(PYTEST) $(PLAIN)
	BEAVER_FTC_NIGHT=1 $(PYTEST) -m "not acceptance" $(addprefix --ignore=,tests/acceptance $(PLAIN))
	BEAVER_FTC_NIGHT=1 $(MAKE) acceptance
	$(MAKE) docs-check
	$(MAKE) cost
	$(MAKE) core-test
	$(BIN)/python -m tools.arithmetics
	$(BIN)/python -m tools.drawn
	$(BIN)/python -m tools.mutants --seed $(SEED)

OF_THE_CORE = $(filter-out tests/products/% tests/tools/%,$(PLAIN))

# The core knows none of the products beside it: its tests pass in a copy that has them not.
core-test: $(VENV)/.dev
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m tools.core_alone -n $(WORKERS) --dist loadfile -m "not nightly" $(OF_THE_CORE)
	$(BIN)/python -m tools.core_alone -n $(WORKERS) --dist loadfile -m "not nightly" $(addprefix --ignore=,$(OF_THE_CORE))

check: $(VENV)/.dev
	$(BIN)/python -m tools.check

promises: $(VENV)/.dev
	$(BIN)/python -m tools.promises

plain:
	@echo $(PLAIN)

# One file has most of it: its tests are shared out.
acceptance: $(VENV)/.dev
	$(PYTEST) --dist worksteal -m acceptance

cost: $(VENV)/.dev
	$(BIN)/python benchmarks/flight_cost.py --rounds 8 --check benchmarks/ratios.json

waits: $(VENV)/.dev
	$(BIN)/python benchmarks/waits.py $(WAITS)

test-fast: $(VENV)/.dev
	$(PYTEST) -m "not nightly and not acceptance" $(FAST)

# Compiled kernels and commands that tests start as processes are not seen: what is counted is Python in the tests.
coverage: $(VENV)/.dev
	$(PYTEST) --cov --cov-report=term:skip-covered

mutants: $(VENV)/.dev
	$(BIN)/python -m tools.mutants --seed $(SEED)

drawn: $(VENV)/.dev
	$(BIN)/python -m tools.drawn

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m tools.words
	$(BIN)/mypy

docs: $(VENV)/.dev
	$(BIN)/python -m tools.docs

docs-check: $(VENV)/.dev
	$(BIN)/python -m tools.docs --check

$(VENV)/.site: $(VENV)/.demo
	$(call install,.[docs])
	touch $@

site: $(VENV)/.site
	$(BIN)/python -m mkdocs build --quiet --strict

clean:
	rm -rf $(VENV) site .coverage .mutants runs sweeps .pytest_cache .hypothesis .mypy_cache .ruff_cache
