/// The key file for a station's log-in (one line, `NAME:64 hexadecimal digits`, from needlelab-admin station
/// add), and `--enrol`, which stores the key on this computer.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "client/station/run/io/options.h"
#include "common/base/result.h"

namespace needlelab {

struct StationKey {
  std::string station;
  std::string key;  ///< 32 bytes
};

/// Errors: kInvalidInput. Messages never contain the key. `source` names the text.
Result<StationKey> parseStationKey(std::string_view text, const std::string& source);
Result<StationKey> loadStationKey(const std::filesystem::path& path);

/// Runs `--enrol`: logs in with the bundle, then stores it in `enrolled`. Exit code 0 if both succeeded, 2 if
/// the file is not a bundle.
int runEnrol(const StationOptions& options);

}  // namespace needlelab
