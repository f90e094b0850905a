/// Optimistic revisions: who edits a document says which revision the edit was made from.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// The newest revision of a document, and who made it when.
struct NewestRevision {
  std::uint32_t revision = 0;  ///< 0: there is none yet
  std::string by;
  std::int64_t unix_ns = 0;
};

/// "2026-11-20 17:40:11 UTC"
std::string secondText(std::int64_t unix_ns);

/// kConflict, with `current_revision`, unless `base` is the newest one. No `base`: whatever is there. `what`:
/// "profile 'knee'".
Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest);

}  // namespace needlelab
