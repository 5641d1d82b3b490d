#!/bin/sh
# Installs hsslam into .venv and compares its matchers on the simulated office; options go to `hsslam compare`.
set -eu
cd "$(dirname "$0")"
. scripts/environment.sh
prepare_environment all
exec "$HSSLAM_VENV/bin/hsslam" compare office "$@"
