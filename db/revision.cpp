#include "db/revision.h"

#include <array>
#include <ctime>

namespace needlelab {

std::string secondText(std::int64_t unix_ns) {
  const std::time_t seconds = unix_ns / 1'000'000'000;
  std::tm parts{};
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", ::gmtime_r(&seconds, &parts));
  return text.data();
}

Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest) {
  if (!base || *base == newest.revision) return {};
  std::string text;
  if (newest.revision == 0) {
    text = what + " is not there (any more); your change was made from its revision " + std::to_string(*base);
  } else {
    text = what + (*base == 0 ? " is there already: revision " : " was changed meanwhile: revision ") +
           std::to_string(newest.revision) + " by '" + newest.by + "' on " + secondText(newest.unix_ns) +
           (*base == 0 ? "" : "; your change was made from revision " + std::to_string(*base));
  }
  return Error{ErrorCode::kConflict,
               text + ". Nothing was stored: look at the newest revision and make your change there",
               newest.revision};
}

}  // namespace needlelab
