#!/bin/sh
# tools/install-onboard.sh [--metrics] PREFIX
# Install what runs in the vehicle into PREFIX, an absent or empty folder, with its kernels as a library made
# here: a start compiles nothing and needs no compiler, and PREFIX may be read-only. Run it as the user that
# will run the daemon, or as root. Needs a C compiler but no root, and leaves nothing elsewhere.
# --metrics: with what `run --metrics-port` needs.
set -eu
die() { echo "install-onboard: $*" >&2; exit 2; }

metrics=
[ "${1-}" != --metrics ] || { metrics=metrics; shift; }
[ $# -eq 1 ] || die "usage: tools/install-onboard.sh [--metrics] PREFIX"
mkdir -p "$1" || die "$1: cannot be made; choose a folder that you may write to"
prefix=$(cd "$1" && pwd)
[ -z "$(ls -A "$prefix")" ] || die "$prefix: not empty; remove it or choose another folder"
source=$(cd "$(dirname "$0")/.." && pwd)
python=$(sh "$source/tools/find-python.sh") || exit 2
command -v "${CC:-cc}" >/dev/null || die "needs a C compiler: install gcc and libc6-dev, or set CC"

build=$(mktemp -d)
trap 'rm -rf "$build"' EXIT
pip="-m pip --disable-pip-version-check --no-cache-dir --quiet"

echo "Installing what makes the library of kernels"
"$python" -m venv "$build/venv"
for requirement in build onboard compiler; do
    "$build/venv/bin/python" $pip install --no-deps --require-hashes \
        --requirement "$source/requirements/$requirement.txt"
done
mkdir "$build/source"
(cd "$source" && tar --exclude=./.git --exclude=./.venv --exclude=./out --exclude=compiled -cf - .) |
    tar -C "$build/source" -xf -
(cd "$build/source" && "$build/venv/bin/python" -m ecu.build --all)
echo "Building the package"
"$build/venv/bin/python" $pip wheel --no-deps --no-build-isolation --wheel-dir "$build" "$build/source"

echo "Installing into $prefix"
"$python" -m venv "$prefix"
for requirement in onboard $metrics; do
    "$prefix/bin/python" $pip install --no-deps --require-hashes \
        --requirement "$source/requirements/$requirement.txt"
done
"$prefix/bin/python" $pip install --no-deps "$build"/brake_ecu-*.whl
"$prefix/bin/python" -P -m ecu.warm --check
echo "Done: $prefix/bin/brake-ecu; next: $prefix/bin/brake-ecu doctor --config suv -i socketcan -c can0"
