/// The last line of an export of records: if it is missing, or has another count or hash, a part is missing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/gesture/session_hash.h"

namespace needlelab {

/// {"kind":"end","records":N,"blake2b":"…"} for the preceding lines, each with its line end. Without a line
/// end.
std::string recordsEnd(std::uint64_t records, std::string_view lines);

/// Checks an export while it is read line by line. Thread: a single one.
class RecordsReader {
 public:
  /// A line without its end. False: it is the last line, and it is correct. kInvalidInput: the last line does
  /// not match the earlier ones, or a line follows it.
  Result<bool> take(std::string_view line);
  /// To be called after the last line. kInvalidInput: there was no last line, so a part is missing.
  [[nodiscard]] Status ended() const;

 private:
  SessionHash hash_;
  std::uint64_t records_ = 0;
  bool ended_ = false;
};

}  // namespace needlelab
