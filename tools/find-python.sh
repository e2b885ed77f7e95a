#!/bin/sh
# Print a Python that the project runs on, or say on standard error what is missing.
# PYTHON=... names the one to take.
found=
bare=
for candidate in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
    version=$("$candidate" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])' 2>/dev/null) || continue
    case $version in
        3.11.* | 3.12.* | 3.13.* | 3.14.*)
            if "$candidate" -c 'import ensurepip, venv' 2>/dev/null; then
                echo "$candidate"
                exit 0
            fi
            case "$bare " in *" $version "*) ;; *) bare="$bare $version" ;; esac
            ;;
        *) found="$found $version" ;;
    esac
done
if [ -n "$bare" ]; then
    echo "install python3-venv: Python$bare cannot make virtual environments (Debian, Ubuntu: sudo apt-get install python3-venv)" >&2
else
    echo "Python 3.11–3.14 needed, found${found:- none}${PYTHON:+ (PYTHON=$PYTHON)}; PYTHON=/path/to/python3.12 names another" >&2
fi
exit 1
