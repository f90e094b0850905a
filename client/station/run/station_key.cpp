#include "client/station/run/station_key.h"

#include "common/base/files.h"
#include "common/base/secret.h"

namespace needlelab {
namespace {

int digitOf(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

Result<StationKey> parseStationKey(std::string_view text, const std::string& source) {
  const auto fail = [&](const std::string& why) {
    return Error{
        ErrorCode::kInvalidInput,
        source + ": " + why +
            "; a key file is one line, NAME:64 hexadecimal digits, as needlelab-admin station add writes it"};
  };
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r' || text.back() == ' '))
    text.remove_suffix(1);
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return fail("there is no ':'");
  StationKey key;
  key.station = text.substr(0, colon);
  if (key.station.empty()) return fail("the name before the ':' is missing");
  if (key.station.size() > 100 || key.station.find('\n') != std::string::npos)
    return fail("the name before the ':' is longer than a name is");
  const std::string_view hex = text.substr(colon + 1);
  if (hex.size() != 64) return fail("the key has " + std::to_string(hex.size()) + " digits");
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    const int high = digitOf(hex[i]), low = digitOf(hex[i + 1]);
    if (high < 0 || low < 0) return fail("the key has a character that is no hexadecimal digit");
    key.key.push_back(static_cast<char>(high * 16 + low));
  }
  return key;
}

Result<StationKey> loadStationKey(const std::filesystem::path& path) {
  auto text = readWholeFile(path, 4096);
  if (!text.ok()) return text.error();
  const WipeAtEnd wiped(*text);
  warnWhenOthersMayRead(path);
  return parseStationKey(*text, path.string());
}

}  // namespace needlelab
