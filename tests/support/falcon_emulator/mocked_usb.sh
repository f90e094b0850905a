#!/bin/sh
# Starts a test program with /sys, /dev and their ioctls led to umockdev. Its library comes before AddressSanitizer's
# own in the order of loading, which GCC's start-up check would refuse.
here=$(dirname "$0")
# a report goes to the test's own output: the sanitizer's file would be opened through umockdev before that is ready
own_output() { printf '%s' "$1" | sed -E 's/(^|:)log_path=[^:]*//'; }
ASAN_OPTIONS=$(own_output "${ASAN_OPTIONS:-}")
TSAN_OPTIONS=$(own_output "${TSAN_OPTIONS:-}")
UBSAN_OPTIONS=$(own_output "${UBSAN_OPTIONS:-}")
LSAN_OPTIONS=$(own_output "${LSAN_OPTIONS:-}")
ASAN_OPTIONS=${ASAN_OPTIONS:+$ASAN_OPTIONS:}verify_asan_link_order=0
TSAN_OPTIONS=${TSAN_OPTIONS:+$TSAN_OPTIONS:}suppressions=$here/tsan.supp
export ASAN_OPTIONS TSAN_OPTIONS UBSAN_OPTIONS LSAN_OPTIONS
exec umockdev-wrapper "$@"
