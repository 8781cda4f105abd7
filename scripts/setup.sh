#!/usr/bin/env bash
# Everything vanedamp needs, on Debian or Ubuntu: system packages, a virtual environment on the system's interpreter, the
# pinned packages of requirements.txt and the project itself. dolfinx is PyPI's wheel where there is one for that
# interpreter (x86-64, Python 3.12 and newer), otherwise apt's; DOLFINX=wheel or DOLFINX=apt decides.
# It installs what is missing and nothing else, so it may run before every command.
set -euo pipefail
cd "$(dirname "$0")/.."

python=/usr/bin/python3
venv=.venv
stamp=$venv/setup-stamp # names what .venv was made from; written last, so that a killed set-up starts over

system_packages=(
    python3-venv
    # dolfinx compiles forms when they are first used
    gcc libc6-dev
    # gmsh and pyvista, which render without a display but not without these
    libglu1-mesa libgl1 libegl1 libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1
)
of_wheel=(python3-dev)
of_apt=(
    # h5py stays apt's: PyPI's carries a second HDF5 library, which breaks Debian 12's dolfinx
    python3-dolfinx python3-slepc4py python3-scipy python3-h5py python3-setuptools python3-wheel
    # without OpenBLAS a factorisation is six times slower
    libopenblas0-pthread
)

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

# What some tests need, which are skipped without it: a browser, and a program to compare with (27 MB), which only an
# environment that sees apt's packages can import.
install_for_tests() {
    local package packages=(chromium)
    [ $dolfinx = wheel ] || packages+=(python3-siconos)
    for package in "${packages[@]}"; do
        installed "$package" || (apt_get install -y --no-install-recommends "$package") 2>/dev/null ||
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

install_system_packages() {
    local package others
    missing=()
    [ -x $python ] || prepare_apt python3
    require_python
    choose_dolfinx
    declare -n others=of_$dolfinx
    for package in "${system_packages[@]}" "${others[@]}"; do
        installed "$package" || missing+=("$package")
    done
    [ ${#missing[@]} -gt 0 ] || return 0
    prepare_apt "${missing[@]}"
    [ $dolfinx = wheel ] || apt-get --simulate install python3-dolfinx >/dev/null 2>&1 ||
        refuse "apt has no python3-dolfinx to install here."
    apt_get install -y --no-install-recommends "${missing[@]}"
}

# A finished set-up whose interpreter still finds the packages, also after an upgrade of the system's Python.
finished() {
    [ -f $stamp ] && $venv/bin/python -P - <<'END'
import sys
from importlib.util import find_spec

packages = "dolfinx slepc4py scipy h5py numba gmsh pyvista pytest vanedamp".split()
sys.exit(not all(map(find_spec, packages)))
END
}

up_to_date() { finished && [ "$(cat $stamp)" = "$wanted" ]; }

wanted=$({ pwd && echo "${DOLFINX:-}" && cat scripts/setup.sh requirements.txt pyproject.toml; } | cksum)
up_to_date && exit 0

command -v apt-get >/dev/null || refuse "there is no apt-get here."
exec 9<scripts/setup.sh
flock --nonblock 9 || { say "waiting for another set-up to end" && flock 9; }
up_to_date && exit 0

install_system_packages
install_for_tests
finished || $python -m venv --clear $([ $dolfinx = wheel ] || echo --system-site-packages) $venv
rm -f $stamp
say "installing Python packages into $venv"
pip() { $venv/bin/pip install --quiet --disable-pip-version-check "$@"; }
if [ $dolfinx = wheel ]; then
    pip --constraint requirements.txt -e ".[fem,explore,exchange,nastran,cluster,peers,docs,dev]"
else
    # --no-deps: requirements.txt is complete, and dependencies that apt provides under other names stay apt's
    pip --no-deps -r requirements.txt
    pip --no-deps --no-build-isolation -e .
fi
say "compiling the engine"
$venv/bin/python -c 'from vanedamp.coupling.sweep.sweep import warm_up; warm_up()' ||
    say "that failed; the first run compiles it"
echo "$wanted" >$stamp
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
