// Scores by version, for one session and for a course; the sessions that others are compared with.
#include <cstdint>
#include <sstream>
#include <string>

#include "db/assignments.h"
#include "db/connection.h"
#include "db/documents.h"
#include "db/service/handlers.h"
#include "db/service/page.h"
#include "db/service/score_reference.h"
#include "db/session_results.h"

namespace needlelab::handlers {
namespace {

Result<pb::Reply> referenceReply(const Context& context, pb::Reference reference) {
  if (auto done = addBands(context.reader, *context.paths, reference); !done) return done.error();
  pb::Reply reply;
  *reply.mutable_reference() = std::move(reference);
  return reply;
}

/// A row of the list of scores, in its order.
struct ScoreKey {
  std::string trainee, exercise;
  std::int64_t started_ns = INT64_MIN, number = 0;
  std::uint32_t version = 0;
};

std::string pageOf(const ScoreKey& key) {
  return std::to_string(key.started_ns) + " " + std::to_string(key.number) + " " +
         std::to_string(key.version) + " " + std::to_string(key.trainee.size()) + " " + key.trainee +
         key.exercise;
}

Result<ScoreKey> scoreKeyOf(const std::string& page) {
  ScoreKey key;
  if (page.empty()) return key;
  std::istringstream in(page);
  std::size_t trainee = 0;
  in >> key.started_ns >> key.number >> key.version >> trainee;
  const std::streamoff at = in ? static_cast<std::streamoff>(in.tellg()) + 1 : -1;
  if (at < 0 || static_cast<std::size_t>(at) + trainee > page.size())
    return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
  key.trainee = page.substr(static_cast<std::size_t>(at), trainee);
  key.exercise = page.substr(static_cast<std::size_t>(at) + trainee);
  return key;
}

}  // namespace

Result<pb::Reply> getScore(const Context& context, const pb::GetScore& call) {
  const auto info = visibleSession(context, call.session_id());
  if (!info) return info.error();
  auto score = ScoreStore(context.reader).get(*sessionId(call.session_id()), call.definition_version());
  if (!score) return score.error();
  auto comparison = comparisonWith(context.reader, *context.paths, info->description().exercise_id(), *score);
  if (!comparison) return comparison.error();
  score->set_comparison_json(std::move(*comparison));
  pb::Reply reply;
  *reply.mutable_score() = std::move(*score);
  return reply;
}

Result<pb::Reply> listScores(const Context& context, const pb::ListScores& call) {
  const auto from = scoreKeyOf(call.page());
  if (!from) return from.error();
  const auto view = Transaction::begin(context.reader, Transaction::Kind::kRead);
  if (!view) return view.error();
  // pages by key: rows that come or go meanwhile move no others
  auto rows = context.reader.query(
      "SELECT s.id, c.definition_version, s.number FROM scores c JOIN sessions s ON s.number = c.session "
      "WHERE "
      "s.trainee <> '' AND"
      " (?1 = '' OR s.exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?1)) AND"
      " (?2 = '' OR s.trainee IN (SELECT person FROM group_members WHERE group_id = ?2)) AND"
      " (s.trainee, s.exercise_id, s.started_unix_ns, s.number, c.definition_version) > (?3, ?4, ?5, ?6, ?7)"
      " ORDER BY s.trainee, s.exercise_id, s.started_unix_ns, s.number, c.definition_version",
      call.course_id(), call.group_id(), from->trainee, from->exercise, from->started_ns, from->number,
      from->version);
  pb::Reply reply;
  auto* list = reply.mutable_scores();
  PageRoom room;
  ScoreKey last = *from;
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return reply;
    const auto id = sessionId(rows.text(0));
    if (!id) return id.error();
    pb::ScoreRow entry;
    auto attempt = AttemptStore(context.reader).get(*id);
    if (!attempt) return attempt.error();
    attempt->clear_score_json();
    *entry.mutable_attempt() = std::move(*attempt);
    auto score = ScoreStore(context.reader).get(*id, static_cast<std::uint32_t>(rows.natural(1)));
    if (!score) return score.error();
    *entry.mutable_score() = std::move(*score);
    if (!room.take(entry.ByteSizeLong())) {
      list->set_next_page(pageOf(last));
      return reply;
    }
    last = {entry.attempt().trainee(), entry.attempt().exercise_id(), entry.attempt().started_unix_ns(),
            rows.integer(2), entry.score().definition_version()};
    *list->add_scores() = std::move(entry);
  }
}

Result<pb::Reply> setReference(const Context& context, const pb::SetReference& call) {
  std::vector<Uuid> sessions;
  for (const std::string& bytes : call.session_ids()) {
    const auto id = sessionId(bytes);
    if (!id) return id.error();
    sessions.push_back(*id);
  }
  pb::Reference reference;
  const auto status = edit(
      context, call.exercise_id(), std::to_string(sessions.size()) + " sessions", [&](Connection& writer) {
        auto put = ReferenceStore(writer).put(call.exercise_id(), sessions, call.base_revision(),
                                              context.who.name, context.now_unix_ns);
        if (!put) return Status(put.error());
        reference = std::move(*put);
        return Status();
      });
  if (!status) return status.error();
  return referenceReply(context, std::move(reference));
}

Result<pb::Reply> getReference(const Context& context, const pb::GetReference& call) {
  if (const auto exercise = CurriculumStore(context.reader).exercise(call.exercise_id()); !exercise)
    return exercise.error();
  auto reference = ReferenceStore(context.reader).get(call.exercise_id());
  if (!reference) return reference.error();
  return referenceReply(context, std::move(*reference));
}

}  // namespace needlelab::handlers
