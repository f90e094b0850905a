#include <cmath>
#include <nlohmann/json.hpp>

#include "common/base/text.h"
#include "common/scoring/groups.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kSamePlace_m = 0.0005;

/// "21 mm deep in BURSA, 0.4 mm inside subacromial bursa"
std::string placeText(const pb::SyringePlace& place) {
  if (!place.in_tissue()) return "outside the tissue";
  std::string text = valueText(place.depth_m(), "m") + " deep";
  if (!place.tissue().empty()) text += " in " + place.tissue();
  if (!place.target().empty())
    text += ", " + valueText(std::abs(place.target_distance_m()), "m") +
            (place.target_distance_m() <= 0 ? " inside " : " from ") + place.target();
  return text;
}

bool isSamePlace(const pb::SyringePlace& a, const pb::SyringePlace& b) {
  return a.in_tissue() == b.in_tissue() && a.layer() == b.layer() &&
         norm(Vec3{a.x_m() - b.x_m(), a.y_m() - b.y_m(), a.z_m() - b.z_m()}) <= kSamePlace_m;
}

Json textOrNull(const std::string& text) {
  return text.empty() ? Json() : Json(text);
}

Json placeJson(const pb::SyringePlace& place) {
  return {{"x_m", place.x_m()},
          {"y_m", place.y_m()},
          {"z_m", place.z_m()},
          {"in_tissue", place.in_tissue()},
          {"layer", place.layer()},
          {"tissue", textOrNull(place.tissue())},
          {"depth_m", place.depth_m()},
          {"insertion_m", place.insertion_m()},
          {"target", textOrNull(place.target())},
          {"target_distance_m", place.target().empty() ? Json() : Json(place.target_distance_m())},
          {"hazard", textOrNull(place.hazard())}};
}

}  // namespace

std::string eventText(const pb::SyringeEvent& event) {
  const double stroke = std::abs(event.plunger_to() - event.plunger_from());
  std::string text = event.kind() == pb::SyringeEvent::ASPIRATION ? "aspiration" : "injection";
  text += formatted(" of %.0f %% at %.1f s for %.1f s, ", 100 * stroke, event.begin_s(),
                    event.end_s() - event.begin_s()) +
          placeText(event.begin());
  if (!isSamePlace(event.begin(), event.end())) text += "; to " + placeText(event.end());
  for (int i = 0; i < event.hazards_size(); ++i) text += (i == 0 ? "; into " : ", ") + event.hazards(i);
  return text;
}

std::string eventsJson(std::span<const pb::SyringeEvent> events) {
  Json rows = Json::array();
  for (const pb::SyringeEvent& event : events)
    rows.push_back({{"event", pb::SyringeEvent::Kind_Name(event.kind())},
                    {"begin_s", event.begin_s()},
                    {"end_s", event.end_s()},
                    {"begin_tick", event.begin_tick()},
                    {"end_tick", event.end_tick()},
                    {"plunger_from", event.plunger_from()},
                    {"plunger_to", event.plunger_to()},
                    {"in_tissue_share", event.in_tissue_share()},
                    {"in_target_share", event.in_target_share()},
                    {"begin", placeJson(event.begin())},
                    {"end", placeJson(event.end())},
                    {"hazards", std::vector<std::string>(event.hazards().begin(), event.hazards().end())},
                    {"words", eventText(event)}});
  return rows.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace needlelab
