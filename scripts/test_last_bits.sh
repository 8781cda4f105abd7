#!/usr/bin/env bash
# The fast tests with other last bits of numerical libraries (tests/tools/last_bits.py), under three new seeds.
#
#     scripts/test_last_bits.sh [SEED ...] [PYTEST ARGUMENT ...]
#
# A run that fails is repeated with its seed. $PYTHON: the interpreter.
set -uo pipefail
cd "$(dirname "$0")/.."

python=${PYTHON:-.venv/bin/python}
seeds=()
while [[ ${1:-} =~ ^[0-9]+$ ]]; do
    seeds+=("$1")
    shift
done
[ ${#seeds[@]} -gt 0 ] || read -ra seeds <<<"$RANDOM $RANDOM $RANDOM"

failed=0
for seed in "${seeds[@]}"; do
    echo "test-last-bits: seed $seed" >&2
    OMP_NUM_THREADS=1 "$python" -m pytest -q -n auto --dist worksteal --last-bits "$seed" "$@" || failed=1
done
echo "test-last-bits: seeds ${seeds[*]}" >&2
exit $failed
