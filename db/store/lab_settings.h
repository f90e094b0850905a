/// Settings for the whole lab.
#pragma once

#include <string_view>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// Keys of `meta` that are settings: "1" or "0"; absent: "0". Included in exports.
inline constexpr std::string_view kCodesRequiredKey = "codes_required";
inline constexpr std::string_view kKeepErasedKey = "keep_recordings_of_erased";

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class LabSettingsStore {
 public:
  explicit LabSettingsStore(Connection& connection) : connection_(connection) {}

  /// Whether trainees without a code may practise only as kGuestName.
  Result<bool> codesRequired();
  Status setCodesRequired(bool required);
  /// Whether an erased person's sessions stay, without a name.
  Result<bool> keepsRecordingsOfErased();
  Status setKeepsRecordingsOfErased(bool keeps);

 private:
  Result<bool> is(std::string_view key);
  Status set(std::string_view key, bool value);
  Connection& connection_;
};

}  // namespace needlelab
