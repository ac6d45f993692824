# `make demo` and `make test` need Python 3.11+ and make; everything else is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test check format bench fuzz lock clean

demo: $(READY)
	$(BIN)/talkdown demo

test: $(READY)
	$(BIN)/python -m pytest -n 2 --dist loadfile

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(MAKE) --no-print-directory test

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(READY)
	$(BIN)/python -m bench

# Mutated datagrams and files through every door from bytes: first by a fuzzer of our own, then guided by coverage where
# atheris installs. A few minutes; the long run: make fuzz DATAGRAMS=10000000 FILES=1000 SECONDS_A_DOOR=600
DATAGRAMS ?= 1000000
FILES ?= 200
SEED ?= 1
SECONDS_A_DOOR ?= 20
fuzz: $(READY)
	$(BIN)/python tests/fuzz/run.py --datagrams $(DATAGRAMS) --files $(FILES) --seed $(SEED)
	@$(BIN)/python -c 'import atheris' 2>/dev/null || $(BIN)/python -m pip install --quiet --disable-pip-version-check 'atheris>=3.0' \
		|| { echo 'atheris does not install here: nothing was guided by coverage.'; exit 0; }; \
	for door in live tlog pcap pcapng BIN ulg plan waypoints; do \
		$(BIN)/python tests/fuzz/atheris_wires.py $$door -max_total_time=$(SECONDS_A_DOOR) -verbosity=0 || exit 1; \
	done

# Pins every package, of the program and of its development, to what was tested.
lock:
	$(PYTHON) -m venv .lock-venv
	.lock-venv/bin/pip install --quiet --upgrade pip pip-tools
	.lock-venv/bin/pip-compile --quiet --strip-extras --extra dev --no-emit-index-url --no-emit-find-links \
		--no-emit-trusted-host --no-header --output-file requirements.lock pyproject.toml
	rm -rf .lock-venv

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis build *.egg-info

$(READY): pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Talkdown needs Python 3.11 or newer; say which with: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $(READY)
