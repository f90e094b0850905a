#include "server/live/station_quotas.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

constexpr double kDay_ns = 86'400e9;
constexpr double kRounding = 1e-9;  // of sums and products of shares

Error usedUp(const std::string& station, const std::string& what, const std::string& remedy) {
  return {ErrorCode::kNoRoom, "station '" + station + "' " + what + "; " + remedy +
                                  "; the station keeps the session and tries again by itself"};
}

}  // namespace

Status StationQuotas::admit(const std::string& station, const NewSession& session, std::int64_t now_ns) {
  if (session.open_sessions >= settings_.open_sessions)
    return usedUp(
        station,
        fmt::format("has {} open sessions on the server, at most {} are allowed", session.open_sessions,
                    settings_.open_sessions),
        "see who has its key, and give it a new one: needlelab-admin station revoke, then station add");

  Used used = used_[station];
  const double back = static_cast<double>(now_ns - used.at_ns) / kDay_ns;
  used.description_bytes = std::max(0.0, used.description_bytes - back * settings_.description_bytes) +
                           static_cast<double>(session.description_bytes);
  used.unknown_names =
      std::max(0.0, used.unknown_names - back * settings_.unknown_names) + (session.unknown_name ? 1 : 0);
  used.at_ns = now_ns;
  const auto waitOf = [](double used_now, double share) {
    return std::ceil((used_now - share) / share * 24 * 60 * (1 - kRounding));
  };
  if (used.description_bytes > settings_.description_bytes * (1 + kRounding))
    return usedUp(
        station,
        fmt::format("has brought {:.0f} MiB of descriptions and profiles within a day, this one has {} bytes",
                    (used.description_bytes - static_cast<double>(session.description_bytes)) / 0x1p20,
                    session.description_bytes),
        fmt::format("there is room for it in {:.0f} min; if nobody practised so much, see who has "
                    "its key",
                    waitOf(used.description_bytes, settings_.description_bytes)));
  if (session.unknown_name && used.unknown_names > settings_.unknown_names * (1 + kRounding))
    return usedUp(
        station, fmt::format("has brought {:.0f} names of trainees that nobody has", settings_.unknown_names),
        fmt::format("add the person (needlelab-admin user add), or wait {:.0f} min",
                    waitOf(used.unknown_names, settings_.unknown_names)));
  used_[station] = used;
  return {};
}

}  // namespace needlelab
