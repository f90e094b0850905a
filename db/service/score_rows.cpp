#include "db/service/score_rows.h"

#include <nlohmann/json.hpp>

#include "common/base/clock.h"
#include "common/scoring/measures.h"

namespace needlelab {

Verdicts verdictsOf(std::string_view measures_json) {
  Verdicts verdicts;
  const auto rows = nlohmann::json::parse(measures_json, nullptr, false);
  if (!rows.is_array()) return verdicts;
  for (const auto& row : rows) {
    const auto passed = row.is_object() ? row.find("passed") : row.end();
    if (!row.is_object() || passed == row.end() || !passed->is_boolean()) continue;
    ++verdicts.required;
    if (passed->get<bool>()) ++verdicts.met;
  }
  return verdicts;
}

pb::Score newScore(const Uuid& session, const std::string& measures_json) {
  pb::Score score;
  score.set_session_id(session.data(), session.size());
  score.set_definition_version(kScoreDefinitionVersion);
  score.set_measures_json(measures_json);
  if (const auto passed = verdictsOf(measures_json).passed()) score.set_passed(*passed);
  score.set_made_unix_ns(wallNowNs());
  score.set_engine_version(NEEDLELAB_VERSION);
  return score;
}

}  // namespace needlelab
