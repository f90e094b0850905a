/// NATS subjects: nl.LAB.PLANE.NAME, one token each.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/together/live_carrier.h"

namespace needlelab {

/// A lab's or a station's name as one token: letters, digits, '-' and '_' stay; any other byte becomes '='
/// and two hexadecimal digits, e.g. "=20" for a space.
std::string subjectToken(std::string_view name);
/// The inverse; nothing if subjectToken cannot return this token.
std::optional<std::string> nameOfToken(std::string_view token);

std::string_view nameOf(LivePlane plane);
/// `name`: of the station or server; nothing: all of them.
std::string subjectOf(std::string_view lab, LivePlane plane, const std::optional<std::string>& name);

struct SubjectParts {
  LivePlane plane = LivePlane::kPresence;
  std::string name;
};
/// Nothing: not a subject of this lab.
std::optional<SubjectParts> partsOfSubject(std::string_view lab, std::string_view subject);

}  // namespace needlelab
