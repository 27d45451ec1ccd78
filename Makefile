# make push: one command from a fresh clone to a robot that learnt from a video.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin

.PHONY: push reach test slow peers cluster bench lab notebooks book clean

push reach: $(VENV)/ready
	$(BIN)/python -m tasks $@

test: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q -n auto --dist loadfile -m "not slow and not peers"

slow: $(VENV)/ready
	$(BIN)/python -m pytest -q -m slow

peers: .venv-peers/ready-peers
	.venv-peers/bin/python -m pytest -q -m peers

cluster: $(VENV)/ready
	$(BIN)/pip install -q -r requirements-cluster.txt
	$(BIN)/python -m pytest -q tests/test_cluster.py

bench: $(VENV)/ready
	$(BIN)/python -m tasks bench

lab: $(VENV)/ready
	$(BIN)/jupyter lab --notebook-dir=.

notebooks: $(VENV)/ready
	$(BIN)/python -m solutions release

book: $(VENV)/ready
	$(BIN)/python -m solutions book

$(VENV)/ready: requirements.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 10) <= v <= (3, 11) else \
	    "Python %d.%d: PyBullet has wheels for Python 3.10 and 3.11 only; use make PYTHON=python3.11" % v)'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q -r requirements.txt
	touch $@

.venv-peers/ready-peers: requirements.txt requirements-peers.txt | $(VENV)/ready
	$(BIN)/python -m venv .venv-peers
	.venv-peers/bin/pip install -q -r requirements.txt -r requirements-peers.txt
	touch $@

clean:
	rm -rf $(VENV) .venv-peers runs .pytest_cache .ruff_cache .mypy_cache
