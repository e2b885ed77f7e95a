#!/bin/sh
# tools/install-onboard.sh PREFIX
# Install what runs in the vehicle into PREFIX, an absent or empty folder, and compile its kernels there,
# so that a start compiles nothing, and PREFIX may be read-only. Run it as the user that will run the daemon, or as
# root; the compiled kernels in PREFIX/cache are read by all. Needs no root and leaves nothing elsewhere.
set -eu
die() { echo "install-onboard: $*" >&2; exit 2; }

[ $# -eq 1 ] || die "usage: tools/install-onboard.sh PREFIX"
mkdir -p "$1" || die "$1: cannot be made; choose a folder that you may write to"
prefix=$(cd "$1" && pwd)
[ -z "$(ls -A "$prefix")" ] || die "$prefix: not empty; remove it or choose another folder"
source=$(cd "$(dirname "$0")/.." && pwd)
python=$(sh "$source/tools/find-python.sh") || exit 2

build=$(mktemp -d)
trap 'rm -rf "$build"' EXIT
pip="-m pip --disable-pip-version-check --no-cache-dir --quiet"

echo "Building the package"
"$python" -m venv "$build/venv"
"$build/venv/bin/python" $pip install --no-deps --require-hashes --requirement "$source/requirements/build.txt"
"$build/venv/bin/python" $pip wheel --no-deps --no-build-isolation --wheel-dir "$build" "$source"

echo "Installing into $prefix"
"$python" -m venv "$prefix"
"$prefix/bin/python" $pip install --no-deps --require-hashes --requirement "$source/requirements/onboard.txt"
"$prefix/bin/python" $pip install --no-deps "$build"/brake_ecu-*.whl

# Compiled for any processor of this architecture: the image may run on another machine than built it.
cat > "$prefix/bin/brake-ecu" <<LAUNCHER
#!/bin/sh
[ -n "\${NUMBA_CACHE_DIR:-}" ] || NUMBA_CACHE_DIR='$prefix/cache'
export NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR
exec '$prefix/bin/python' -P -m ecu.cli "\$@"
LAUNCHER

echo "Compiling the kernels"
export NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR="$prefix/cache"
mkdir "$NUMBA_CACHE_DIR"
"$prefix/bin/python" -P -m ecu.warm
chmod -R a+rX,go-w "$NUMBA_CACHE_DIR"
echo "Done: $prefix/bin/brake-ecu; next: $prefix/bin/brake-ecu doctor --config suv -i socketcan -c can0"
