// Scores by version, for one session and for a course; the sessions that others are compared with.
#include "db/attempt_store.h"
#include "db/curriculum_store.h"
#include "db/score_store.h"
#include "db/transaction.h"
#include "service/handlers.h"
#include "service/page.h"
#include "service/score_reference.h"

namespace needlelab::handlers {
namespace {

Result<pb::Reply> referenceReply(const Context& context, pb::Reference reference) {
  if (auto done = addBands(context.reader, *context.paths, reference); !done) return done.error();
  pb::Reply reply;
  *reply.mutable_reference() = std::move(reference);
  return reply;
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
  const auto from = numberOfPage(call.page());
  if (!from) return from.error();
  const auto view = Transaction::begin(context.reader, Transaction::Kind::kRead);
  if (!view) return view.error();
  auto rows = context.reader.query(
      "SELECT s.id, c.definition_version FROM scores c JOIN sessions s ON s.number = c.session WHERE "
      "s.trainee <> '' AND"
      " (?1 = '' OR s.exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?1)) AND"
      " (?2 = '' OR s.trainee IN (SELECT person FROM group_members WHERE group_id = ?2))"
      " ORDER BY s.trainee, s.exercise_id, s.started_unix_ns, s.number, c.definition_version LIMIT -1 OFFSET "
      "?3",
      call.course_id(), call.group_id(), *from);
  pb::Reply reply;
  auto* list = reply.mutable_scores();
  PageRoom room;
  for (std::uint64_t at = *from;; ++at) {
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
      list->set_next_page(std::to_string(at));
      return reply;
    }
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
