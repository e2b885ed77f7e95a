#!/bin/sh
# tools/lock.sh [--upgrade]
# Renew requirements/*.txt from pyproject.toml: versions and hashes for every supported Python, and no
# address of where they came from. Needs uv.
set -eu
cd "$(dirname "$0")/.."
command -v uv >/dev/null || { echo "lock: install uv (pip install uv)" >&2; exit 2; }
lock() {
    output=requirements/$1.txt
    shift
    uv pip compile "$@" --quiet --universal --python-version 3.11 --generate-hashes \
        --no-emit-index-url --no-emit-find-links --no-header --no-annotate --output-file "$output"
}
printf 'hatchling\neditables\n' | lock build - "$@"
lock dev pyproject.toml --extra dev "$@"
lock lab pyproject.toml --extra lab --constraint requirements/dev.txt
printf 'prometheus-client\n' | lock metrics - --constraint requirements/dev.txt
lock onboard pyproject.toml --constraint requirements/dev.txt
lock compiler pyproject.toml --extra compiler --constraint requirements/dev.txt --no-emit-package numpy
echo "Now install requirements/dev.txt and run: python tools/write_third_party.py && python tools/write_sbom.py"
