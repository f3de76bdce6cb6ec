#!/usr/bin/env bash
# mono's compiler and runtime for the tests of the Unity package: Debian's mono-mcs and mono-runtime. Needs apt-get, and
# root or sudo without a password; says so, and fails, where it cannot. Does nothing the second time.
set -euo pipefail

if command -v mcs >/dev/null && command -v mono >/dev/null; then
    echo "mono is $(command -v mono)"
    exit 0
fi
command -v apt-get >/dev/null || { echo "no apt-get here: install mono's mcs and mono yourself" >&2; exit 1; }
if [ "$(id -u)" = 0 ]; then
    as_root=(env)
elif sudo -n true 2>/dev/null; then
    as_root=(sudo)
else
    echo "neither root nor sudo: install mono-mcs and mono-runtime, the Unity package's tests are skipped without" >&2
    exit 1
fi
packages=(mono-mcs mono-runtime)
"${as_root[@]}" apt-get install -y --no-install-recommends "${packages[@]}" || {
    "${as_root[@]}" apt-get update
    "${as_root[@]}" apt-get install -y --no-install-recommends "${packages[@]}"
}
