#!/usr/bin/env bash
# The tests under the arithmetic of other processors: other kernels of OpenBLAS, other instructions of the compiled
# engine. One table at the end; fails if any run fails.
#
#     scripts/test_arithmetic.sh [native] [nehalem] [haswell] [skylakex] [generic] [noavx] [PYTEST ARGUMENT ...]
#
# default: all that this processor can do, fast tier. $PYTHON: the interpreter.
set -uo pipefail
cd "$(dirname "$0")/.."

python=${PYTHON:-.venv/bin/python}
declare -A settings=(
    [native]=""
    [nehalem]="OPENBLAS_CORETYPE=Nehalem"
    [haswell]="OPENBLAS_CORETYPE=Haswell"
    [skylakex]="OPENBLAS_CORETYPE=SkylakeX"
    # compiled code is cached by processor, not by these settings: each has a cache of its own
    [generic]="NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR=$PWD/.cache/numba-generic"
    [noavx]="NUMBA_ENABLE_AVX=0 NUMBA_CACHE_DIR=$PWD/.cache/numba-noavx"
)

names=() arguments=()
for word in "$@"; do
    if [ -n "${settings[$word]+set}" ]; then names+=("$word"); else arguments+=("$word"); fi
done
if [ ${#names[@]} = 0 ]; then
    names=(native nehalem generic noavx)
    ! grep -qw avx2 /proc/cpuinfo || names+=(haswell)
    ! grep -qw avx512f /proc/cpuinfo || names+=(skylakex)
fi

rows=() failed=0
for name in "${names[@]}"; do
    echo "test-arithmetic: $name ${settings[$name]}" >&2
    started=$SECONDS
    # shellcheck disable=SC2086  # settings are words
    output=$(env ${settings[$name]} OMP_NUM_THREADS=1 "$python" -m pytest -q -n auto --dist worksteal \
        "${arguments[@]}" 2>&1) || failed=1
    rows+=("$(printf '%-9s | %5d s | %s' "$name" $((SECONDS - started)) "$(tail -n 1 <<<"$output")")")
    # what failed, in full
    tail -n 1 <<<"$output" | grep -qE 'failed|error|no tests' && echo "$output"
done

printf '%-9s | %7s | %s\n' arithmetic time result
printf '%s\n' "${rows[@]}"
exit $failed
