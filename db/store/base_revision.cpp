#include "db/store/base_revision.h"

#include <fmt/core.h>

#include "common/base/time/local_time.h"

namespace needlelab {

Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest) {
  if (!base || *base == newest.revision) return {};
  std::string text;
  if (newest.revision == 0) {
    text = fmt::format("{} is not there (any more); your change was made from its revision {}", what, *base);
  } else {
    text = fmt::format("{}{}{} by '{}' on {}{}", what,
                       (*base == 0 ? " is there already: revision " : " was changed meanwhile: revision "),
                       newest.revision, newest.by, localTime(newest.unix_ns, TimeForm::kZoned),
                       (*base == 0 ? "" : fmt::format("; your change was made from revision {}", *base)));
  }
  return Error{ErrorCode::kConflict,
               text + ". Nothing was stored: look at the newest revision and make your change there",
               newest.revision};
}

}  // namespace needlelab
