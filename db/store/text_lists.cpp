#include "db/store/text_lists.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

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

}  // namespace needlelab
