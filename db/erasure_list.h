/// The list of erasures beside the database: a restored backup knows erased people again, and the list does
/// not forget them. It has no names.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"

namespace needlelab {

/// One erasure. `lab`: kLabKey of the database that the person was in.
struct ErasureLine {
  Uuid lab{}, person{};
  std::int64_t unix_ns = 0;
  auto operator<=>(const ErasureLine&) const = default;
};

/// The list in the data folder, and the copy of it beside backups, for a restore on another machine.
inline constexpr const char* kErasuresFile = "erasures";
inline constexpr const char* kErasuresCopy = "needlelab.erasures";

/// Nothing when the file does not exist. kCorrupt names the file and the line.
Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder,
                                              const char* file = kErasuresFile);
/// Replaces the list.
Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file = kErasuresFile);
/// Adds what the list lacks of `lines`, in one step and durably; writes nothing when it lacks nothing. One
/// thread at a time.
Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file = kErasuresFile);

}  // namespace needlelab
