#include "common/base/planted_bug.h"

namespace needlelab {

std::string_view nameOf(PlantedBug bug) noexcept {
  constexpr std::string_view kNames[kPlantedBugs] = {
      "ack-before-commit",           "synchronous-normal",  "no-spool-folder-sync",
      "repeated-chunk-stored-twice", "fsync-error-ignored", "second-checkpointer",
      "spool-purged-at-ack",         "gap-accepted",        "hash-not-checked",
      "sample-lost-at-reconnection",
  };
  return kNames[static_cast<int>(bug)];
}

}  // namespace needlelab
