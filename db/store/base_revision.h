/// Edits of documents with revisions: each edit names the revision it was based on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// A document's newest revision, with its author and time.
struct NewestRevision {
  std::uint32_t revision = 0;  ///< 0: no revision exists
  std::string by;
  std::int64_t unix_ns = 0;
};

/// kConflict, with `current_revision`, unless `base` is the newest revision. Without `base` any revision is
/// accepted. `what`: e.g. "profile 'knee'".
Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest);

}  // namespace needlelab
