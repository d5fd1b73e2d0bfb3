#!/bin/sh
# Make a virtual environment with pip in it: tools/make_venv.sh DIR
# Debian and Ubuntu ship python3 without the module that puts pip there.
set -eu
dir=$1
python=${PYTHON:-python3}

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "cloudjax needs Python 3.11 or later, and $python is $("$python" -V 2>&1)." >&2
    exit 2
}
"$python" -m venv "$dir" >/dev/null 2>&1 && exit 0
rm -rf "$dir"

version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
package="python$version-venv"
if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    echo "Installing $package, which this Python lacks."
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq && apt-get install -y -qq "$package" >/dev/null
    exec "$python" -m venv "$dir"
fi
echo "This Python cannot make virtual environments: run 'sudo apt-get install $package', then make again." >&2
exit 2
