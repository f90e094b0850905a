#!/bin/sh
# Starts a test program with /sys, /dev and their ioctls led to umockdev. Its library comes before AddressSanitizer's
# own in the order of loading, which GCC's start-up check would refuse.
here=$(dirname "$0")
export ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}verify_asan_link_order=0"
export TSAN_OPTIONS="${TSAN_OPTIONS:+$TSAN_OPTIONS:}suppressions=$here/tsan.supp"
exec umockdev-wrapper "$@"
