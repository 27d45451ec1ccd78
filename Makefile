# make push: one command from a fresh clone to a robot that learnt from a video.
VENV ?= .venv
BIN = $(VENV)/bin
# The first of these that runs and is a Python the kit promises.
PROMISED = import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))
PYTHON ?= $(shell for p in python3 python3.11 python3.12 python3.13 python; do \
    $$p -c '$(PROMISED)' 2>/dev/null && echo $$p && break; done)
# The exact set that the kit's tests run with; `make push LOCK=` takes the newest releases instead.
LOCK ?= -c requirements-lock.txt
# An index of PyTorch's CPU builds, see README; without one pip takes what it takes by default. It
# gives torch alone, since it need not have the lock's versions of what torch depends on.
TORCH_INDEX ?=
PIP = $(BIN)/python -m pip install --disable-pip-version-check

.PHONY: push reach install test slow peers cluster mutants bench lab notebooks book builds resolve \
    lock clean

push reach: $(VENV)/ready
	$(BIN)/python -m tasks $@

install: $(VENV)/ready
	@echo "Installed. Now type:  . $(BIN)/activate"

test: $(VENV)/ready
	@echo "The tests take 4 to 10 minutes on two cores."
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m pytest -q -rs -n auto --dist loadfile --no-loadscope-reorder \
	    -m "not slow and not peers"

slow: $(VENV)/ready
	$(BIN)/python -m pytest -q -m slow

peers: .venv-peers/ready-peers
	.venv-peers/bin/python -m pytest -q -m peers

cluster: $(VENV)/ready
	@echo "Ray: 80 MB to download."
	$(PIP) -q -r requirements-cluster.txt
	$(BIN)/python -m pytest -q tests/test_cluster.py

# Faults put in on purpose, one at a time, 500 of them: an hour or two; --count 60 takes the first.
mutants: $(VENV)/ready
	$(PIP) -q -r requirements-mutants.txt
	$(BIN)/python -m tests.mutants

bench: $(VENV)/ready
	$(BIN)/python -m tasks bench

# .jupyter hides nbgrader's buttons, which are a lecturer's.
lab: $(VENV)/ready
	JUPYTER_CONFIG_PATH=$(CURDIR)/.jupyter $(BIN)/jupyter lab --notebook-dir=.

notebooks: $(VENV)/ready
	$(BIN)/python -m solutions release

book: $(VENV)/ready
	@echo "All fourteen take 15 to 25 minutes on two cores."
	$(BIN)/python -m solutions book

# Frames and states under both builds of PyBullet: .venv has one, this folder the other.
builds: $(VENV)/ready
	test -d .venv-bullet || $(PIP) -q --no-deps --target .venv-bullet pybullet-arm64==3.2.8
	$(BIN)/python -m pytest -q tests/test_builds.py

# Whether the requirements have an answer on every promised Python and system: nothing is installed.
MACOS = MACOSX_DEPLOYMENT_TARGET=14.0
RESOLVE = $(MACOS) $(BIN)/uv pip compile -q --only-binary :all: --no-header -o /dev/null
resolve: $(VENV)/ready
	$(PIP) -q uv
	@set -e; for lock in "" "-c requirements-lock.txt"; do for system in linux windows macos; do \
	for version in 3.11 3.12 3.13; do \
	    echo "resolves on $$system with Python $$version $$lock"; \
	    $(RESOLVE) $$lock --python-platform $$system --python-version $$version requirements.txt; \
	done; done; done

# Adds to the lock what requirements.txt has come to need, and keeps the versions that are there.
lock: $(VENV)/ready
	$(PIP) -q uv
	$(MACOS) $(BIN)/uv pip compile -q --universal --python-version 3.11 --no-annotate \
	    --custom-compile-command "make lock" -o requirements-lock.txt requirements.txt

$(VENV)/ready: requirements.txt requirements-lock.txt
	@test -n "$(PYTHON)" || { echo "no Python 3.11 to 3.13 here: install one, or name it, as in" \
	    "make push PYTHON=/path/to/python3.12"; exit 1; }
	@$(PYTHON) -c '$(PROMISED)' || { echo "$(PYTHON) is not Python 3.11 to 3.13; name one that is," \
	    "as in make push PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
ifneq ($(TORCH_INDEX),)
	@echo "PyTorch from $(TORCH_INDEX): 0.2 GB for a CPU build."
	$(PIP) --no-deps $(LOCK) torch --index-url $(TORCH_INDEX)
else
	@echo "PyTorch: on Linux pip's default brings CUDA, 2.7 GB to download, some minutes;" \
	    "README says how to take a CPU build, 0.2 GB."
	$(PIP) $(LOCK) torch
endif
	@echo "The rest: 0.3 GB to download, a minute or two."
	$(PIP) -q $(LOCK) -r requirements.txt
	touch $@

.venv-peers/ready-peers: requirements.txt requirements-peers.txt | $(VENV)/ready
	@echo "The other libraries: .venv once more, and 0.5 GB; some minutes."
	$(BIN)/python -m venv .venv-peers
	.venv-peers/bin/pip install -q $(LOCK) -r requirements.txt -r requirements-peers.txt
	touch $@

clean:
	rm -rf $(VENV) .venv-peers .venv-bullet runs build .pytest_cache .ruff_cache .mypy_cache
