# Shared by the scripts of this folder; sourced, never run.
# shellcheck shell=bash
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1
jobs=${NEEDLELAB_JOBS:-$(nproc)}
started=$(date +%s)

say() { printf '\n== %s  [%s s]\n' "$*" "$(($(date +%s) - started))"; }
die() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# build PRESET [TARGET ...]: configures if needed and builds; prints compiler output only if something is wrong.
# `demo` is `quick` and `install` is `release` without tests, in the same folder; one configured with its tests stays so.
build() {
  local preset=$1 folder=$1; shift
  case $preset in demo) folder=quick ;; install) folder=release ;; esac
  ! grep -qs '^NEEDLELAB_BUILD_TESTS:BOOL=ON' "$root/build/$folder/CMakeCache.txt" || preset=$folder
  local log=$root/build/$folder.log
  mkdir -p "$root/build"
  # with a new compiler, CMake forgets the preset's other variables
  (cd "$root" && cmake --preset "$preset" >"$log" 2>&1 &&
    { ! grep -q 'require your cache to be deleted' "$log" || cmake --preset "$preset" >"$log" 2>&1; }) || { tail -30 "$log"; die "cmake --preset $preset failed; the whole log is $log"; }
  local targets=()
  [ $# -eq 0 ] || targets=(--target "$@")
  if [ -t 1 ]; then
    cmake --build "$root/build/$folder" -j "$jobs" "${targets[@]}" || die "the $preset build failed"
  else
    cmake --build "$root/build/$folder" -j "$jobs" "${targets[@]}" >>"$log" 2>&1 || { tail -60 "$log"; die "the $preset build failed; the whole log is $log"; }
  fi
}

# set_up yes|no [ARGUMENT ...]: installs what is missing; with `no`, only names it
set_up() {
  local install=$1; shift
  if [ "$install" = yes ]; then
    "$root/deploy/setup" "$@"
  else
    "$root/deploy/setup" "$@" --check || echo "note: nothing is installed (--no-setup)"
  fi
}
