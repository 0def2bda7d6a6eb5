# Bare Debian 12 systems in folders (chroots), for scripts/release and scripts/test_packages, which
# source this file. It needs root and debootstrap. All of them lie in $TWOVIEW_ROOTS.
# shellcheck shell=bash

TWOVIEW_ROOTS=${TWOVIEW_ROOTS:-${TMPDIR:-/tmp}/twoview_roots}

# The bare system that all others are copies of: Debian 12 of this machine's first mirror.
bare_base() {
  local base=$TWOVIEW_ROOTS/base mirror
  [ ! -d "$base" ] || return 0
  [ "$(id -u)" = 0 ] || { echo "$0: chroots need root" >&2; exit 2; }
  command -v debootstrap >/dev/null || { echo "$0: no debootstrap: scripts/bootstrap release" >&2; exit 2; }
  # Of the two files a Debian has one, or both.
  mirror=$({ cat /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list 2>/dev/null || true; } |
    sed -nE 's/^(URIs:|deb) +//p' | sed -n '1s/ .*//;1p')
  [ -n "$mirror" ] || { echo "$0: no mirror in /etc/apt" >&2; exit 2; }
  echo "making a bare Debian 12 in $base"
  mkdir -p "$TWOVIEW_ROOTS"
  rm -rf --one-file-system "$base.part"
  debootstrap --variant=minbase --include=ca-certificates bookworm "$base.part" "$mirror" \
    >"$TWOVIEW_ROOTS/base.log" 2>&1 || { tail -5 "$TWOVIEW_ROOTS/base.log" >&2; exit 1; }
  mv "$base.part" "$base"
}

# Copies a system: copy_root FROM TO. What TO held before is removed.
copy_root() {
  leave_root "$2"
  rm -rf --one-file-system "${TWOVIEW_ROOTS:?}/$2"
  cp -a "$TWOVIEW_ROOTS/$1" "$TWOVIEW_ROOTS/$2"
}

# Gives a system this machine's network settings, and mounts /proc, /sys and /dev in it.
enter_root() {
  local root=$TWOVIEW_ROOTS/$1 folder
  cp /etc/resolv.conf /etc/hosts "$root/etc/"
  cp -r /etc/apt/apt.conf.d/. "$root/etc/apt/apt.conf.d/"
  rm -f "$root"/etc/apt/apt.conf.d/docker-clean # keeps what is downloaded
  cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
  [ ! -f /etc/pip.conf ] || cp /etc/pip.conf "$root/etc/"
  for folder in proc sys dev; do
    mountpoint -q "$root/$folder" && continue
    mount --rbind "/$folder" "$root/$folder"
    mount --make-rslave "$root/$folder"
  done
}

leave_root() {
  local root=$TWOVIEW_ROOTS/$1 folder
  for folder in dev sys proc; do
    if mountpoint -q "$root/$folder"; then umount -l "$root/$folder"; fi
  done
}

# Runs a command in a system, with an empty environment but for the network's: in_root NAME COMMAND.
in_root() {
  local root=$TWOVIEW_ROOTS/$1 network
  shift
  mapfile -t network < <(env | grep -i -E '^(https?_proxy|no_proxy|pip_|ssl_cert)' || true)
  chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
    DEBIAN_FRONTEND=noninteractive "${network[@]}" "$@"
}
