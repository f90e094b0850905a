#include "db/service/records/record_end.h"

#include <fmt/core.h>

#include "common/base/bytes.h"

namespace needlelab {
namespace {

constexpr std::string_view kEndBegins = "{\"kind\":\"end\",";

std::string endText(std::uint64_t records, const Digest& digest) {
  return fmt::format("{}\"records\":{},\"blake2b\":\"{}\"}}", kEndBegins, records, hexOf(digest));
}

}  // namespace

std::string recordsEnd(std::uint64_t records, std::string_view lines) {
  SessionHash hash;
  hash.update(viewOf(lines));
  return endText(records, hash.digest());
}

Result<bool> RecordsReader::take(std::string_view line) {
  if (ended_) return Error{ErrorCode::kInvalidInput, "something follows the last line of the export"};
  if (line.starts_with(kEndBegins)) {
    if (line != endText(records_, hash_.digest()))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("the last line does not agree with the {} records before it: something is "
                               "missing or was changed; export again",
                               records_)};
    ended_ = true;
    return false;
  }
  hash_.update(viewOf(line));
  hash_.update(viewOf(std::string_view("\n")));
  ++records_;
  return true;
}

Status RecordsReader::ended() const {
  if (ended_) return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("ends after {} records without the line that an export ends with: a part is "
                           "missing; export again",
                           records_)};
}

}  // namespace needlelab
