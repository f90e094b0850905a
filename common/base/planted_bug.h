/// Bugs planted on purpose: with them the durability tests (tests/durability/README.md), the simulated device
/// runs (tests/unit/client/device/world) and others prove that they would catch such a bug.
#pragma once

#include <string_view>

namespace needlelab {

enum class PlantedBug {
  kAckBeforeCommit,           ///< the server acknowledges a chunk before its transaction is committed
  kSynchronousNormal,         ///< the database runs with synchronous=NORMAL
  kNoSpoolFolderSync,         ///< a new session's folder entries in the spool are not synced
  kRepeatedChunkStoredTwice,  ///< a repeated chunk is stored a second time, as the next chunk
  kFsyncErrorIgnored,         ///< a failed fsync of the database does not stop the writer
  kSecondCheckpointer,        ///< a connection other than the writer's also checkpoints
  kSpoolPurgedAtAck,          ///< the spool drops acknowledged chunks before they are Safe
  kGapAccepted,               ///< a chunk beyond the next expected chunk is stored
  kHashNotChecked,            ///< a session is closed as complete although its hash does not match
  kSampleLostAtReconnection,  ///< the uplink skips a sample after a reconnection
  kDeviceWatchdogTwice,       ///< the Falcon's torque outlives the haptic thread by 40 ms instead of 20
  kTorqueWithoutZero,         ///< the Falcon's motors run before its encoders have found their zero
  kRequestOutlivesLink,       ///< a torque requested before the Falcon was lost is sent to it afterwards
  kNoLastCommand,             ///< a device is released without a last command of zero force
  kRescanTooLate,             ///< a lost Falcon is looked for every second instead of every half second
  kRetryNeverDoubles,         ///< a lost Virtuose is looked for every half second for ever
  kNoKeepAlive,               ///< nothing is sent to the Virtuose while a lesson is prepared
  kOldConnectionKept,         ///< a Virtuose is reopened without closing the old connection
  kRepeatedChunkOverwrites,   ///< a repeated chunk overwrites the stored one
  kWritersTogether,           ///< on PostgreSQL write transactions hold no lock of the store
  kWarningIgnored,            ///< what PostgreSQL has stored only at the primary counts as stored
  kTakeoverUnfenced,          ///< a server still stores what a station sent before it logged in elsewhere
  kRevokedTokenHonoured,      ///< a server still honours a cached token after another server revoked it
  kPresenceForEver,           ///< stations of a silent server stay online
  kEpochIgnored,              ///< a station's old connection gets messages meant for the new one
};
inline constexpr int kPlantedBugs = 25;

/// The bug's name in NEEDLELAB_PLANT, e.g. "ack-before-commit".
constexpr std::string_view nameOf(PlantedBug bug) noexcept {
  constexpr std::string_view kNames[kPlantedBugs] = {
      "ack-before-commit",
      "synchronous-normal",
      "no-spool-folder-sync",
      "repeated-chunk-stored-twice",
      "fsync-error-ignored",
      "second-checkpointer",
      "spool-purged-at-ack",
      "gap-accepted",
      "hash-not-checked",
      "sample-lost-at-reconnection",
      "device-watchdog-twice",
      "torque-without-zero",
      "request-outlives-link",
      "no-last-command",
      "look-again-twice",
      "retry-never-doubles",
      "no-keep-alive",
      "old-connection-kept",
      "repeated-chunk-overwrites",
      "writers-together",
      "warning-ignored",
      "takeover-unfenced",
      "revoked-token-honoured",
      "presence-for-ever",
      "epoch-ignored",
  };
  return kNames[static_cast<int>(bug)];
}

/// Whether this program has the bug. Always false in programs for users, and nothing at run time can change
/// that: only test programs link tests/support/planted_bug.cpp, which reads the environment. Never called on
/// the haptic thread. Thread: any.
bool planted(PlantedBug bug) noexcept;

}  // namespace needlelab
