#!/usr/bin/env bash
# What vanedamp needs, on Debian or Ubuntu: system packages, a virtual environment on the system's interpreter, the pinned
# packages of requirements.txt and the project itself. dolfinx is PyPI's wheel where there is one for that interpreter
# (x86-64, Python 3.12 and newer), otherwise apt's; DOLFINX=wheel or DOLFINX=apt decides. VENV names another folder.
#
#     scripts/setup.sh [product] [tests] [checks] [browser] [peers] [docs]
#
# It installs what is missing of these groups (all, if none is named; product is in every one) and nothing else, so it may
# run before every command.
set -euo pipefail
cd "$(dirname "$0")/.."

python=/usr/bin/python3
venv=${VENV:-.venv}
stamp=$venv/setup- # stamp and group: what the group was made from; written last, so that a killed set-up starts over

# first what the engine compiles with, then the rest while it compiles
first_packages=(python3-venv)
system_packages=(
    # dolfinx compiles forms when they are first used
    gcc libc6-dev
    # gmsh, which works without a display but not without these
    libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1
)
of_wheel=(python3-dev)
first_of_wheel=()
first_of_apt=(
    # h5py stays apt's: PyPI's carries a second HDF5 library, which breaks Debian 12's dolfinx
    python3-scipy python3-h5py python3-setuptools python3-wheel
    # without OpenBLAS a factorisation is six times slower
    libopenblas0-pthread
)
of_apt=(python3-dolfinx python3-slepc4py)

say() { echo "setup: $*" >&2; }

refuse() {
    say "$*"
    cat >&2 <<'END'
Where the system has no suitable dolfinx, take conda's (conda-forge, Linux and macOS):
    conda env create -f environment.yml
    conda activate vanedamp
    pip install --no-deps -e .
    make test PYTHON=python
END
    exit 1
}

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        say "this needs root, and there is no sudo. As root: apt-get install --no-install-recommends ${missing[*]}"
        exit 1
    fi
}

quietly() { as_root env DEBIAN_FRONTEND=noninteractive "$@" >/dev/null; }

apt_get() { quietly apt-get -qq -o DPkg::Lock::Timeout=600 "$@"; }

installed() { [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }

require_python() {
    $python -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        refuse "$python is $($python -V), and 3.11 or newer is needed."
}

# Refresh apt's lists, and install an interpreter where there is none.
prepare_apt() {
    missing=("$@")
    say "installing system packages: $*"
    as_root true # ends here when sudo is refused
    quietly dpkg --configure -a || true # finishes what an earlier installation left half done
    apt_get update || say "apt-get update failed; going on with the package lists that are there"
    [ -x $python ] || apt_get install -y --no-install-recommends python3
}

# Packages of apt that a group has besides; a test that lacks one is skipped, and says so.
install_of_group() {
    local package packages=()
    case $1 in
        browser) packages=(chromium) ;;
        # only an environment that sees apt's packages can import it
        peers) packages=(libegl1) && [ $dolfinx = wheel ] || packages+=(python3-siconos) ;;
    esac
    for package in "${packages[@]}"; do
        installed "$package" || { as_root true && (apt_get install -y --no-install-recommends "$package") 2>/dev/null; } ||
            say "no $package to install here; tests that need it are skipped"
    done
}

# Whether dolfinx is PyPI's wheel or apt's.
choose_dolfinx() {
    case ${DOLFINX:-} in
        wheel | apt) dolfinx=$DOLFINX ;;
        "") dolfinx=apt
            [ "$(uname -m)" != x86_64 ] || ! $python -c 'import sys; sys.exit(sys.version_info < (3, 12))' ||
                dolfinx=wheel ;;
        *) say "DOLFINX: expected wheel or apt, not $DOLFINX"; exit 2 ;;
    esac
}

# The packages of a list that are not there.
missing_of() {
    local package
    missing=()
    for package in "$@"; do
        installed "$package" || missing+=("$package")
    done
}

# Install the packages that an environment begins with; `rest` are the others.
install_first_packages() {
    [ -x $python ] || prepare_apt python3
    require_python
    choose_dolfinx
    declare -n first=first_of_$dolfinx others=of_$dolfinx
    missing_of "${system_packages[@]}" "${others[@]}"
    rest=("${missing[@]}")
    missing_of "${first_packages[@]}" "${first[@]}"
    [ ${#missing[@]} -gt 0 ] || [ ${#rest[@]} -gt 0 ] || return 0
    local now=("${missing[@]}")
    prepare_apt "${now[@]}" "${rest[@]}"
    [ $dolfinx = wheel ] || apt-get --simulate install python3-dolfinx >/dev/null 2>&1 ||
        refuse "apt has no python3-dolfinx to install here."
    [ ${#now[@]} = 0 ] || apt_get install -y --no-install-recommends "${now[@]}"
}

# The packages of a group in requirements.txt.
pinned() { awk -v group="[$1]" '/^# \[/ { found = $2 == group; next } found && NF' requirements.txt; }

pip() { $venv/bin/pip install --quiet --disable-pip-version-check "$@"; }

install_python_packages() {
    # --no-deps: requirements.txt is complete, and dependencies that apt provides under other names stay apt's
    [ "$1" != engine ] || [ $dolfinx = apt ] || pip --no-deps -r <(pinned wheel)
    pip --no-deps -r <(pinned "$1")
    [ "$1" != product ] || pip --no-deps --no-build-isolation -e .
}

# Both engines side by side, each in a process of its own.
compile_engines() {
    local engine job jobs=()
    say "compiling the engines"
    for engine in line plane; do
        $venv/bin/python -c "from vanedamp.coupling.sweep.sweep import warm_up_engine; warm_up_engine('$engine')" &
        jobs+=($!)
    done
    for job in "${jobs[@]}"; do
        wait "$job" || { say "the engines do not compile"; return 1; }
    done
}

# A finished set-up whose interpreter still finds the packages, also after an upgrade of the system's Python.
works() {
    [ -f ${stamp}product ] && $venv/bin/python -P - <<'END'
import sys
from importlib.util import find_spec

packages = "dolfinx slepc4py scipy h5py numba gmsh vanedamp".split()
sys.exit(not all(map(find_spec, packages)))
END
}

wanted() { { pwd && echo "${DOLFINX:-}" && cat scripts/setup.sh pyproject.toml && pinned engine && pinned "$1"; } | cksum; }

# The groups asked for that are not as they should be.
find_open() {
    local group
    open=()
    works || { rm -f $stamp* 2>/dev/null || true; }
    for group in "${groups[@]}"; do
        # a new environment has none of the others
        [[ " ${open[*]} " != *" product "* && "$(cat $stamp$group 2>/dev/null)" = "$(wanted "$group")" ]] ||
            open+=("$group")
    done
}

all=(product tests checks browser peers docs)
groups=(product)
for group in "${@:-${all[@]}}"; do
    [[ " ${all[*]} " == *" $group "* ]] || { say "no group $group; there are ${all[*]}"; exit 2; }
    [ "$group" = product ] || groups+=("$group")
done
find_open
[ ${#open[@]} -gt 0 ] || exit 0

command -v apt-get >/dev/null || refuse "there is no apt-get here."
exec 9<scripts/setup.sh
flock --nonblock 9 || { say "waiting for another set-up to end" && flock 9; }
find_open
[ ${#open[@]} -gt 0 ] || exit 0

rest=()
install_first_packages
compiled=
for group in "${open[@]}"; do
    if [ "$group" = product ]; then
        [ -f ${stamp}product ] || $python -m venv --clear $([ $dolfinx = wheel ] || echo --system-site-packages) $venv
        rm -f $stamp*
    fi
    say "installing Python packages of $group into $venv"
    if [ "$group" = product ]; then
        if [ ${#rest[@]} -gt 0 ]; then
            apt_get install -y --no-install-recommends "${rest[@]}" & installing=$!
        fi
        install_python_packages engine
        compile_engines & compiled=$!
        install_python_packages product
        [ -z "${installing:-}" ] || wait $installing
    else
        install_python_packages "$group"
        install_of_group "$group"
    fi
done
[ -z "$compiled" ] || wait $compiled
for group in "${open[@]}"; do
    wanted "$group" >$stamp$group
done
$venv/bin/python - >&2 <<'END'
import platform

import vanedamp.modal.stack  # noqa: F401
import dolfinx
import numpy
from petsc4py import PETSc

petsc = ".".join(map(str, PETSc.Sys.getVersion()))
versions = f"dolfinx {dolfinx.__version__}, PETSc {petsc}, numpy {numpy.__version__}"
print(f"setup: ready: Python {platform.python_version()}, {versions}")
END
