// Retention policies, and the sessions to which they currently apply.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <utility>

#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "db/erasure/retention_store.h"
#include "db/sessions/seen_time.h"
#include "db/sessions/session_rows.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kMaxDays = 36'500;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

std::string daysText(std::uint32_t days) {
  return fmt::format("{} {}", days, days == 1 ? "day" : "days");
}

std::string reasonOf(const pb::RetentionPolicy& policy, bool deletes) {
  const std::string what = deletes ? "deleted, " + daysText(policy.delete_after_days())
                                   : fmt::format("thinned to {:g} Hz, {}", policy.thin_rate_hz(),
                                                 daysText(policy.thin_after_days()));
  return what + " after it was closed: policy of " +
         (policy.exercise_id().empty() ? "all other exercises" : "exercise " + policy.exercise_id()) +
         std::string(kSetBy) + policy.by();
}

pb::RetentionPolicy policyOf(const Statement& row) {
  pb::RetentionPolicy policy;
  policy.set_exercise_id(row.text(0));
  if (!row.isNull(1)) {
    policy.set_thin_after_days(row.natural32(1));
    policy.set_thin_rate_hz(row.real(2));
  }
  policy.set_thin_coarser(row.real(3));
  if (!row.isNull(4)) policy.set_delete_after_days(row.natural32(4));
  policy.set_without_backup(row.integer(5) != 0);
  policy.set_by(row.text(6));
  policy.set_changed_unix_ns(row.integer(7));
  return policy;
}

/// Exercises with recordings of this kind.
Result<std::vector<std::string>> exercisesWith(Connection& connection, StoredRecording::Kind kind) {
  return connection
      .query("SELECT DISTINCT exercise_id FROM sessions WHERE recording = ?", static_cast<int>(kind))
      .all(firstText);
}

/// The latest close times at which a policy deletes or thins a recording.
struct DueTimes {
  std::optional<std::int64_t> deleted, thinned;
};

DueTimes dueTimes(const pb::RetentionPolicy& policy, StoredRecording::Kind kind, std::int64_t now_unix_ns) {
  DueTimes due;
  if (policy.has_delete_after_days()) due.deleted = now_unix_ns - policy.delete_after_days() * kDay_ns;
  // a recording is thinned once; it cannot be thinned again without its original
  if (policy.has_thin_after_days() && kind == StoredRecording::Kind::kOriginal)
    due.thinned = now_unix_ns - policy.thin_after_days() * kDay_ns;
  return due;
}

/// Times that give a lower bound for a recording's close, regardless of what the server's clock showed.
class KnownTimes {
 public:
  static Result<KnownTimes> read(Connection& connection, std::int64_t now_unix_ns) {
    KnownTimes known;
    known.now_unix_ns_ = now_unix_ns;
    ASSIGN_OR_RETURN(
        const auto created_unix_ns,
        connection.prepare("SELECT CAST(value AS BIGINT) FROM meta WHERE key = 'created_unix_ns'")
            .first([](const Statement& row) { return row.integer(0); }));
    known.created_unix_ns_ = created_unix_ns.value_or(0);
    ASSIGN_OR_RETURN(known.closed_behind_, SeenTimeStore(connection).closedBehind());
    return known;
  }

  struct Time {
    std::int64_t unix_ns = 0;
    const char* what = "";
  };
  /// The newest of these times: the session was closed then or later. Ignores times in the future.
  [[nodiscard]] Time of(const Uuid& session, std::int64_t closed_unix_ns, std::int64_t received_unix_ns,
                        std::int64_t started_unix_ns) const {
    const auto behind = closed_behind_.find(session);
    const Time times[] = {
        {received_unix_ns, "its first chunk came"},
        {started_unix_ns, "it began by its station's clock"},
        {created_unix_ns_, "this database was made"},
        {behind != closed_behind_.end() ? behind->second : 0, "the server's clock had shown before it"},
    };
    Time newest{closed_unix_ns, "it was closed"};
    for (const Time& time : times)
      if (time.unix_ns <= now_unix_ns_ && time.unix_ns > newest.unix_ns) newest = time;
    return newest;
  }

 private:
  std::int64_t now_unix_ns_ = 0, created_unix_ns_ = 0;
  std::map<Uuid, std::int64_t> closed_behind_;
};

/// Appends the recordings of one exercise and kind to which its policy applies now: to delete, then to thin,
/// then to leave alone, each from oldest to newest.
Status collect(Connection& connection, StoredRecording::Kind kind, const std::string& exercise,
               const pb::RetentionPolicy& policy, const KnownTimes& known, std::int64_t now_unix_ns,
               std::vector<DueRecording>& due) {
  const DueTimes times = dueTimes(policy, kind, now_unix_ns);
  if (!times.deleted && !times.thinned) return {};
  const auto isDue = [](const std::optional<std::int64_t>& until, std::int64_t closed_unix_ns) {
    return until && closed_unix_ns <= *until;
  };
  auto rows = connection.query(
      "SELECT s.id, s.safe_chunks >= s.chunks, coalesce(d.stored_bytes, s.stored_bytes),"
      " s.closed_unix_ns, s.received_unix_ns, s.started_unix_ns FROM sessions s"
      " LEFT JOIN derived_recordings d ON d.session = s.number AND d.complete = 1"
      " WHERE s.recording = ? AND s.exercise_id = ? AND s.closed_unix_ns <= ?"
      " AND s.state IN (?, ?) AND s.hash IS NOT NULL"
      " ORDER BY s.closed_unix_ns, s.number",
      static_cast<int>(kind), exercise,
      std::max(times.deleted.value_or(INT64_MIN), times.thinned.value_or(INT64_MIN)),
      static_cast<int>(pb::SESSION_COMPLETE), static_cast<int>(pb::SESSION_INTERRUPTED));
  std::vector<std::pair<std::int64_t, DueRecording>> deleted, thinned, left;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    const auto id = uuidOf(textOf(rows.bytes(0)));
    if (!id) continue;
    const std::int64_t closed_unix_ns = rows.integer(3);
    const KnownTimes::Time newest = known.of(*id, closed_unix_ns, rows.integer(4), rows.integer(5));
    const bool deletes = isDue(times.deleted, newest.unix_ns);
    const bool thins = !deletes && isDue(times.thinned, newest.unix_ns);
    auto& list = deletes ? deleted : thins ? thinned : left;
    DueRecording& one = list.emplace_back(newest.unix_ns, DueRecording{}).second;
    one.policy = policy;
    one.session = *id;
    one.exercise_id = exercise;
    one.thinned = kind == StoredRecording::Kind::kThinned;
    one.deletes = deletes || (!thins && isDue(times.deleted, closed_unix_ns));
    one.waits_for_backup = rows.integer(1) == 0 && !policy.without_backup();
    one.stored_bytes = rows.natural(2);
    one.reason = reasonOf(policy, one.deletes);
    if (!deletes && !thins) {
      one.clock_was_behind = true;
      one.reason = fmt::format(
          "the server's clock showed {} when it was closed, and was behind: {} at {}, from which its age "
          "counts",
          utcTime(closed_unix_ns), newest.what, utcTime(newest.unix_ns));
    }
  }
  for (auto* list : {&deleted, &thinned, &left}) {
    std::stable_sort(list->begin(), list->end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [unix_ns, one] : *list) due.push_back(std::move(one));
  }
  return {};
}

}  // namespace

Status RetentionStore::checkPolicy(const pb::RetentionPolicy& policy) {
  const auto bad = [](const std::string& text) {
    return Error{ErrorCode::kInvalidInput, "retention policy, " + text};
  };
  if (!policy.exercise_id().empty()) {
    RETURN_IF_ERROR(checkName("exercise_id", policy.exercise_id()));
  }
  const auto days = [&](const char* field, std::uint32_t value) -> Status {
    if (value <= kMaxDays) return {};
    return bad(fmt::format("{}: {}, allowed is 0 to {}", field, value, kMaxDays));
  };
  RETURN_IF_ERROR(days("thin_after_days", policy.thin_after_days()));
  RETURN_IF_ERROR(days("delete_after_days", policy.delete_after_days()));
  const double hz = policy.thin_rate_hz(), factor = policy.thin_coarser();
  if (policy.has_thin_after_days() && !(hz >= 0.1 && hz <= 10'000))
    return bad(fmt::format("thin_rate_hz: {:f}, allowed is 0.1 to 10000", hz));
  if (!policy.has_thin_after_days() && (hz != 0 || (factor != 0 && factor != 1)))
    return bad("thin_rate_hz and thin_coarser: only with thin_after_days");
  if (factor != 0 && !(factor >= 1 && factor <= 1000))
    return bad(fmt::format("thin_coarser: {:f}, allowed is 1 to 1000", factor));
  if (policy.has_thin_after_days() && policy.has_delete_after_days() &&
      policy.delete_after_days() <= policy.thin_after_days()) {
    return bad(fmt::format("delete_after_days: {}, allowed is more than thin_after_days, {}",
                           policy.delete_after_days(), policy.thin_after_days()));
  }
  return {};
}

Status RetentionStore::setPolicy(const pb::RetentionPolicy& policy) {
  RETURN_IF_ERROR(checkPolicy(policy));
  const auto optional = [](bool there, auto value) { return there ? std::optional(value) : std::nullopt; };
  const bool thins = policy.has_thin_after_days();
  return connection_.run(
      "INSERT INTO retention_policies (exercise_id, thin_after_days, thin_rate_hz, thin_coarser,"
      " delete_after_days, without_backup, by_whom, changed_unix_ns) VALUES (?,?,?,?,?,?,?,?)"
      " ON CONFLICT (exercise_id) DO UPDATE SET thin_after_days = excluded.thin_after_days,"
      " thin_rate_hz = excluded.thin_rate_hz, thin_coarser = excluded.thin_coarser,"
      " delete_after_days = excluded.delete_after_days, without_backup = excluded.without_backup,"
      " by_whom = excluded.by_whom, changed_unix_ns = excluded.changed_unix_ns",
      policy.exercise_id(), optional(thins, policy.thin_after_days()), optional(thins, policy.thin_rate_hz()),
      policy.thin_coarser() == 0 ? 1.0 : policy.thin_coarser(),
      optional(policy.has_delete_after_days(), policy.delete_after_days()), policy.without_backup(),
      policy.by(), policy.changed_unix_ns());
}

Status RetentionStore::checkExercise(const std::string& exercise_id, const std::string& field) {
  if (exercise_id.empty()) return {};
  constexpr std::size_t kMaxNamed = 30;
  std::string names;
  std::size_t count = 0;
  auto rows = connection_.prepare(
      "SELECT id FROM exercises UNION SELECT DISTINCT exercise_id FROM sessions"
      " UNION SELECT exercise_id FROM retention_policies WHERE exercise_id <> ''"
      " ORDER BY 1");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    if (rows.text(0) == exercise_id) return {};
    if (++count <= kMaxNamed) names += (names.empty() ? "" : ", ") + std::string(rows.text(0));
  }
  if (count > kMaxNamed) names += fmt::format(" and {} more", count - kMaxNamed);
  return Error{ErrorCode::kInvalidInput,
               field + ": '" + exercise_id +
                   "' is not an exercise of any curriculum or stored session; there are: " +
                   (names.empty() ? "none yet, import a curriculum first" : names)};
}

Status RetentionStore::removePolicy(const std::string& exercise_id) {
  RETURN_IF_ERROR(connection_.run("DELETE FROM retention_policies WHERE exercise_id = ?", exercise_id));
  if (connection_.changes() != 0) return {};
  return Error{ErrorCode::kNotFound, exercise_id.empty()
                                         ? "no default policy is set: all is kept already"
                                         : "exercise '" + exercise_id + "' has no policy of its own"};
}

Result<std::vector<pb::RetentionPolicy>> RetentionStore::policies() {
  return connection_
      .prepare(
          "SELECT exercise_id, thin_after_days, thin_rate_hz, thin_coarser,"
          " delete_after_days, without_backup, by_whom, changed_unix_ns"
          " FROM retention_policies ORDER BY exercise_id")
      .all(policyOf);
}

Result<std::vector<DueRecording>> RetentionStore::due(std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto all, policies());
  std::map<std::string, pb::RetentionPolicy> of;
  for (const auto& policy : all) of[policy.exercise_id()] = policy;

  ASSIGN_OR_RETURN(const auto known, KnownTimes::read(connection_, now_unix_ns));

  std::vector<DueRecording> due;
  for (const auto kind : {StoredRecording::Kind::kOriginal, StoredRecording::Kind::kThinned}) {
    ASSIGN_OR_RETURN(const auto exercises, exercisesWith(connection_, kind));
    for (const std::string& exercise : exercises) {
      auto found = of.find(exercise);
      if (found == of.end()) found = of.find("");
      if (found == of.end()) continue;
      RETURN_IF_ERROR(collect(connection_, kind, exercise, found->second, known, now_unix_ns, due));
    }
  }
  return due;
}

}  // namespace needlelab
