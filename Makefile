# `make demo` and `make test` need nothing but python3 >= 3.11 (Debian: apt-get install python3-venv make).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
ARGS ?=

.PHONY: help setup demo test test-opencv4 test-clients engines lint lock schemas bench clean

help:
	@echo "make demo     two feet tracked on simulated hardware (options: make demo ARGS='--seconds 30 --task line')"
	@echo "make test     lint, types, import directions and the whole test suite"
	@echo "make engines  install what optional tests need, as far as it can be (Godot, mono, libraries)"
	@echo "make test-clients  the same, and the clients' tests alone"
	@echo "make test-opencv4  the camera's tests with OpenCV 4.14 instead of the lock's 5"
	@echo "make lint     ruff, mypy --strict, import directions"
	@echo "make bench    latency and throughput beside their floors"
	@echo "make schemas  regenerate protocol/schema, protocol/vectors and the tables in SPEC.md"
	@echo "make lock     resolve the dependencies anew (needs uv)"

setup: $(STAMP)

$(STAMP): requirements-dev.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "foottrack needs python3 >= 3.11; this is $$($(PYTHON) --version). Try: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { echo "python3 lacks venv. On Debian: apt-get install python3-venv"; exit 1; }
	@echo "Setting up $(VENV) from requirements-dev.lock (once, a minute or so) ..."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

demo: setup
	$(BIN)/foottrack demo $(ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/hadolint docker/Dockerfile

# Two kinds of tests at once: those that wait (integration, clients) and those that compute.
test: lint
	$(BIN)/foottrack compile
	$(BIN)/pytest -n auto --dist loadgroup $(ARGS)

# What cannot be installed here is no failure: its tests are skipped, and say so.
engines:
	-tests/clients/install_godot.sh
	-tests/clients/install_mono.sh
	-tests/install_libraries.sh

test-clients: setup engines
	$(BIN)/pytest tests/clients $(ARGS)

# The lock has OpenCV 5; the oldest that is supported is put beside it, and before it on the path.
OPENCV4 := .opencv4
test-opencv4: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --upgrade --target $(OPENCV4) "opencv-contrib-python-headless==4.14.*"
	PYTHONPATH=$(CURDIR)/$(OPENCV4) $(BIN)/python -c 'import cv2; print("OpenCV", cv2.__version__); assert cv2.__version__.startswith("4.14")'
	PYTHONPATH=$(CURDIR)/$(OPENCV4) $(BIN)/pytest tests/unit/camera tests/real/test_camera_photos.py tests/integration/test_camera_cli.py $(ARGS)

bench: setup
	$(BIN)/foottrack bench $(ARGS)

schemas: setup
	$(BIN)/python -m foottrack_protocol.generate

lock:
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 pyproject.toml --group dev --extra realsense --extra openvr --extra openxr -o requirements-dev.lock
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 pyproject.toml -c requirements-dev.lock -o requirements.lock

clean:
	rm -rf $(VENV) $(OPENCV4) .mypy_cache .ruff_cache .pytest_cache .hypothesis build dist
