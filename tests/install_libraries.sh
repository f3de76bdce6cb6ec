#!/usr/bin/env bash
# Debian packages that single tests need: RealSense's library, network namespaces, a C compiler, Node. Needs apt and root.
set -euo pipefail
wanted=()
command -v ip >/dev/null || [ -x /sbin/ip ] || wanted+=(iproute2)
command -v cc >/dev/null || wanted+=(gcc libc6-dev)
command -v node >/dev/null || wanted+=(nodejs npm)
ldconfig -p | grep -q libusb-1.0 || wanted+=(libusb-1.0-0)
[ "${#wanted[@]}" -gt 0 ] || exit 0
[ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || { echo "not root with apt: ${wanted[*]} not installed"; exit 0; }
DEBIAN_FRONTEND=noninteractive apt-get update
DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${wanted[@]}"
