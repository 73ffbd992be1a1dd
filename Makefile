# A machine without ROS needs git, make and python3 with venv; everything else is fetched into .venv, pinned.
PYTHON ?= python3
RUN := scripts/run

.DELETE_ON_ERROR:
.PHONY: setup demo test lint bench bench-naming soak docs

setup: install/.built                 ## .venv with ROS 2 and all dependencies, and the colcon build
demo: setup ; @$(RUN) python examples/demo $(DEMO)
test: setup .venv/.checked ; @$(RUN) python -m pytest -n 4 --dist loadgroup --max-worker-restart 2 $(TEST)
lint: setup ; @scripts/lint
bench: setup .venv/.checked ; @$(RUN) python -m benchmarks $(BENCH)
bench-naming: setup ; @$(RUN) python -m benchmarks.naming $(BENCH)
soak: setup ; @$(RUN) python -m benchmarks.soak $(SOAK)
docs: setup ; @$(RUN) python docs/generate.py && scripts/docs

.venv/.installed: requirements.txt constraints.txt ; @scripts/setup $(PYTHON) && touch $@
.venv/.checked: .venv/.installed requirements-rerun.txt requirements-fmu.txt requirements-s3.txt ; @scripts/setup-checks && touch $@
install/.built: .venv/.installed package.xml setup.py setup.cfg $(wildcard config/* launch/*) ; @scripts/build && touch $@
