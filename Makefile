# `make demo` and `make test` are all that a newcomer needs: each makes its own
# virtual environment in .venv and installs what it needs there.
VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin
export JAX_PLATFORMS ?= cpu

.PHONY: demo test test-all test-slow faults regression-update extremes lint docs check bench bench-tradeoff bench-footprint bench-large-image bench-step-cloud clean

demo: $(VENV)/installed
	$(BIN)/cloudjax demo -o out/demo

test: $(VENV)/installed-dev
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder \
		-m "not slow and not long"

# What must pass before a change lands.
test-all: $(VENV)/installed-dev
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder \
		-m "not slow"

test-slow: $(VENV)/installed-dev
	XLA_FLAGS="$(XLA_FLAGS)" $(BIN)/python -m pytest -m slow --note-slow-passes

# Plants the faults of tests/faults.toml in a copy, and says which the tests do not find.
faults: $(VENV)/installed-dev
	$(BIN)/python -m tools.plant_faults

# Replaces the results that tests/regression has stored, and says what moved by how much.
regression-update: $(VENV)/installed-dev
	$(BIN)/python -m pytest tests/regression --regression-update

# Measures the table of docs/accuracy/extremes.md anew.
extremes: $(VENV)/installed-dev
	$(BIN)/python -m tools.make_extremes

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright --pythonpath $(BIN)/python

# The site is written to out/site; nothing is asked of the network while it is built.
docs: $(VENV)/installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet
	$(BIN)/python tools/site/check.py out/site

check: lint test-all docs

bench: $(VENV)/installed-peers
	$(BIN)/python benchmarks/bench.py -o out/bench

# WEATHER: a global analysis; SCENE, NIGHT: folders of ABI files by day and by night.
bench-tradeoff: $(VENV)/installed
	$(BIN)/python -m benchmarks.fronts --weather $(WEATHER) --scene $(SCENE) -o out/fronts
	$(BIN)/python -m benchmarks.promise --weather $(WEATHER) --scene $(NIGHT) -o out/promise
	$(BIN)/python -m benchmarks.fit_trade -o out/fit_trade

bench-footprint: $(VENV)/installed
	$(BIN)/python benchmarks/footprint.py -o out/footprint

bench-large-image: $(VENV)/installed
	$(BIN)/python benchmarks/large_image.py -o out/large_image

# CLOUDJAX_DATA: where the consensus results are (README of the I3RC).
bench-step-cloud: $(VENV)/installed
	$(BIN)/python benchmarks/step_cloud.py $(CLOUDJAX_DATA)/i3rc_case1/consensus_results

$(BIN)/python:
	PYTHON="$(PYTHON)" tools/make_venv.sh $(VENV)

$(VENV)/installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/installed-dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable . --group test --group oracles --group tools --group lint --group docs
	touch $@ $(VENV)/installed $(VENV)/installed-docs

$(VENV)/installed-peers: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable . --group peers
	touch $@ $(VENV)/installed

$(VENV)/installed-docs: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --group docs
	touch $@

clean:
	rm -rf $(VENV) out build dist
