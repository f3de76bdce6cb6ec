#!/usr/bin/env bash
# Godot 4 for the tests of the addon, without touching the host: Debian sid with `godot` in a cached folder (1.1 GB).
#   FOOTTRACK_GODOT_ROOT    the folder; default ${XDG_CACHE_HOME:-~/.cache}/foottrack/godot-sid
#   FOOTTRACK_DEBIAN_MIRROR a Debian mirror; debootstrap's own default if unset
# Needs Linux, root or sudo, and debootstrap, which is installed where apt-get is there. Does nothing the second time.
set -euo pipefail

root=${FOOTTRACK_GODOT_ROOT:-${XDG_CACHE_HOME:-$HOME/.cache}/foottrack/godot-sid}
if [ -x "$root/usr/bin/godot" ]; then
    echo "Godot is in $root"
    exit 0
fi
as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

if ! command -v debootstrap >/dev/null && [ ! -x /usr/sbin/debootstrap ]; then
    as_root apt-get install -y --no-install-recommends debootstrap debian-archive-keyring
fi
mkdir -p "$(dirname "$root")"
unfinished=$(mktemp -d "$root.XXXXXX")
trap 'as_root rm -rf "$unfinished"' EXIT
chmod 755 "$unfinished"

PATH=$PATH:/usr/sbin:/sbin as_root debootstrap --variant=minbase sid "$unfinished" \
    ${FOOTTRACK_DEBIAN_MIRROR:+"$FOOTTRACK_DEBIAN_MIRROR"}
# A mirror that is a frozen snapshot is only taken with the settings by which the host takes it.
if [ -d /etc/apt/apt.conf.d ]; then
    as_root cp -a /etc/apt/apt.conf.d/. "$unfinished/etc/apt/apt.conf.d/"
fi
as_root chroot "$unfinished" env DEBIAN_FRONTEND=noninteractive LC_ALL=C apt-get update
as_root chroot "$unfinished" env DEBIAN_FRONTEND=noninteractive LC_ALL=C \
    apt-get install -y --no-install-recommends godot
as_root chroot "$unfinished" apt-get clean
as_root chroot "$unfinished" godot --version --headless
as_root mv "$unfinished" "$root"
trap - EXIT
