// The policies of retention, and which sessions they concern now.
#include <algorithm>
#include <cmath>
#include <map>

#include "common/base/text.h"
#include "db/retention_store.h"
#include "db/session_row.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kMostDays = 36'500;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

Status checkPolicy(const pb::RetentionPolicy& policy) {
  const auto bad = [](const std::string& text) {
    return Error{ErrorCode::kInvalidInput, "retention policy, " + text};
  };
  if (!policy.exercise_id().empty()) {
    if (auto valid = checkName("exercise_id", policy.exercise_id()); !valid) return valid;
  }
  const auto days = [&](const char* field, std::uint32_t value) -> Status {
    if (value <= kMostDays) return {};
    return bad(std::string(field) + ": " + std::to_string(value) + ", allowed is 0 to " +
               std::to_string(kMostDays));
  };
  if (auto valid = days("thin_after_days", policy.thin_after_days()); !valid) return valid;
  if (auto valid = days("delete_after_days", policy.delete_after_days()); !valid) return valid;
  const double hz = policy.thin_rate_hz(), factor = policy.thin_coarser();
  if (policy.has_thin_after_days() && !(hz >= 0.1 && hz <= 10'000))
    return bad("thin_rate_hz: " + std::to_string(hz) + ", allowed is 0.1 to 10000");
  if (!policy.has_thin_after_days() && (hz != 0 || (factor != 0 && factor != 1)))
    return bad("thin_rate_hz and thin_coarser: only with thin_after_days");
  if (factor != 0 && !(factor >= 1 && factor <= 1000))
    return bad("thin_coarser: " + std::to_string(factor) + ", allowed is 1 to 1000");
  if (policy.has_thin_after_days() && policy.has_delete_after_days() &&
      policy.delete_after_days() <= policy.thin_after_days()) {
    return bad("delete_after_days: " + std::to_string(policy.delete_after_days()) +
               ", allowed is more than thin_after_days, " + std::to_string(policy.thin_after_days()));
  }
  return {};
}

std::string numberText(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

std::string daysText(std::uint32_t days) {
  return std::to_string(days) + (days == 1 ? " day" : " days");
}

std::string reasonOf(const pb::RetentionPolicy& policy, bool deletes) {
  const std::string what = deletes ? "deleted, " + daysText(policy.delete_after_days())
                                   : "thinned to " + numberText(policy.thin_rate_hz()) + " Hz, " +
                                         daysText(policy.thin_after_days());
  return what + " after it was closed: policy of " +
         (policy.exercise_id().empty() ? "all other exercises" : "exercise " + policy.exercise_id()) +
         ", set by " + policy.by();
}

/// The exercises that have recordings of this kind.
Result<std::vector<std::string>> exercisesWith(Connection& connection, StoredRecording::Kind kind) {
  std::vector<std::string> ids;
  auto rows = connection.query("SELECT DISTINCT exercise_id FROM sessions WHERE recording = ?",
                               static_cast<int>(kind));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return ids;
    ids.push_back(rows.text(0));
  }
}

/// Appends the closed sessions of one exercise that were closed up to `until`.
Status collect(Connection& connection, StoredRecording::Kind kind, const std::string& exercise,
               std::int64_t until, const DueRecording& model, std::vector<DueRecording>& due) {
  auto rows = connection.query(
      "SELECT s.id, s.safe_chunks >= s.chunks, coalesce(d.stored_bytes, s.stored_bytes) FROM sessions s"
      " LEFT JOIN derived_recordings d ON d.session = s.number AND d.complete = 1"
      " WHERE s.recording = ? AND s.exercise_id = ? AND s.closed_unix_ns <= ? AND s.state IN (?, ?)"
      " AND s.hash IS NOT NULL ORDER BY s.closed_unix_ns, s.number",
      static_cast<int>(kind), exercise, until, static_cast<int>(pb::SESSION_COMPLETE),
      static_cast<int>(pb::SESSION_INTERRUPTED));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return {};
    const auto id = uuidOf(textOf(rows.bytes(0)));
    if (!id) continue;
    DueRecording& one = due.emplace_back(model);
    one.session = *id;
    one.exercise_id = exercise;
    one.thinned = kind == StoredRecording::Kind::kThinned;
    one.waits_for_backup = rows.integer(1) == 0 && !model.policy.without_backup();
    one.stored_bytes = rows.natural(2);
  }
}

}  // namespace

Status RetentionStore::setPolicy(const pb::RetentionPolicy& policy) {
  if (auto valid = checkPolicy(policy); !valid) return valid;
  const auto optional = [](bool there, auto value) { return there ? std::optional(value) : std::nullopt; };
  const bool thins = policy.has_thin_after_days();
  return connection_.run(
      "INSERT OR REPLACE INTO retention_policies (exercise_id, thin_after_days, thin_rate_hz, thin_coarser,"
      " delete_after_days, without_backup, by_whom, changed_unix_ns) VALUES (?,?,?,?,?,?,?,?)",
      policy.exercise_id(), optional(thins, policy.thin_after_days()), optional(thins, policy.thin_rate_hz()),
      policy.thin_coarser() == 0 ? 1.0 : policy.thin_coarser(),
      optional(policy.has_delete_after_days(), policy.delete_after_days()), policy.without_backup(),
      policy.by(), policy.changed_unix_ns());
}

Status RetentionStore::checkExercise(const std::string& exercise_id) {
  if (exercise_id.empty()) return {};
  constexpr std::size_t kMostNamed = 30;
  std::string names;
  std::size_t count = 0;
  auto rows = connection_.prepare(
      "SELECT id FROM exercises UNION SELECT DISTINCT exercise_id FROM sessions"
      " UNION SELECT exercise_id FROM retention_policies WHERE exercise_id <> '' ORDER BY 1");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) break;
    if (rows.text(0) == exercise_id) return {};
    if (++count <= kMostNamed) names += (names.empty() ? "" : ", ") + std::string(rows.text(0));
  }
  if (count > kMostNamed) names += " and " + std::to_string(count - kMostNamed) + " more";
  return Error{ErrorCode::kInvalidInput,
               "retention policy, exercise_id: '" + exercise_id +
                   "' is no exercise of a curriculum and no session's; there are: " +
                   (names.empty() ? "none yet, import a curriculum first" : names)};
}

Status RetentionStore::removePolicy(const std::string& exercise_id) {
  if (auto done = connection_.run("DELETE FROM retention_policies WHERE exercise_id = ?", exercise_id); !done)
    return done;
  if (connection_.changes() != 0) return {};
  return Error{ErrorCode::kNotFound, exercise_id.empty()
                                         ? "no default policy is set: all is kept already"
                                         : "exercise '" + exercise_id + "' has no policy of its own"};
}

Result<std::vector<pb::RetentionPolicy>> RetentionStore::policies() {
  std::vector<pb::RetentionPolicy> policies;
  auto rows = connection_.prepare(
      "SELECT exercise_id, thin_after_days, thin_rate_hz, thin_coarser, delete_after_days, without_backup, "
      "by_whom,"
      " changed_unix_ns FROM retention_policies ORDER BY exercise_id");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return policies;
    auto& policy = policies.emplace_back();
    policy.set_exercise_id(rows.text(0));
    if (!rows.isNull(1)) {
      policy.set_thin_after_days(static_cast<std::uint32_t>(rows.natural(1)));
      policy.set_thin_rate_hz(rows.real(2));
    }
    policy.set_thin_coarser(rows.real(3));
    if (!rows.isNull(4)) policy.set_delete_after_days(static_cast<std::uint32_t>(rows.natural(4)));
    policy.set_without_backup(rows.integer(5) != 0);
    policy.set_by(rows.text(6));
    policy.set_changed_unix_ns(rows.integer(7));
  }
}

Result<std::vector<DueRecording>> RetentionStore::due(std::int64_t now_unix_ns) {
  const auto all = policies();
  if (!all) return all.error();
  std::map<std::string, pb::RetentionPolicy> of;
  for (const auto& policy : *all) of[policy.exercise_id()] = policy;

  std::vector<DueRecording> due;
  for (const auto kind : {StoredRecording::Kind::kOriginal, StoredRecording::Kind::kThinned}) {
    const auto exercises = exercisesWith(connection_, kind);
    if (!exercises) return exercises.error();
    for (const std::string& exercise : *exercises) {
      auto found = of.find(exercise);
      if (found == of.end()) found = of.find("");
      if (found == of.end()) continue;
      DueRecording model;
      model.policy = found->second;
      const std::size_t first = due.size();
      if (model.policy.has_delete_after_days()) {
        model.deletes = true;
        model.reason = reasonOf(model.policy, true);
        const std::int64_t until = now_unix_ns - model.policy.delete_after_days() * kDay_ns;
        if (auto done = collect(connection_, kind, exercise, until, model, due); !done) return done.error();
      }
      // a recording is thinned once; its original cannot be thinned anew
      if (!model.policy.has_thin_after_days() || kind != StoredRecording::Kind::kOriginal) continue;
      const std::size_t deleted = due.size() - first;
      model.deletes = false;
      model.reason = reasonOf(model.policy, false);
      const std::int64_t until = now_unix_ns - model.policy.thin_after_days() * kDay_ns;
      if (auto done = collect(connection_, kind, exercise, until, model, due); !done) return done.error();
      // the oldest ones come in both lists: they are deleted, not thinned
      due.erase(due.begin() + static_cast<std::ptrdiff_t>(first + deleted),
                due.begin() + static_cast<std::ptrdiff_t>(first + 2 * deleted));
    }
  }
  return due;
}

}  // namespace needlelab
