#!/bin/sh
# Starts a test program with /sys, /dev and their ioctls led to umockdev. Its library comes before AddressSanitizer's
# own in the order of loading, which GCC's start-up check would refuse.
here=$(dirname "$0")
ASAN_OPTIONS=${ASAN_OPTIONS:+$ASAN_OPTIONS:}verify_asan_link_order=0
TSAN_OPTIONS=${TSAN_OPTIONS:+$TSAN_OPTIONS:}suppressions=$here/tsan.supp
export ASAN_OPTIONS TSAN_OPTIONS
exec umockdev-wrapper "$@"
