#include "db/store/rows.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "common/base/time/clock.h"

namespace needlelab {

std::string amongTexts(Connection& connection, int parameter) {
  if (connection.sqlite() == nullptr) return fmt::format(" = ANY (?{})", parameter);
  return fmt::format(" IN (SELECT value FROM json_each(?{}))", parameter);
}

Statement& bindTexts(Connection& connection, Statement& statement, std::span<const std::string> texts) {
  if (connection.sqlite() == nullptr) {
    const std::vector<std::string_view> views(texts.begin(), texts.end());
    return statement.bindList(std::span<const std::string_view>(views));
  }
  nlohmann::json list = nlohmann::json::array();
  for (const std::string& text : texts) list.push_back(text);
  // a text that is not UTF-8 matches no name
  return statement.bind(list.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

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
