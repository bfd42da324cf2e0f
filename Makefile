# `make help` tells what there is. Everything installs into .venv, nothing outside this folder.

PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
CONSOLE := services/overlay/console
PIP := $(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt
SCRIPTS := .ci/run deploy/install

.DEFAULT_GOAL := help
.PHONY: help setup demo up check test test-compose bench bench-classifier bench-simulator fits flight properties people train evaluate picture shapes vehicles lock docs format clean

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-17s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# --- setting up ----------------------------------------------------------------------------------

setup: $(VENV)/.services $(VENV)/.console ## install everything that flies into .venv

$(BIN)/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; v >= (3, 11) or sys.exit("Python 3.11 or newer is needed, this is %d.%d: make PYTHON=/path/to/python3.11" % v)'
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(VENV)/.services: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing the services into $(VENV): about 300 MB once, one or two minutes"
	$(PIP) -e '.[services]'
	@touch $@

# torch comes with this one: an extra that only training and its tests need.
$(VENV)/.all: $(VENV)/.services
	@echo "Installing tests, checks and training into $(VENV): about 400 MB once, gigabytes more where"
	@echo "torch comes with CUDA: PIP_EXTRA_INDEX_URL, set to PyTorch's index of CPU builds, spares them"
	$(PIP) -e '.[services,training,test,check]'
	@touch $@

# aeon 1.6 asks for an older numba than our numpy allows, and runs with the one that is here.
$(VENV)/.evaluation: $(VENV)/.all
	@echo "Installing what other classifiers need into $(VENV): about 150 MB once"
	$(PIP) -e '.[evaluation]'
	$(PIP) --no-deps aeon==1.6.0
	@touch $@

$(VENV)/.console: $(shell find $(CONSOLE) \( -name node_modules -o -name dist \) -prune -o -type f -print 2>/dev/null) | $(BIN)/python
	@if ! command -v npm >/dev/null; then \
	  echo "No Node.js here, so the console is its plain page; Node 20 or newer builds the full one"; \
	elif [ -f $(CONSOLE)/package.json ]; then \
	  echo "Building the console" \
	  && if (cd $(CONSOLE) && npm ci --no-audit --no-fund && npm run build); then touch $@; \
	     else echo "The console could not be built, see above; its plain page is used"; fi; \
	fi

# --- flying --------------------------------------------------------------------------------------

demo: setup ## a simulated operator flies the track; the console is at http://localhost:8080
	$(BIN)/autocomplete demo $(ARGS)

up: setup ## everything on this machine, for you to fly
	$(BIN)/autocomplete up $(ARGS)

# --- proving -------------------------------------------------------------------------------------

check: $(VENV)/.all ## lint, format and types, in under a minute
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/shellcheck $(SCRIPTS)

test: setup $(VENV)/.all ## every test that is not slow, in under 15 minutes on two cores
	$(BIN)/python -m pytest tests -m 'not slow' $(ARGS)

test-compose: setup $(VENV)/.all ## the mission in containers; needs Docker
	$(BIN)/python -m pytest tests/system/test_compose.py -m slow -s $(ARGS)

fits: setup $(VENV)/.all ## fits of hidden shapes beside an oracle, their errors and times
	$(BIN)/python tests/performance/fits.py $(ARGS)

bench: setup $(VENV)/.all ## rates and latencies of the whole chain, as a table
	$(BIN)/python tests/performance/bench.py $(ARGS)

bench-classifier: setup $(VENV)/.all ## how long the classifier takes for one window
	$(BIN)/python tests/performance/inference.py $(ARGS)

bench-simulator: setup $(VENV)/.all ## how fast the simulator is beside others, and 10 minutes of it
	$(BIN)/python tests/performance/simulator.py $(ARGS)

flight: setup $(VENV)/.all ## how closely paths are flown, against other controllers: 20 minutes
	$(BIN)/python tests/performance/flight.py $(ARGS)

properties: setup $(VENV)/.all ## the autopilot's rules in 100 000 random steps, in two minutes
	$(BIN)/python -m pytest tests/unit/autopilot/test_autopilot_properties.py -m slow $(ARGS)

people: setup $(VENV)/.all ## the thesis' SVM on the simulated operators scores as in the thesis
	$(BIN)/python -m pytest tests/unit/training/test_training_generator_calibration.py -m slow $(ARGS)

evaluate: $(VENV)/.evaluation ## every classifier on the same people, against the bars: hours
	$(BIN)/autocomplete evaluate $(ARGS)

# --- making --------------------------------------------------------------------------------------

train: $(VENV)/.all ## train the model anew into models/
	$(BIN)/autocomplete train $(ARGS)

picture: setup $(VENV)/.all ## the README's picture anew: flies the demo and photographs the console
	$(BIN)/python -P docs/picture.py

shapes: $(VENV)/.all ## the figure of what is suggested
	$(BIN)/python -P docs/shapes.py

vehicles: $(VENV)/.all ## the docs' picture of several vehicles
	$(BIN)/python -P docs/vehicles.py

lock: $(BIN)/python ## renew constraints.txt to the newest versions that fit pyproject.toml
	$(BIN)/python -m pip install --quiet pip-tools
	$(BIN)/pip-compile --quiet --all-extras --strip-extras --upgrade --no-header --no-annotate \
	  --no-emit-index-url --no-emit-trusted-host --no-emit-find-links \
	  --output-file $(VENV)/compiled.txt pyproject.toml
	@echo "# Every package at the version that was tested; renewed by 'make lock'." > constraints.txt
	@sed -E '/^#/d; /^$$/d; /^autocomplete-teleoperation/d; s/\+cpu$$//' $(VENV)/compiled.txt >> constraints.txt
	@echo "renewed constraints.txt; now: make test"

docs: setup ## the pages that are made from the code
	$(BIN)/autocomplete contract > docs/contract.md
	$(BIN)/python -m services.autopilot.diagram docs/autopilot.md

format: $(VENV)/.all ## put the code into its format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean: ## remove what was made, and .venv
	rm -rf $(VENV) build *.egg-info .mypy_cache .ruff_cache .hypothesis $(CONSOLE)/node_modules $(CONSOLE)/dist
