#!/usr/bin/env bash
# The tests of finite elements and reduction on other releases of dolfinx: clean Debian root folders, set up by
# scripts/setup.sh as on a fresh machine, with PyPI's wheel of dolfinx or apt's. As root, with debootstrap; some 4 GB each.
#
#     scripts/test_versions.sh [trixie-wheel] [trixie-apt] [sid-apt] [bookworm-apt] [TEST ...]
#     scripts/test_versions.sh --make [bookworm-apt] [trixie-wheel] ...
#
# Default: the first three, and all tests of modal/ and rom/. --make: `make demo` and `make test`, as a user calls them,
# in new root folders.
# The folders stay in $VERSIONS (/var/tmp/vanedamp-versions), so that a second call takes the tests' time alone. Packages
# come from where this machine's own come from, or from $MIRROR.
set -euo pipefail
cd "$(dirname "$0")/.."

home=${VERSIONS:-/var/tmp/vanedamp-versions}

say() { echo "test-versions: $*" >&2; }

[ "$(id -u)" = 0 ] || { say "this needs root, for debootstrap and chroot"; exit 1; }
command -v debootstrap >/dev/null || { say "apt-get install debootstrap first"; exit 1; }

# The archive that this machine's apt takes its release from. Empty on another system than Debian, or where apt has no
# server for it: then debootstrap takes its own default.
archive() {
    local id codename
    id=$(. /etc/os-release && echo "$ID") codename=$(. /etc/os-release && echo "${VERSION_CODENAME:-sid}")
    [ "$id" = debian ] || return 0
    apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
        awk -v release="$codename" '/^(http|https|ftp):/ && $2 == release && $3 == "main" && !found++ { print $1 }'
}

# How this machine reaches package servers: apt's proxies, pip's settings, certificates.
share_settings() {
    local root=$1
    cp -L /etc/resolv.conf "$root/etc/resolv.conf"
    [ ! -f /etc/ssl/certs/ca-certificates.crt ] || cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
    [ ! -f /etc/pip.conf ] || cp /etc/pip.conf "$root/etc/pip.conf"
    apt-config dump | grep -E '^Acquire::(http|https|ftp)::[^"]*"[^"]+"' >"$root/etc/apt/apt.conf.d/20network" || true
}

# A root folder with the mounts that its programs need; they are gone when the shell ends, whatever happens.
inside() {
    local root=$1
    shift
    unshare --mount --propagation private bash -c '
        root=$1; shift
        mapfile -t network < <(env | grep -iE "^(([a-z]+_proxy)|PIP_(INDEX_URL|EXTRA_INDEX_URL|TRUSTED_HOST|PROXY|DEFAULT_TIMEOUT))=")
        mount -t proc proc "$root/proc"
        mount --rbind /dev "$root/dev"
        mount --rbind /sys "$root/sys"
        exec env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" \
            "${network[@]}" \
            OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 DEBIAN_FRONTEND=noninteractive \
            chroot "$root" "$@"' -- "$root" "$@"
}

prepare() {
    local suite=$1 root=$2
    if [ ! -f "$root/bootstrapped" ]; then
        say "$suite: a clean root folder in $root"
        rm -rf "$root"
        mkdir -p "$root"
        # the date on an archive's mirror may have passed
        debootstrap --variant=minbase --include=ca-certificates "${suite%-*}" "$root" $mirror >"$root.log" 2>&1 ||
            { say "$suite: debootstrap failed, see $root.log"; return 1; }
        echo 'Acquire::Check-Valid-Until "false";' >"$root/etc/apt/apt.conf.d/10archive"
        touch "$root/bootstrapped"
    fi
    share_settings "$root"
    mkdir -p "$root/vanedamp"
    git ls-files -z | tar --null -T - -cf - | tar -xf - -C "$root/vanedamp"
}

run() {
    local suite=$1 root=$home/$1
    [ ! "$make" ] || rm -f "$root/bootstrapped"
    prepare "$suite" "$root" || return 1
    local begun=$SECONDS target
    if [ "$make" ]; then
        inside "$root" bash -c 'apt-get -qq update && apt-get -qq install -y --no-install-recommends make >/dev/null'
        for target in demo test; do
            begun=$SECONDS
            inside "$root" env DOLFINX="${suite#*-}" make -C /vanedamp $target || { say "$suite: make $target failed"; return 1; }
            say "$suite: make $target in $((SECONDS - begun)) s; .venv $(du -sh "$root/vanedamp/.venv" | cut -f1)"
        done
        return
    fi
    inside "$root" env DOLFINX="${suite#*-}" /vanedamp/scripts/setup.sh || { say "$suite: the set-up failed"; return 1; }
    say "$suite: set up in $((SECONDS - begun)) s"
    inside "$root" bash -c 'cd /vanedamp && exec .venv/bin/python -m pytest -q "$@"' -- "${tests[@]}"
}

suites=() tests=() make=
for word in "$@"; do
    case $word in
        --make) make=yes ;;
        bookworm-apt | trixie-wheel | trixie-apt | sid-wheel | sid-apt) suites+=("$word") ;;
        *) tests+=("$word") ;;
    esac
done
[ ${#suites[@]} -gt 0 ] || suites=(trixie-wheel trixie-apt sid-apt)
[ ${#tests[@]} -gt 0 ] || tests=(tests/modal tests/rom)

mirror=${MIRROR:-$(archive)}
mkdir -p "$home"
failed=()
for suite in "${suites[@]}"; do
    run "$suite" || failed+=("$suite")
done
[ ${#failed[@]} = 0 ] || { say "failed: ${failed[*]}"; exit 1; }
say "passed: ${suites[*]}"
