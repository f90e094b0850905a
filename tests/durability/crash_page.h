/// What the server under test shows of itself, and where it is told to die: a page of memory in a file.
#pragma once

#include <atomic>
#include <cstdint>

namespace needlelab::test {

/// Little-endian words; harness/crash_page.py reads and writes the same. The harness arms `die_in` before the
/// server starts or while it runs; the server alone writes the others.
struct CrashPage {
  std::atomic<std::uint64_t> phase;        ///< what goes on now, a CrashPhase
  std::atomic<std::uint64_t> commits;      ///< syncs of the log outside of checkpoints
  std::atomic<std::uint64_t> checkpoints;  ///< begun
  std::atomic<std::uint64_t> operations;   ///< writes and syncs in the armed phase since it was armed
  std::atomic<std::uint64_t> die_in;       ///< a CrashPhase; 0: go on living
  std::atomic<std::uint64_t> die_at;       ///< before this operation of that phase, counted from 1
  std::atomic<std::uint64_t> hold_ms;      ///< stand still there for so long before
};

enum CrashPhase : std::uint64_t { kElsewhere = 0, kInCommit = 1, kInCheckpoint = 2 };

}  // namespace needlelab::test
