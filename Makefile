# make demo | test | check | clean. Sets up .venv itself; PYTHON=... chooses the interpreter.
PIP := .venv/bin/python -m pip --disable-pip-version-check install --quiet
PINNED := $(PIP) --require-hashes --requirement requirements/build.txt

.PHONY: help demo test check clean

help:
	@echo "make demo    the ECU brakes a simulated car on a bus, in real time; a report at the end"
	@echo "make test    every test"
	@echo "make check   ruff, format and types"
	@echo "make clean   remove .venv, results and caches"
	@echo "The first call installs what it needs into .venv. PYTHON=/path/to/python3.12 chooses a Python;"
	@echo "ARGS=... goes to the command: make test ARGS=tests/ecu, make demo ARGS='--out out/first'."

demo: .venv/lab
	.venv/bin/brake-ecu demo $(ARGS)

test: .venv/dev
	.venv/bin/python -m pytest -n $$(($$(nproc) + 1)) --maxprocesses 5 --dist loadgroup $(ARGS)

check: .venv/dev
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

clean:
	rm -rf .venv out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/bin/pip:
	@python=$$(sh tools/find-python.sh) && echo "Making .venv with $$python" \
		&& { "$$python" -m venv .venv || { rm -rf .venv; exit 1; }; }

.venv/lab: requirements/build.txt requirements/lab.txt pyproject.toml tools/pyproject.toml | .venv/bin/pip
	@echo "Installing what the laboratory needs into .venv (once)"
	@$(PINNED) --requirement requirements/lab.txt
	@$(PIP) --no-deps --no-build-isolation --editable . --editable tools
	@touch $@

# The development set holds the laboratory's at the same versions.
.venv/dev: requirements/build.txt requirements/dev.txt pyproject.toml tools/pyproject.toml | .venv/bin/pip
	@echo "Installing what the tests need into .venv (once)"
	@$(PINNED) --requirement requirements/dev.txt
	@$(PIP) --no-deps --no-build-isolation --editable . --editable tools
	@touch .venv/lab $@
