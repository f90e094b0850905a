#include "server/nats/nats_subjects.h"

#include <fmt/core.h>

#include <array>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::array<std::string_view, kLivePlanes> kPlanes = {"presence", "watch", "live", "ask", "answer"};

bool isPlain(char c) {
  return isLetterOrDigit(c) || c == '-' || c == '_';
}

}  // namespace

std::string_view nameOf(LivePlane plane) {
  return kPlanes[static_cast<std::size_t>(plane)];
}

std::string subjectToken(std::string_view name) {
  std::string token;
  for (const char c : name) {
    if (isPlain(c))
      token += c;
    else
      token += fmt::format("={:02x}", static_cast<unsigned>(static_cast<unsigned char>(c)));
  }
  return token;
}

std::optional<std::string> nameOfToken(std::string_view token) {
  std::string name;
  for (std::size_t at = 0; at < token.size(); ++at) {
    if (isPlain(token[at])) {
      name += token[at];
      continue;
    }
    if (token[at] != '=' || token.size() - at < 3) return std::nullopt;
    const int high = hexDigit(token[at + 1]), low = hexDigit(token[at + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    name += static_cast<char>(16 * high + low);
    at += 2;
  }
  // each name has exactly one token
  if (name.empty() || subjectToken(name) != token) return std::nullopt;
  return name;
}

std::string subjectOf(std::string_view lab, LivePlane plane, const std::optional<std::string>& name) {
  return fmt::format("nl.{}.{}.{}", subjectToken(lab), nameOf(plane), name ? subjectToken(*name) : "*");
}

std::optional<SubjectParts> partsOfSubject(std::string_view lab, std::string_view subject) {
  const std::string start = "nl." + subjectToken(lab) + ".";
  if (!subject.starts_with(start)) return std::nullopt;
  subject.remove_prefix(start.size());
  const auto dot = subject.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  for (std::size_t plane = 0; plane < kLivePlanes; ++plane) {
    if (kPlanes[plane] != subject.substr(0, dot)) continue;
    auto name = nameOfToken(subject.substr(dot + 1));
    if (!name) return std::nullopt;
    return SubjectParts{static_cast<LivePlane>(plane), *std::move(name)};
  }
  return std::nullopt;
}

}  // namespace needlelab
