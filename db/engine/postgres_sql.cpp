#include "db/engine/postgres_sql.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace needlelab {
namespace {

/// The position after the text, name or comment that begins at `at`; `at` if none begins there.
std::size_t behindQuoted(std::string_view sql, std::size_t at) {
  if (sql[at] == '\'' || sql[at] == '"') {
    // a doubled quote is treated as the start of the next text
    const std::size_t end = sql.find(sql[at], at + 1);
    return end == std::string_view::npos ? sql.size() : end + 1;
  }
  if (sql.substr(at, 2) == "--") return std::min(sql.find('\n', at), sql.size());
  return at;
}

}  // namespace

PostgresSql forPostgres(std::string_view sql) {
  constexpr std::string_view kNotIndexed = " NOT INDEXED";
  PostgresSql made;
  std::string& text = made.text;
  int& greatest = made.parameters;
  text.reserve(sql.size() + 16);
  for (std::size_t at = 0; at < sql.size();) {
    if (const std::size_t behind = behindQuoted(sql, at); behind > at) {
      text += sql.substr(at, behind - at);
      at = behind;
      continue;
    }
    if (sql.substr(at, kNotIndexed.size()) == kNotIndexed) {
      at += kNotIndexed.size();
      continue;
    }
    if (sql[at] != '?') {
      text += sql[at++];
      continue;
    }
    ++at;
    int number = 0;
    for (; at < sql.size() && std::isdigit(static_cast<unsigned char>(sql[at])) != 0 && number < 100'000;
         ++at)
      number = number * 10 + (sql[at] - '0');
    if (number == 0) number = greatest + 1;
    greatest = std::max(greatest, number);
    text += '$' + std::to_string(number);
  }
  return made;
}

}  // namespace needlelab
