/// What people said to studies. Each word is kept; the last one counts.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class ConsentStore {
 public:
  explicit ConsentStore(Connection& connection) : connection_(connection) {}

  /// kNotFound: no such person; kInvalidInput: the note.
  Status add(const std::string& person, const pb::Consent& consent);
  /// Oldest first.
  Result<std::vector<pb::Consent>> list(std::string_view person);
  /// Nothing: never asked.
  Result<std::optional<pb::Consent>> newest(std::string_view person);
  /// Those who consent now, and are there, in order.
  Result<std::vector<std::string>> consenting();

 private:
  Connection& connection_;
};

}  // namespace needlelab
