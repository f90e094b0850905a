/// Subjects of NATS: nl.LAB.PLANE.NAME, a token each.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/live/live_carrier.h"

namespace needlelab {

/// A lab's or a station's name as one token: letters, digits, '-' and '_' stand for themselves, each other
/// byte is '=' and two digits, for a space "=20".
std::string subjectToken(std::string_view name);
/// The inverse; nothing: no token that subjectToken makes.
std::optional<std::string> nameOfToken(std::string_view token);

std::string_view nameOf(LivePlane plane);
/// `name`: of the station or server; nothing: all of them.
std::string subjectOf(std::string_view lab, LivePlane plane, const std::optional<std::string>& name);

struct SubjectParts {
  LivePlane plane = LivePlane::kPresence;
  std::string name;
};
/// Nothing: no subject of this lab.
std::optional<SubjectParts> partsOfSubject(std::string_view lab, std::string_view subject);

}  // namespace needlelab
