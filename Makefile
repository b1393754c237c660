# SPDX-License-Identifier: Apache-2.0
# make demo   break a rack over ROS 2 and watch it
# make test   every check
# make soak   tens of thousands of random scenes to rest, with a progress bar; a quarter of an hour
# make endurance  three hours of simulated shots, a flood, kills and late joiners of a running table; five minutes
# make clean  remove what the two have made
#
# Needs Python 3.10 or newer with venv; PYTHON=... names another one. Everything else goes into .venv.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

# Test files run in as many processes as there are cores; the tests of a file share what it sets up.
SIDE_BY_SIDE := --numprocesses=auto --maxprocesses=4 --dist=loadfile

# A sourced ROS installation must not mix with the wheels in .venv.
unexport PYTHONPATH LD_LIBRARY_PATH AMENT_PREFIX_PATH RMW_IMPLEMENTATION

.PHONY: demo test soak endurance clean
.DELETE_ON_ERROR:

demo: $(VENV)/.installed
	@$(RUN) -m billiards_sim demo

test: $(VENV)/.installed-test
	@echo "== ruff"
	@$(RUN) -m ruff check .
	@$(RUN) -m ruff format --check .
	@echo "== mypy"
	@$(RUN) -m mypy
	@echo "== pytest: the engine, interpreted"
	@NUMBA_DISABLE_JIT=1 $(RUN) -m pytest -q $(SIDE_BY_SIDE) test/engine
	@echo "== pytest: everything, the engine compiled"
	@$(RUN) -m pytest -q $(SIDE_BY_SIDE) --durations=10

soak: $(VENV)/.installed-test
	@$(RUN) test/engine/soak.py

endurance: $(VENV)/.installed-test
	@$(RUN) test/ros/endurance.py

clean:
	@rm -rf $(VENV) build install log *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || \
		{ echo "make: $(PYTHON) is not Python 3.10 or newer; name one with make PYTHON=python3.x" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "make: $(PYTHON) lacks venv; install it (Debian and Ubuntu: apt install python3-venv)" >&2; exit 1; }
	@echo "== making a virtual environment in $(VENV)"
	@rm -rf $(VENV)
	@$(PYTHON) -m venv $(VENV)
	@touch $(VENV)/COLCON_IGNORE $@

$(VENV)/.installed: $(VENV)/.made setup.py
	@echo "== installing billiards_sim with the ROS 2 wheels and Numba (about a minute, 400 MB)"
	@$(RUN) -m pip install -qq --disable-pip-version-check -e '.[ros,fast]'
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	@echo "== installing the test tools (about half a minute)"
	@$(RUN) -m pip install -qq --disable-pip-version-check -e '.[test]'
	@touch $@
