#!/bin/sh
# Installs hsslam and what its tests need into .venv and runs them on two cores; options go to pytest.
set -eu
cd "$(dirname "$0")"
. scripts/environment.sh
prepare_environment dev
exec "$HSSLAM_VENV/bin/python" -m pytest -n 2 "$@"
