/// The key file by which a station logs in: one line, `NAME:64 hexadecimal digits`, made by needlelab-admin
/// station add.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

struct StationKey {
  std::string station;
  std::string key;  ///< 32 bytes
};

/// Errors: kInvalidInput; the key itself never stands in a message. `source` names the text.
Result<StationKey> parseStationKey(std::string_view text, const std::string& source);
Result<StationKey> loadStationKey(const std::filesystem::path& path);

}  // namespace needlelab
