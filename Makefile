# Needs Python 3.11 or later, with its venv module, and make; everything else goes into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CONFIG ?= configs/two_cantilevers.yaml
OUT ?= results
JOBS ?= 2
NOTEBOOKS ?= force

.PHONY: run test test-slow test-kernels test-docs lowest pythons fuzz bench mutants peers campaign docs lint clean

run: $(VENV)/.installed
	@$(BIN)/romdam run $(CONFIG) --out $(OUT)
	@echo "How far is that from the unreduced mesh? Running both on the first 10 s (about a minute) ..."
	@$(BIN)/romdam verify $(CONFIG) --duration "10 s" --out $(OUT)
	@echo "And how far is the mesh from a finer one?"
	-@$(BIN)/romdam verify $(CONFIG) --mesh finer --duration "10 s" --out $(OUT)
	@echo "Results, figures and the error statement are in $(OUT)/ ; read $(OUT)/*.nc with xarray."

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal

test-slow: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -q -m slow

# The last bit of a product depends on the processor: what branches on it must not, whatever the kernel. Tests
# of how laws are read and compiled make no such product.
KERNEL_TESTS := tests/contact tests/reduction tests/timestepping $(addprefix --ignore=tests/contact/,test_laws.py test_law_outside.py test_law_protocol.py)

test-kernels: $(VENV)/.installed-dev
	@kernels=$$($(BIN)/python .ci/kernels.py) || exit 1; for kernel in $$kernels; do \
	  echo "OPENBLAS_CORETYPE=$$kernel"; \
	  OPENBLAS_CORETYPE=$$kernel $(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal $(KERNEL_TESTS) || exit 1; done

# The lowest versions that pyproject.toml allows: an example from nothing, and what meets libraries most.
lowest: $(VENV)-lowest/.installed
	@mkdir -p $(OUT)/lowest
	cd $(OUT)/lowest && $(CURDIR)/$(VENV)-lowest/bin/romdam init two_cantilevers
	cd $(OUT)/lowest && $(CURDIR)/$(VENV)-lowest/bin/romdam run two_cantilevers.yaml --out results
	$(VENV)-lowest/bin/python -m pytest -q -n $(JOBS) --dist worksteal tests/config tests/records tests/results tests/test_examples.py tests/test_compiled.py

$(VENV)-lowest/.installed: pyproject.toml .ci/lowest.py | $(VENV)/bin/python
	$(PYTHON) -m venv $(VENV)-lowest
	$(BIN)/python .ci/lowest.py dev suites > $(VENV)-lowest/constraints.txt
	$(VENV)-lowest/bin/python -m pip install -q --disable-pip-version-check --only-binary :all: --no-binary romdam \
	  -c $(VENV)-lowest/constraints.txt -e ".[dev,suites]"
	@touch $@

# Other Pythons that are at hand: an example from a wheel in an empty environment, a minute each.
PYTHONS ?= python3.12 python3.13
pythons:
	@for python in $(PYTHONS); do \
	  $$python --version 2> /dev/null || { echo "$$python is not here"; continue; }; \
	  rm -rf $(OUT)/python && $$python -m venv $(OUT)/python && $(OUT)/python/bin/python -m pip install -q . && \
	  $(OUT)/python/bin/romdam init two_cantilevers --out $(OUT)/python/first && \
	  $(OUT)/python/bin/romdam run $(OUT)/python/first/two_cantilevers.yaml --out $(OUT)/python/results || exit 1; done

# Damaged records, meshes, configurations, caches, results, suites and disks, seeded: some minutes.
fuzz: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal tests/fuzz --fuzz

# Speed beside error, printed and written as JSON; a benchmark never fails on time.
bench: $(VENV)/.installed-dev
	@mkdir -p $(OUT)
	@for bench in tests/benchmarks/bench_*.py; do \
	  $(BIN)/python $$bench --out $(OUT)/$$(basename $$bench .py).json || exit 1; done

# Faults planted one by one into a copy of the tree, and whether the tests notice: half an hour.
mutants: $(VENV)/.installed-dev
	@mkdir -p $(OUT)
	$(BIN)/python tests/benchmarks/mutants.py --out $(OUT)/mutants.json

# OpenSees and Exudyn in an environment of their own, CalculiX where Debian's calculix-ccx is, beside romdam: half an hour.
peers: $(VENV)/.installed-dev $(VENV)-peers/.installed
	@command -v ccx > /dev/null || echo "CalculiX is not here and gets no row: apt-get install calculix-ccx"
	$(BIN)/python tests/benchmarks/peers.py --out $(OUT)/peers --peers $(VENV)-peers/bin/python

$(VENV)-peers/.installed: | $(VENV)/bin/python
	$(PYTHON) -m venv $(VENV)-peers
	$(VENV)-peers/bin/python -m pip install -q --disable-pip-version-check openseespy exudyn
	@touch $@

# All 100 FEMA P-695 components x friction x stiffness, 400 runs: half an hour on two cores.
campaign: $(VENV)/.installed-dev
	$(BIN)/python tests/benchmarks/campaign.py --jobs $(JOBS) --out $(OUT)/campaign.json

# With it every code block of README.md and docs/ has run, and the tutorials from a wheel in an empty environment.
test-docs: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal -m slow tests/docs

# The manual, as pages in docs/_build; a warning is an error. NOTEBOOKS=off leaves the tutorials without outputs.
docs: $(VENV)/.installed-dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m sphinx -q -W --keep-going -D nb_execution_mode=$(NOTEBOOKS) \
	  -b html docs docs/_build

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy romdam $$(find tests -name '*.py' ! -name 'test_*' ! -name conftest.py ! -name __init__.py)

clean:
	rm -rf $(VENV) $(OUT) build dist docs/_build docs/generated docs/jupyter_execute *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or later is needed, this is " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)

# The stamps make a second call install nothing; they follow pyproject.toml. A wheel is compiled to bytecode as pip
# installs it; a checkout is not, and with PYTHONDONTWRITEBYTECODE each start would compile all of it, 0.6 CPU-s.
$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	@echo "Installing romdam into $(VENV) ..."
	@$(BIN)/python -m pip install -q --disable-pip-version-check -e .
	@$(BIN)/python -m compileall -q romdam pipelines
	@touch $@

$(VENV)/.installed-dev: pyproject.toml | $(VENV)/bin/python
	@echo "Installing romdam and its development tools into $(VENV) ..."
	@$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[dev,suites,bench,docs]"
	@$(BIN)/python -m compileall -q romdam pipelines
	@touch $@ $(VENV)/.installed
