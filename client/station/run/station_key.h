/// The key file by which a station logs in (one line, `NAME:64 hexadecimal digits`, made by needlelab-admin
/// station add), and `--enrol`, which brings the key to this computer.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "client/station/run/options.h"
#include "common/base/result.h"

namespace needlelab {

struct StationKey {
  std::string station;
  std::string key;  ///< 32 bytes
};

/// Errors: kInvalidInput; the key itself never stands in a message. `source` names the text.
Result<StationKey> parseStationKey(std::string_view text, const std::string& source);
Result<StationKey> loadStationKey(const std::filesystem::path& path);

/// `--enrol`: logs in by the bundle, then keeps it in `enrolled`. Exit code 0 when both were done, 2 for a
/// file that is not a bundle.
int runEnrol(const StationOptions& options);

}  // namespace needlelab
