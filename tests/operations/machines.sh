# shellcheck shell=bash
# Sourced by the live tests: machines that boot a systemd of their own in namespaces, each on an overlay of a root folder, joined by a
# bridge. Nothing of this machine is changed. Runs the test again in a mount and a network namespace of its own, so that nothing stays.
skip() { echo "skipped: $1"; exit 77; }
[ -n "${NEEDLELAB_LONG:-}" ] || skip "long form only: NEEDLELAB_LONG=1"
[ "$(id -u)" -eq 0 ] || skip "only root can boot a systemd of its own"
[ -x /lib/systemd/systemd ] || skip "systemd is not installed"
grep -qw overlay /proc/filesystems || skip "this kernel has no overlay file system"
if [ -z "${NEEDLELAB_OWN_NAMESPACES:-}" ]; then
  NEEDLELAB_OWN_NAMESPACES=1 exec unshare --mount --net --propagation private "$0" "$@"
fi

folder=$(mktemp -d "${TMPDIR:-/tmp}/needlelab-machines-XXXXXX")
declare -A init # the process number of each machine's systemd
end_machines() {
  local pid
  for pid in "${init[@]}"; do kill -9 "$pid" 2>/dev/null || true; done
  umount -l "$folder" 2>/dev/null || true
  rmdir "$folder"
}
trap end_machines EXIT
mount -t tmpfs -o size=8g tmpfs "$folder"

# pivot_root, not chroot: in a chroot no user namespace can be made, which PrivateUsers= wants
cat >"$folder/boot" <<'BOOT'
set -eu
name=$1 own=$2 lower=$3
root=$own/root
mkdir -p "$own"/upper "$own"/work "$root"
mount -t overlay overlay -o "lowerdir=$lower,upperdir=$own/upper,workdir=$own/work" "$root"
mount -t proc proc "$root/proc"
mount -t sysfs sysfs "$root/sys"
mount -t cgroup2 cgroup2 "$root/sys/fs/cgroup"
mount -t tmpfs -o mode=755 tmpfs "$root/run"
mount -t tmpfs tmpfs "$root/tmp"
mount --rbind /dev "$root/dev"
ip link set lo up
hostname "$name"
cd "$root"
for unit in systemd-udevd systemd-logind getty@tty1 systemd-networkd systemd-resolved; do
  ln -sf /dev/null "etc/systemd/system/$unit.service"
done
: >etc/fstab
echo "$name" >etc/hostname
cp "$own/../hosts" etc/hosts
mkdir -p old; pivot_root . old; cd /; umount -l /old
mount --make-rshared /
exec env -i container=needlelab PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd --system --unit=multi-user.target \
  systemd.unified_cgroup_hierarchy=1
BOOT
echo "127.0.0.1 localhost" >"$folder/hosts"

# boot NAME [LOWER [ADDRESS]]: LOWER is the root folder that it sees, this machine's without it. Write names into $folder/hosts before.
boot() {
  local name=$1 lower=${2:-/} address=${3:-} pid=''
  mkdir "$folder/$name"
  setsid unshare --pid --fork --kill-child --mount --uts --ipc --cgroup --net --propagation private \
    bash "$folder/boot" "$name" "$folder/$name" "$lower" >"$folder/$name/console" 2>&1 </dev/null &
  for _ in $(seq 600); do
    pid=$(pgrep -n -P $! 2>/dev/null || true)
    [ -n "$pid" ] && grep -qs systemd "/proc/$pid/comm" && break
    sleep 0.1
  done
  init[$name]=$pid
  wait_for "$name boots" on "$name" sh -c 'systemctl is-system-running | grep -q -e running -e degraded'
  [ -n "$address" ] || return 0
  ip link show lan0 >/dev/null 2>&1 || { ip link add lan0 type bridge; ip link set lan0 up; }
  ip link add "to-$name" type veth peer name lan netns "$pid"
  ip link set "to-$name" master lan0
  ip link set "to-$name" up
  nsenter -t "$pid" -n ip addr add "$address/24" dev lan
  nsenter -t "$pid" -n ip link set lan up
}
# on MACHINE COMMAND...
on() {
  local pid=${init[$1]}; shift
  nsenter -t "$pid" -p -m -u -i -n -C -r -w env -i HOME=/root LANG=C.UTF-8 PATH=/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@"
}
failed() { # WORDS
  local name
  echo "FAILED: $1"
  for name in "${!init[@]}"; do
    echo "--- $name"
    on "$name" journalctl --no-pager -n 40 || true
    tail -n 20 "$folder/$name/console"
  done
  exit 1
}
wait_for() { # WORDS COMMAND...
  local words=$1; shift
  for _ in $(seq 300); do if "$@" >/dev/null 2>&1; then return 0; fi; sleep 0.2; done
  failed "$words"
}
check() { # WORDS COMMAND...
  local words=$1; shift
  if "$@"; then echo "ok: $words"; else failed "$words"; fi
}
# copy_sources MACHINE: the checkout and its built programs, in /root/nl
copy_sources() {
  local name programs=()
  for name in server admin station instructor sim; do [ ! -x "$built/bin/needlelab-$name" ] || programs+=("bin/needlelab-$name"); done
  tar -C "$source" --exclude=./build --exclude=./.git -cf - . | on "$1" sh -c 'mkdir -p /root/nl/build/release && tar -xf - -C /root/nl'
  tar -C "$built" -cf - cmake_install.cmake "${programs[@]}" | on "$1" tar -xf - -C /root/nl/build/release
}
