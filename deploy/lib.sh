# Shared by the scripts of this folder; sourced, never run.
# shellcheck shell=bash
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1
jobs=${NEEDLELAB_JOBS:-$(nproc)}
started=$(date +%s)

say() { printf '\n== %s  [%s s]\n' "$*" "$(($(date +%s) - started))"; }
die() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# build PRESET [TARGET ...]: configures when needed and builds; prints compiler output only when something is wrong
build() {
  local preset=$1; shift
  local log=$root/build/$preset.log
  mkdir -p "$root/build"
  (cd "$root" && cmake --preset "$preset" >"$log" 2>&1) || { tail -30 "$log"; die "cmake --preset $preset failed; the whole log is $log"; }
  local targets=()
  [ $# -eq 0 ] || targets=(--target "$@")
  if [ -t 1 ]; then
    cmake --build "$root/build/$preset" -j "$jobs" "${targets[@]}" || die "the $preset build failed"
  else
    cmake --build "$root/build/$preset" -j "$jobs" "${targets[@]}" >>"$log" 2>&1 || { tail -60 "$log"; die "the $preset build failed; the whole log is $log"; }
  fi
}
