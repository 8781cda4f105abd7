#!/usr/bin/env bash
# What users install, each in an environment of its own, tried by scripts/try_installation.py.
#
#     scripts/test_doors.sh [new] [old] [demo] [fem] [--tutorial]
#
# new: `pip install .` with the newest packages and the newest Python that is here; old: with the oldest that
# pyproject.toml promises; demo: what `make demo` installs; fem: `pip install '.[fem]'`, which needs Python 3.12 or newer.
# All, if none is named. --tutorial: the demonstration and the tutorial, too, where there are finite elements.
# $PYTHON makes the sample files: an environment with the tests' packages. $DOORS: the folder of the environments.
set -euo pipefail
cd "$(dirname "$0")/.."

python=${PYTHON:-.venv/bin/python}
home=${DOORS:-/var/tmp/vanedamp-doors}
checkout=$PWD

say() { echo "test-doors: $*" >&2; }

# The newest interpreter with venv, or the system's; at least of a version.
newest_python() {
    local name
    for name in python3.14 python3.13 python3.12 ~/.pyenv/versions/3.1[23456]*/bin/python3 /usr/bin/python3; do
        if "$name" -c "import sys, ensurepip; sys.exit(sys.version_info < (3, $1))" 2>/dev/null; then
            command -v "$name"
            return
        fi
    done
    return 1
}

fresh() { rm -rf "$home/$1" && "$2" -m venv "$home/$1"; }

pip() { "$home/$1/bin/pip" install --quiet --disable-pip-version-check "${@:2}"; }

install() {
    local found
    case $1 in
        new) fresh new "$(newest_python 11)" && pip new "$home/source" ;;
        old)
            fresh old /usr/bin/python3 && pip old uv
            "$home/old/bin/uv" pip install --quiet --python "$home/old/bin/python" --resolution lowest-direct \
                --only-binary :all: --no-binary vanedamp "$home/source"
            ;;
        demo) rm -rf "$home/demo" && VENV=$home/demo scripts/setup.sh product ;;
        fem)
            found=$(newest_python 12) || { say "fem: no Python 3.12 or newer here"; return 0; }
            fresh fem "$found" && pip fem "$home/source[fem]"
            ;;
    esac
}

doors=() options=()
for word in "$@"; do
    case $word in
        new | old | demo | fem) doors+=("$word") ;;
        --tutorial) options+=("$word") ;;
        *) say "no door $word; there are new, old, demo, fem"; exit 2 ;;
    esac
done
[ ${#doors[@]} -gt 0 ] || doors=(new old demo fem)

mkdir -p "$home"
rm -rf "$home/source" "$home/samples"
mkdir "$home/source" "$home/samples"
git ls-files -z | tar --null -T - -cf - | tar -xf - -C "$home/source"
"$python" -m tests.tools.fuzz_files "$home/samples"
failed=()
for door in "${doors[@]}"; do
    begun=$SECONDS
    # not in a condition, where an error would not end it
    (set -e; install "$door") & wait $! || { say "$door: the installation failed"; failed+=("$door"); continue; }
    [ -d "$home/$door" ] || continue
    say "$door: installed in $((SECONDS - begun)) s, $(du -sh "$home/$door" | cut -f1)"
    begun=$SECONDS
    # one thread: threads of BLAS wait for each other where doors and tests share the cores
    (cd "$home" && OMP_NUM_THREADS=1 "$home/$door/bin/python" "$checkout/scripts/try_installation.py" "$checkout" \
        "$home/samples" "${options[@]}") || failed+=("$door")
    say "$door: tried in $((SECONDS - begun)) s"
done
[ ${#failed[@]} = 0 ] || { say "failed: ${failed[*]}"; exit 1; }
say "passed: ${doors[*]}"
