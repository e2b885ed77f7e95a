# make demo | test | studies | check | coverage | mutants | fuzz | soak | results | screenshot | clean. Sets up .venv itself; PYTHON=... chooses the interpreter.
PIP := .venv/bin/python -m pip --disable-pip-version-check install --quiet
# A worker a core: threads of a library would wait for the core of another worker.
test studies coverage: export OPENBLAS_NUM_THREADS = 1
# Kept for the next run: modules, and tests as pytest rewrites them.
test studies coverage mutants fuzz: export PYTHONDONTWRITEBYTECODE =
PINNED := $(PIP) --no-compile --no-deps --require-hashes --requirement requirements/build.txt
# What pip would do on one core; a file that is no Python of this version stays as it is.
BYTECODE := .venv/bin/python -m compileall -qq -j 0 -x /tests/ .venv/lib || true

.PHONY: help demo test studies check coverage mutants fuzz soak results screenshot clean

help:
	@echo "make demo    the ECU brakes a simulated car on a bus, in real time; a report at the end"
	@echo "make test    what brakes a car, and each command of the laboratory once: five minutes on two cores"
	@echo "make studies   the rest of the laboratory: many cars, laws found by search, programs of others"
	@echo "make check   ruff, format and types"
	@echo "make coverage  lines and branches of ecu/algorithm/control, failed_brakes.py, inputs.py and ecu/bus, kernels as plain Python: all of them"
	@echo "make mutants   one change at a time in what brakes: which one do the tests not notice? a few minutes"
	@echo "make fuzz      damaged files by the thousand"
	@echo "make soak      24 h in virtual time; ARGS='live --hours 1': in real time"
	@echo "make results  every page of docs/results measured anew: a night; goes on where it was, ARGS='stops bound': some"
	@echo "make screenshot  the pictures of the README and of the first steps, with chromium"
	@echo "make clean   remove .venv, results and caches"
	@echo "The first call installs what it needs into .venv. PYTHON=/path/to/python3.12 chooses a Python;"
	@echo "ARGS=... goes to the command: make test ARGS=tests/ecu, make demo ARGS='--out out/first'."

demo: .venv/lab
	@.venv/bin/python -m brakelab.build
	.venv/bin/brake-ecu demo $(ARGS)

test: .venv/dev
	@.venv/bin/python -m brakelab.build --inner tests/compiled
	.venv/bin/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder -m "not study" $(ARGS)

studies: .venv/dev
	@.venv/bin/python -m brakelab.build --inner tests/compiled
	.venv/bin/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder -m study $(ARGS)

check: .venv/dev
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

coverage: .venv/dev
	NUMBA_DISABLE_JIT=1 .venv/bin/python -m pytest -n auto --maxprocesses 4 \
		tests/ecu/algorithm/control tests/ecu/algorithm/monitoring/test_failed_brakes.py \
		tests/ecu/algorithm/test_inputs.py tests/ecu/bus $(ARGS) --cov

mutants: .venv/dev
	.venv/bin/python tools/mutate.py $(ARGS)

fuzz: .venv/dev
	FUZZ_CASES=3000 .venv/bin/python -m pytest -n auto --maxprocesses 4 tests/test_fuzz.py tests/ecu/algorithm/test_step_extremes.py $(ARGS)

soak: .venv/dev
	.venv/bin/python -m brakelab.rig.soak $(or $(ARGS),virtual --hours 24)

results: .venv/dev
	@.venv/bin/python -m brakelab.build
	.venv/bin/python tools/measure_results.py $(ARGS)

screenshot: .venv/lab
	.venv/bin/brake-ecu demo --out out/screenshot
	$$(command -v chromium || command -v chromium-browser) --headless --no-sandbox --disable-gpu --hide-scrollbars \
		--virtual-time-budget=10000 --window-size=1000,1200 --screenshot=docs/images/report.png \
		"file://$(CURDIR)/out/screenshot/report.html"
	.venv/bin/python tools/first_steps.py

clean:
	rm -rf .venv out build dist ecu/compiled tools/brakelab/compiled tests/compiled .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/bin/pip:
	@python=$$(sh tools/find-python.sh) && echo "Making .venv with $$python" \
		&& { "$$python" -m venv .venv || { rm -rf .venv; exit 1; }; }

.venv/lab: requirements/build.txt requirements/lab.txt pyproject.toml tools/pyproject.toml | .venv/bin/pip
	@echo "Installing what the laboratory needs into .venv (once)"
	@$(PINNED) --requirement requirements/lab.txt
	@$(BYTECODE)
	@$(PIP) --no-deps --no-build-isolation --editable . --editable tools
	@touch $@

# The development set holds the laboratory's at the same versions.
.venv/dev: requirements/build.txt requirements/dev.txt pyproject.toml tools/pyproject.toml | .venv/bin/pip
	@echo "Installing what the tests need into .venv (once)"
	@$(PINNED) --requirement requirements/dev.txt
	@$(BYTECODE)
	@$(PIP) --no-deps --no-build-isolation --editable . --editable tools
	@touch .venv/lab $@
