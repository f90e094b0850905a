/// Profiles of patients, by id and revision. A revision is never overwritten: sessions refer to it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

struct StoredProfile {
  std::string id;
  std::uint32_t revision = 0;
  std::string name;
  std::string json;  ///< canonical; empty in lists
  std::string author;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class ProfileStore {
 public:
  explicit ProfileStore(Connection& connection) : connection_(connection) {}

  /// Stores `profile.json` (canonical; the caller has validated it) as the next revision, or gives the newest
  /// revision when its text is the same. `revision` of the argument is not read. kInvalidInput: id, name or
  /// size.
  /// `base`: the revision that the text was made from (0: none), else kConflict; absent: whichever.
  Result<std::uint32_t> put(const StoredProfile& profile, std::optional<std::uint32_t> base = {});
  /// `revision` 0: the newest. kNotFound names id, and revision where one was asked.
  Result<StoredProfile> get(std::string_view id, std::uint32_t revision);
  /// The newest revision of each, by id, without their texts.
  Result<std::vector<StoredProfile>> list();
  /// All revisions of one, newest first, without their texts. kNotFound.
  Result<std::vector<StoredProfile>> revisions(std::string_view id);

 private:
  Connection& connection_;
};

}  // namespace needlelab
