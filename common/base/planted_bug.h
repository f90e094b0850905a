/// Bugs planted on purpose: the durability tests show with them that they would catch such a bug
/// (tests/durability/README.md).
#pragma once

#include <string_view>

namespace needlelab {

enum class PlantedBug {
  kAckBeforeCommit,           ///< the server acknowledges a chunk before its transaction is committed
  kSynchronousNormal,         ///< the database runs with synchronous=NORMAL
  kNoSpoolFolderSync,         ///< a new session's folder entries in the spool are not synced
  kRepeatedChunkStoredTwice,  ///< a chunk that comes again is stored again, as the next one
  kFsyncErrorIgnored,         ///< a failed fsync of the database does not stop the writer
  kSecondCheckpointer,        ///< a connection that is not the writer's checkpoints too
  kSpoolPurgedAtAck,          ///< the spool drops what is acknowledged before it is Safe
  kGapAccepted,               ///< a chunk beyond the next one is stored
  kHashNotChecked,            ///< a session is closed as complete whatever its hash
  kSampleLostAtReconnection,  ///< the uplink leaves out a sample after a reconnection
};
inline constexpr int kPlantedBugs = 10;

/// Its name in NEEDLELAB_PLANT, e.g. "ack-before-commit".
constexpr std::string_view nameOf(PlantedBug bug) noexcept {
  constexpr std::string_view kNames[kPlantedBugs] = {
      "ack-before-commit",           "synchronous-normal",  "no-spool-folder-sync",
      "repeated-chunk-stored-twice", "fsync-error-ignored", "second-checkpointer",
      "spool-purged-at-ack",         "gap-accepted",        "hash-not-checked",
      "sample-lost-at-reconnection",
  };
  return kNames[static_cast<int>(bug)];
}

/// Whether this program has it. False in every program that users run, which cannot be changed at run time:
/// only a test's program is linked with tests/support/planted_bug.cpp, which asks the environment. Never
/// asked on the haptic thread. Thread: any.
bool planted(PlantedBug bug) noexcept;

}  // namespace needlelab
