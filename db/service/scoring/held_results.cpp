#include "db/service/scoring/held_results.h"

#include <fmt/core.h>

#include "common/base/time/clock.h"
#include "db/teaching/documents.h"

namespace needlelab {

Result<std::int64_t> heldUntil(Connection& reader, const std::string& exercise_id, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto rules, CurriculumStore(reader).rulesOf(exercise_id));
  return rules.results_from_unix_ns > now_unix_ns ? rules.results_from_unix_ns : 0;
}

Result<bool> isHeld(Connection& reader, const Uuid& session, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto from,
                   reader
                       .query("SELECT e.results_from_unix_ns FROM sessions s JOIN exercises e"
                              " ON e.id = s.exercise_id WHERE s.id = ?",
                              ByteView(session))
                       .first([](const Statement& row) { return row.integer(0); }));
  return from.value_or(0) > now_unix_ns;
}

std::string withheldSessions(std::int64_t now_unix_ns) {
  return fmt::format(
      "(SELECT number FROM sessions WHERE exercise_id IN (SELECT id FROM exercises WHERE"
      " results_from_unix_ns > {}))",
      now_unix_ns);
}

Result<std::int64_t> WithheldResults::until(const std::string& exercise_id) {
  if (!is_for_trainee_) return std::int64_t{0};
  const auto known = until_.find(exercise_id);
  if (known != until_.end()) return known->second;
  ASSIGN_OR_RETURN(const auto found, heldUntil(context_.reader, exercise_id, context_.now_unix_ns));
  until_.emplace(exercise_id, found);
  return found;
}

Status WithheldResults::leaveOutOf(pb::Attempt& attempt) {
  ASSIGN_OR_RETURN(const auto held_until, until(attempt.exercise_id()));
  if (held_until == 0) return {};
  attempt.clear_passed();
  attempt.clear_score_json();
  attempt.set_results_from_unix_ns(held_until);
  return {};
}

Status WithheldResults::leaveOutOf(pb::SessionInfo& session) {
  ASSIGN_OR_RETURN(const auto held_until, until(session.description().exercise_id()));
  if (held_until == 0) return {};
  session.clear_passed();
  session.clear_score_json();
  session.clear_figures();
  session.set_results_from_unix_ns(held_until);
  return {};
}

Status requireShown(const pb::SessionInfo& session) {
  if (session.results_from_unix_ns() == 0) return {};
  return Error{ErrorCode::kDenied, "an exam: your result and its recording are shown from " +
                                       localTime(session.results_from_unix_ns(), TimeForm::kWords) + " on"};
}

}  // namespace needlelab
