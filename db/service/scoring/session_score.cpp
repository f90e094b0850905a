#include "db/service/scoring/session_score.h"

#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "common/base/program.h"
#include "common/base/text/strict_json.h"
#include "common/base/time/clock.h"
#include "common/profile/profile.h"
#include "db/sessions/session_store.h"
#include "db/teaching/documents.h"

namespace needlelab {

/// False: not all distances are computed yet.
Result<bool> SessionScore::compareStep(Connection& reader, ReferencePaths& paths) {
  ASSIGN_OR_RETURN(const auto info, SessionStore(reader).info(session_));
  auto nearest = paths.nearestPath(reader, info.description().exercise_id(), session_, comparison_);
  if (nearest && nearest->is_pending) return false;
  if (nearest)
    nearest_ = std::move(nearest->path);
  else
    json_ = nearest.error();
  comparison_ = {};
  is_compared_ = true;
  return true;
}

/// Reads the current requirements; without the exercise, only the plain measures.
Status SessionScore::readExercise(Connection& reader) {
  const auto stored = CurriculumStore(reader).exercise(reading_.samples().info.description().exercise_id());
  if (!stored) return stored.error().code == ErrorCode::kNotFound ? Status() : Status(stored.error());
  ASSIGN_OR_RETURN(exercise_, parseExercise(stored->json, "exercise '" + stored->id + "'"));
  return {};
}

Result<bool> SessionScore::step(Connection& reader, ReferencePaths& paths, StepWork& work) {
  has_begun_ = true;
  if (!is_compared_) {
    ASSIGN_OR_RETURN(const bool all, compareStep(reader, paths));
    if (!all) return false;
  }
  if (!is_read_) {
    ASSIGN_OR_RETURN(is_read_, reading_.step(reader, work));
    if (!is_read_) return false;
  }
  reading_.readBy(reader);
  const SessionSamples& session = reading_.samples();
  if (session.info.samples() == 0) return true;
  if (!score_) {
    if (const Status exercise = readExercise(reader); !exercise.ok()) json_ = exercise.error();
    std::span<const TipPath> references;
    if (nearest_) references = {&*nearest_, 1};
    score_.emplace(session.samples, session.info.description().rate_hz(), session.profile, session.X_WL,
                   exercise_ ? &*exercise_ : nullptr, references);
  }
  const bool is_done = score_->step(work);
  RETURN_IF_ERROR(session.samples.fault());
  if (!is_done) return false;
  if (json_.ok()) json_ = scoreJson(score_->measures());
  events_ = score_->events();
  late_paths_ = score_->latePaths();
  return true;
}

Verdicts verdictsOf(std::string_view measures_json) {
  Verdicts verdicts;
  const auto rows = readShallowJson<nlohmann::json>(measures_json);
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
  score.set_engine_version(programVersion());
  return score;
}

}  // namespace needlelab
