# Shared by try.sh, test.sh and .ci/run, which source it (POSIX sh) from the root of the checkout.
#
# prepare_environment EXTRA   makes the virtual environment $HSSLAM_VENV (.venv where unset) and installs
#                             hsslam there with one of the extras of pyproject.toml; quick where that is done
#
# HSSLAM_PYTHON names the Python to use; where unset, the first of 3.11 to 3.13 that is found.

HSSLAM_VENV=${HSSLAM_VENV:-.venv}

say() {
    printf 'hsslam: %s\n' "$*"
}

fail() {
    printf 'hsslam: %s\n' "$*" >&2
    exit 1
}

is_supported_python() {
    "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null
}

find_python() {
    if [ -n "${HSSLAM_PYTHON:-}" ]; then
        is_supported_python "$HSSLAM_PYTHON" || fail "HSSLAM_PYTHON=$HSSLAM_PYTHON is no Python 3.11 to 3.13"
        printf '%s\n' "$HSSLAM_PYTHON"
        return
    fi
    for candidate in python3 python3.13 python3.12 python3.11 python; do
        if is_supported_python "$candidate"; then
            printf '%s\n' "$candidate"
            return
        fi
    done
    fail "needs Python 3.11, 3.12 or 3.13, found none; install one (Debian: apt-get install python3 python3-venv," \
        "macOS: https://www.python.org/downloads/) or name it: HSSLAM_PYTHON=/path/to/python3.12"
}

# Installs Debian packages, asking for a password only where somebody can type it.
install_debian_packages() {
    command -v apt-get >/dev/null 2>&1 || return 1
    if [ "$(id -u)" = 0 ]; then
        as_root=env
    elif command -v sudo >/dev/null 2>&1 && { [ -t 0 ] || sudo -n true 2>/dev/null; }; then
        as_root='sudo env'
    else
        return 1
    fi
    say "apt-get installs $*"
    $as_root apt-get update -qq &&
        $as_root DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

make_virtual_environment() {
    "$HSSLAM_VENV/bin/python" -m pip --version >/dev/null 2>&1 && return
    python=$(find_python)
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        package=$(basename "$python")-venv
        install_debian_packages "$package" ||
            fail "$python cannot make virtual environments; as root: apt-get install $package"
    fi
    say "making a virtual environment in $HSSLAM_VENV with $("$python" --version)"
    "$python" -m venv --clear "$HSSLAM_VENV"
}

# Open3D, which only the matcher `icp` needs, links against libraries that a machine without a display lacks.
install_system_libraries() {
    [ "$(uname -s)" = Linux ] || return 0
    packages=$("$HSSLAM_VENV/bin/python" -c '
import ctypes

wanted = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1", "libX11.so.6": "libx11-6"}
for library, package in wanted.items():
    try:
        ctypes.CDLL(library)
    except OSError:
        print(package)
')
    [ -n "$packages" ] || return 0
    # Unquoted on purpose: one package a word.
    install_debian_packages $packages ||
        say "the matcher icp will be listed as unavailable: Open3D lacks system libraries (Debian:" \
            "apt-get install" $packages"); everything else works"
}

install_project() {
    extra=$1
    stamp=$HSSLAM_VENV/.hsslam-$extra
    wanted="$(pwd) $(cksum pyproject.toml)"
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then
        return
    fi
    # pip shows a progress bar while it unpacks, the longest part, from 25.1 on.
    "$HSSLAM_VENV/bin/python" -m pip install --quiet --upgrade 'pip>=25.1'
    "$HSSLAM_VENV/bin/python" -m pip install --editable ".[$extra]"
    printf '%s\n' "$wanted" >"$stamp"
}

prepare_environment() {
    make_virtual_environment
    install_system_libraries
    install_project "$1"
}
