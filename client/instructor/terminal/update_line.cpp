#include "client/instructor/terminal/update_line.h"

#include <cmath>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "client/instructor/model/live/session_scene.h"
#include "common/base/text/text.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/phase_words.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxTrouble = 1000;  // limit in bytes for a line from the network

/// A name from the network, safe for a terminal, padded to at least `width` bytes.
std::string printable(const std::string& text, std::size_t width) {
  std::string out = needlelab::printable(text);
  if (out.size() < width) out.resize(width, ' ');
  return out;
}

}  // namespace

Update updateOf(const GestureSample& sample, std::span<const std::string> layer_names) {
  Update update;
  update.phase = phaseWord(std::uint32_t{sample.phase});
  update.layer = sample.layer;
  if (sample.layer >= 0 && static_cast<std::size_t>(sample.layer) < layer_names.size())
    update.layer_name = layer_names[static_cast<std::size_t>(sample.layer)];
  update.insertion_m = sample.insertion_m;
  update.force_n = std::hypot(sample.force_W_N[0], sample.force_W_N[1], sample.force_W_N[2]);
  update.plunger = sample.plunger;
  update.fault = sample.fault;
  return update;
}

Update updateOf(const pb::StationStatus& status) {
  Update update;
  update.station = status.station();
  update.trainee = status.trainee();
  if (!status.session_id().empty()) update.session = sessionIdText(status.session_id());
  update.phase = phaseWord(status.phase());
  update.layer = status.layer();
  update.layer_name = status.tissue().substr(0, kMaxNameBytes);
  update.insertion_m = status.insertion_m();
  update.force_n = status.force_n();
  update.fault = status.fault();
  update.online = status.online();
  update.trouble = status.trouble().substr(0, kMaxTrouble);
  update.server = status.server().substr(0, kMaxNameBytes);
  return update;
}

std::string textLine(const Update& update) {
  std::string line = fmt::format("{:9.3f} s  ", update.time_s) + printable(update.station, 12) + "  " +
                     printable(update.trainee, 10);
  if (update.online && !*update.online) return line + "  offline";
  const std::string trouble = (update.server.empty() ? "" : "  server " + printable(update.server, 0)) +
                              (update.trouble.empty() ? "" : "  TROUBLE: " + printable(update.trouble, 0));
  if (update.online && update.session.empty()) return line + "  idle" + trouble;
  line += "  " + printable(update.phase, 11);
  if (update.layer < 0)
    line += "  outside";
  else
    line += "  " + (update.layer_name.empty() ? fmt::format("layer {}", std::int64_t{update.layer} + 1)
                                              : printable(update.layer_name, 0));
  line += fmt::format("  insertion {:>7} mm  |F| {:6.3f} N", fixedText(1e3 * update.insertion_m, 2),
                      update.force_n);
  if (update.plunger) line += fmt::format("  plunger {:3.0f} %", 100 * *update.plunger);
  if (update.latency_ms) line += fmt::format("  latency {:6.1f} ms", *update.latency_ms);
  if (update.drops) line += fmt::format("  drops {}", *update.drops);
  if (update.fault != 0) line += std::string("  FAULT: ") + faultText(static_cast<Fault>(update.fault));
  return line + trouble;
}

std::string jsonLine(const Update& update) {
  nlohmann::ordered_json json = {{"type", "update"},
                                 {"time_s", update.time_s},
                                 {"station", update.station},
                                 {"trainee", update.trainee},
                                 {"session", update.session}};
  if (update.online) json["online"] = *update.online;
  // A station's status keeps the last lesson's values, so omit the needle without a lesson.
  if (!update.online || (*update.online && !update.session.empty())) {
    json["phase"] = update.phase;
    json["layer"] = update.layer;
    if (!update.layer_name.empty()) json["layer_name"] = update.layer_name;
    json["insertion_m"] = update.insertion_m;
    json["force_n"] = update.force_n;
  }
  if (update.plunger) json["plunger"] = *update.plunger;
  json["fault"] = update.fault;
  if (update.latency_ms) json["latency_ms"] = *update.latency_ms;
  if (update.drops) json["drops"] = *update.drops;
  if (!update.trouble.empty()) json["trouble"] = update.trouble;
  if (!update.server.empty()) json["server"] = update.server;
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string noteLine(const std::string& text, bool json) {
  if (!json) return "-- " + printable(text, 0);
  const nlohmann::ordered_json line = {{"type", "note"}, {"text", text}};
  return line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace needlelab
