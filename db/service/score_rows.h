/// The rows of a stored score, and their verdicts on the requirements. Private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/uuid.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The verdicts on the requirements in a score's rows.
struct Verdicts {
  std::uint32_t required = 0, met = 0;
  /// Nothing: there are no requirements, or the text is not a score.
  [[nodiscard]] std::optional<bool> passed() const {
    return required == 0 ? std::nullopt : std::optional(met == required);
  }
};
Verdicts verdictsOf(std::string_view measures_json);

/// A score made now, by this program's definitions.
pb::Score newScore(const Uuid& session, const std::string& measures_json);

}  // namespace needlelab
