#!/bin/sh
# Builds the sdist, the wheel from the sdist, installs it away from the checkout and tries it there.
#
#   sh scripts/check-package.sh           without extras: hsl, hide and glasm run, doctor is content
#   sh scripts/check-package.sh --tests   also with every extra: the test suite, away from the checkout
#
# HSSLAM_PYTHON names the Python to use, as for test.sh.
set -eu
cd "$(dirname "$0")/.."
. scripts/environment.sh

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python=$(find_python)

make_environment() {
    "$python" -m venv "$1"
    "$1/bin/python" -m pip install --quiet --upgrade 'pip>=25.1'
}

say "building the sdist, and the wheel from it"
make_environment "$work/build"
"$work/build/bin/python" -m pip install --quiet hatchling
"$work/build/bin/python" -m hatchling build -t sdist -d "$work/dist" >/dev/null
"$work/build/bin/python" -m pip wheel --quiet --no-deps --wheel-dir "$work/dist" "$work"/dist/hsslam-*.tar.gz
wheel=$(ls "$work"/dist/hsslam-*.whl)

say "installing $(basename "$wheel") without extras"
make_environment "$work/bare"
"$work/bare/bin/python" -m pip install --quiet "$wheel"
heavy=$("$work/bare/bin/python" -m pip list --format freeze | grep -iE '^(open3d|kiss|small.gicp|rosbags|rerun|dask)' || true)
[ -z "$heavy" ] || fail "these should be extras: $heavy"
cd "$work"
for matcher in hsl hide glasm; do
    bare/bin/hsslam run office --scans 60 --matcher "$matcher" --out "run-$matcher" --quiet
    [ -s "run-$matcher/trajectory.tum" ] || fail "$matcher left no trajectory"
    say "$matcher runs"
done
bare/bin/hsslam doctor
bare/bin/hsslam plugin new my_matcher >/dev/null
bare/bin/hsslam plugin check my_matcher --plugin my_matcher/my_matcher.py --no-trials >/dev/null
say "a plugin that is begun keeps its promises"

[ "${1:-}" = --tests ] || exit 0
say "installing it with what the tests need"
make_environment full
full/bin/python -m pip install --quiet "$wheel[dev]"
mkdir unpacked
tar -xzf dist/hsslam-*.tar.gz -C unpacked --strip-components 1
where=$(full/bin/python -c 'import hsslam; print(hsslam.__file__)')
case $where in "$work"/full/*) ;; *) fail "the tests would run on $where" ;; esac
# Not `python -m pytest`, which would put the unpacked sources in front of what is installed.
full/bin/pytest -q -n 2 -p no:cacheprovider unpacked/tests
