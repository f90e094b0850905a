/// The list of erasures next to the database, which survives the restore of a backup that still contains
/// erased people. It contains no names.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"

namespace needlelab {

/// One erasure. `lab`: kLabKey of the person's database.
struct ErasureLine {
  Uuid lab{}, person{};
  std::int64_t unix_ns = 0;
  auto operator<=>(const ErasureLine&) const = default;
};

/// The list in the data folder, and its copy next to backups, for a restore on another machine.
inline constexpr const char* kErasuresFile = "erasures";
inline constexpr const char* kErasuresCopy = "needlelab.erasures";

/// Nothing if the file does not exist. kCorrupt names the file and the line.
Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder,
                                              const char* file = kErasuresFile);
/// Replaces the list.
Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file = kErasuresFile);
/// Adds the missing `lines` to the list, atomically and durably; writes nothing if none are missing. One
/// thread at a time.
Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file = kErasuresFile);

}  // namespace needlelab
