// Scores by version, for one session and for a course; reference sessions.
#include <fmt/core.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/text.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/scoring/attempts/reference.h"
#include "common/scoring/measures/measures.h"
#include "db/people/people.h"
#include "db/service/requests/handlers.h"
#include "db/service/scoring/held_results.h"
#include "db/service/scoring/reference_paths.h"
#include "db/service/scoring/rescoring.h"
#include "db/service/scoring/session_scoring.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/teaching/documents.h"
#include "db/teaching/score_list.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The distance from the reference gestures (MeasureRole::kExpertPath) always uses the current references,
/// for both values: from each reference to the nearest other one, and from the session to the nearest of all.
/// The references at the time of scoring do not matter.

/// The minimum number of gestures in a band shown to this role. A band of one gesture is the exact result of
/// a session, and one of few nearly so: people who may read only their own sessions get only bands with
/// enough gestures for a comparison.
std::size_t leastInBandFor(pb::Role role) {
  return role == pb::TRAINEE ? kMinReferences : 1;
}

/// Fills in bands of at least `min_n` gestures, what is pending, and definition_version, from the newest
/// scores of the reference's sessions. Uses only scores of one version, the newest available.
Status addBands(Connection& reader, ReferencePaths& paths, std::size_t min_n, pb::Reference& reference);

/// Fills in the comparison (JSON, common/scoring/attempts/reference.h) with bands of at least `min_n`
/// gestures, and what is pending; leaves both empty if the exercise has no reference of the score's version.
Status addComparison(Connection& reader, ReferencePaths& paths, std::size_t min_n,
                     const std::string& exercise_id, pb::Score& score);

}  // namespace needlelab

namespace needlelab::handlers {
namespace {

Result<pb::Reply> referenceReply(const Context& context, pb::Reference reference) {
  RETURN_IF_ERROR(addBands(context.reader, context.parts.scoring.referencePaths(),
                           leastInBandFor(context.who.role), reference));
  pb::Reply reply;
  *reply.mutable_reference() = std::move(reference);
  return reply;
}

std::string pageOf(const ScoreKey& key) {
  return fmt::format("{} {} {} {}\n{}\n{}", key.started_unix_ns, key.number, key.version, key.trainee,
                     key.name, key.exercise_id);
}

Result<ScoreKey> scoreKeyOf(const std::string& page) {
  ScoreKey key;
  if (page.empty()) return key;
  std::istringstream in(page);
  in >> key.started_unix_ns >> key.number >> key.version >> key.trainee;
  in.ignore();
  std::getline(in, key.name);
  std::getline(in, key.exercise_id);
  if (!in || key.number < 1)
    return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
  return key;
}

/// kNotFound lists the existing courses. Empty: all courses.
Status checkCourse(Connection& reader, const std::string& id) {
  if (id.empty()) return {};
  ASSIGN_OR_RETURN(const auto courses, CurriculumStore(reader).list());
  std::string names;
  for (const StoredCurriculum& course : courses) {
    if (course.id == id) return {};
    names += (names.empty() ? "" : ", ") + course.id;
  }
  return Error{ErrorCode::kNotFound, "there is no course '" + printable(id) + "'; there are: " +
                                         (names.empty() ? "none yet, import a curriculum first" : names)};
}

/// kInvalidInput lists every session in which a hazard or bone was touched, by its newest score. A session
/// without a score does not contribute to a band.
Status checkExamples(Connection& connection, const std::string& exercise_id,
                     const std::vector<Uuid>& sessions) {
  std::string refused;
  for (const Uuid& id : sessions) {
    const auto score = ScoreStore(connection).get(id, 0);
    if (!score && score.error().code != ErrorCode::kNotFound) return score.error();
    if (!score) continue;
    ASSIGN_OR_RETURN(const auto measures, parseScore(score->measures_json()));
    const std::string why = whyNoReference(measures);
    if (!why.empty()) refused += (refused.empty() ? "" : "; ") + ("session " + uuidText(id) + ": " + why);
  }
  if (refused.empty()) return {};
  return Error{ErrorCode::kInvalidInput,
               "the reference of exercise '" + exercise_id + "', " + refused +
                   "; no hazard and no bone may be touched in a reference: leave " +
                   (refused.find(';') == std::string::npos ? "it out" : "them out")};
}

}  // namespace

Result<pb::Reply> getScore(const Context& context, const pb::GetScore& call) {
  ASSIGN_OR_RETURN(const auto info, visibleSession(context, call.session_id()));
  RETURN_IF_ERROR(requireShown(info));
  ASSIGN_OR_RETURN(auto score,
                   ScoreStore(context.reader).get(*sessionId(call.session_id()), call.definition_version()));
  RETURN_IF_ERROR(addComparison(context.reader, context.parts.scoring.referencePaths(),
                                leastInBandFor(context.who.role), info.description().exercise_id(), score));
  pb::Reply reply;
  *reply.mutable_score() = std::move(score);
  return reply;
}

Result<pb::Reply> listScores(const Context& context, const pb::ListScores& call) {
  ASSIGN_OR_RETURN(const auto from, scoreKeyOf(call.page()));
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  RETURN_IF_ERROR(checkCourse(context.reader, call.course_id()));
  if (!call.group_id().empty()) RETURN_IF_ERROR(GroupStore(context.reader).get(call.group_id()));
  RETURN_IF_ERROR(
      noteRead(context, call.course_id(), call.group_id().empty() ? "" : "of group " + call.group_id()));
  // pages by key: rows added or removed meanwhile do not shift others
  ScoreList scores(context.reader, from, call.course_id(), call.group_id());
  pb::Reply reply;
  auto* list = reply.mutable_scores();
  PageRoom room;
  for (;;) {
    const ScoreKey last = scores.key();
    ASSIGN_OR_RETURN(auto row, scores.next());
    if (!row) return reply;
    if (!room.take(*row)) {
      list->set_next_page(pageOf(last));
      return reply;
    }
    *list->add_scores() = *std::move(row);
  }
}

Result<pb::Reply> setReference(const Context& context, const pb::SetReference& call) {
  std::vector<Uuid> sessions;
  for (const std::string& bytes : call.session_ids()) {
    ASSIGN_OR_RETURN(const auto id, sessionId(bytes));
    sessions.push_back(id);
  }
  pb::Reference reference;
  RETURN_IF_ERROR(
      edit(context, call.exercise_id(), fmt::format("{} sessions", sessions.size()), [&](Connection& writer) {
        auto put = ReferenceStore(writer).put(call.exercise_id(), sessions, call.base_revision(),
                                              context.who.name, context.now_unix_ns);
        if (!put) return Status(put.error());
        reference = std::move(*put);
        return checkExamples(writer, call.exercise_id(), sessions);
      }));
  return referenceReply(context, std::move(reference));
}

Result<pb::Reply> getReference(const Context& context, const pb::GetReference& call) {
  RETURN_IF_ERROR(CurriculumStore(context.reader).exercise(call.exercise_id()));
  ASSIGN_OR_RETURN(auto reference, ReferenceStore(context.reader).get(call.exercise_id()));
  return referenceReply(context, std::move(reference));
}

Result<pb::Reply> rescore(const ServiceParts& parts, const Principal& who, const pb::RescoreSession& call,
                          RequestUnderWay& under_way) {
  return parts.scoring.rescore(who, call, under_way);
}

Result<pb::Reply> rescoreAll(const ServiceParts& parts, const Principal& who, const pb::RescoreAll& call,
                             RequestUnderWay& /*under_way*/) {
  ASSIGN_OR_RETURN(auto report, parts.rescoring.run(who.doer(), call));
  pb::Reply reply;
  *reply.mutable_rescore_report() = std::move(report);
  return reply;
}

}  // namespace needlelab::handlers

namespace needlelab {
namespace {

struct ReferenceScores {
  std::uint32_t version = 0;
  std::vector<std::vector<Measure>> gestures;
};

/// These sessions' scores of one version; version 0: the newest that any of them has.
Result<ReferenceScores> referenceScores(Connection& reader, const pb::Reference& reference,
                                        std::uint32_t version) {
  std::vector<pb::Score> scores;
  for (const std::string& bytes : reference.session_ids()) {
    ASSIGN_OR_RETURN(const auto id, handlers::sessionId(bytes));
    auto score = ScoreStore(reader).get(id, version);
    if (!score && score.error().code != ErrorCode::kNotFound) return score.error();
    if (score) scores.push_back(std::move(*score));
  }
  ReferenceScores taken{version, {}};
  for (const pb::Score& score : scores) taken.version = std::max(taken.version, score.definition_version());
  for (const pb::Score& score : scores) {
    if (score.definition_version() != taken.version) continue;
    ASSIGN_OR_RETURN(auto measures, parseScore(score.measures_json()));
    taken.gestures.push_back(std::move(measures));
  }
  return taken;
}

const MeasureKind& distanceKind() {
  return measureOf(MeasureRole::kExpertPath);
}

struct Bands {
  std::vector<ReferenceBand> bands;
  bool distance_is_pending = false;
};

/// The bands of stored measures, and of the distances among the current references; bands of fewer than
/// `min_n` gestures are omitted.
Bands bandsWith(Connection& reader, ReferencePaths& paths, std::size_t min_n, const pb::Reference& reference,
                const ReferenceScores& scores) {
  Bands made{referenceBands(scores.gestures), false};
  std::erase_if(made.bands, [](const ReferenceBand& band) { return band.name == distanceKind().name; });
  const auto distances = paths.distancesAmongSessions(reader, reference);
  made.distance_is_pending = !distances;
  if (distances && !distances->empty())
    made.bands.push_back(
        bandOf(std::string(distanceKind().name), std::string(distanceKind().unit), *distances));
  std::erase_if(made.bands, [&](const ReferenceBand& band) { return band.n < min_n; });
  return made;
}

}  // namespace

Status addBands(Connection& reader, ReferencePaths& paths, std::size_t min_n, pb::Reference& reference) {
  ASSIGN_OR_RETURN(const auto scores, referenceScores(reader, reference, 0));
  reference.set_definition_version(scores.version);
  const auto made = bandsWith(reader, paths, min_n, reference, scores);
  if (made.distance_is_pending) reference.add_pending(std::string(distanceKind().name));
  for (const ReferenceBand& band : made.bands) {
    auto* row = reference.add_bands();
    row->set_measure(band.name);
    row->set_unit(band.unit);
    row->set_n(static_cast<std::uint32_t>(band.n));
    row->set_mean(band.mean);
    if (band.n > 1) row->set_sd(band.sd);
    row->set_least(band.least);
    if (band.p10) row->set_p10(*band.p10);
    if (band.p25) row->set_p25(*band.p25);
    row->set_median(band.median);
    if (band.p75) row->set_p75(*band.p75);
    if (band.p90) row->set_p90(*band.p90);
    row->set_greatest(band.greatest);
  }
  return {};
}

Status addComparison(Connection& reader, ReferencePaths& paths, std::size_t min_n,
                     const std::string& exercise_id, pb::Score& score) {
  ASSIGN_OR_RETURN(const auto reference, ReferenceStore(reader).get(exercise_id));
  if (reference.session_ids().empty()) return {};
  ASSIGN_OR_RETURN(const auto scores, referenceScores(reader, reference, score.definition_version()));
  if (scores.gestures.empty()) return {};
  ASSIGN_OR_RETURN(auto measures, parseScore(score.measures_json()));
  const auto made = bandsWith(reader, paths, min_n, reference, scores);
  std::erase_if(measures, [](const Measure& measure) { return measure.name == distanceKind().name; });
  ASSIGN_OR_RETURN(const auto id, handlers::sessionId(score.session_id()));
  ReferencePaths::Nearest nearest{std::nullopt, true};
  if (!made.distance_is_pending) nearest = paths.nearestDistance(reader, id, reference);
  if (nearest.is_pending) score.add_pending(std::string(distanceKind().name));
  if (nearest.distance_m) {
    Measure row;
    row.name = distanceKind().name;
    row.unit = distanceKind().unit;
    row.value = *nearest.distance_m;
    measures.push_back(row);
  }
  // a session of an old program may have an unreadable profile: its layers are then numbered
  ASSIGN_OR_RETURN(const auto info, SessionStore(reader).info(id));
  const auto profile = parseProfile(info.description().profile_json(), "profile");
  const auto names = profile ? layerNames(*profile) : std::vector<std::string>();
  score.set_comparison_json(comparisonJson(compareWithReference(measures, made.bands, names)));
  return {};
}

}  // namespace needlelab
