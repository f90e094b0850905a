#include "db/service/scoring/rescoring.h"

#include <fmt/core.h>
#include <vector>

#include "common/base/time/clock.h"
#include "common/scoring/measures/measures.h"
#include "db/audit/audit.h"
#include "db/erasure/retention_store.h"
#include "db/service/context/backups.h"
#include "db/service/scoring/session_score.h"
#include "db/service/scoring/session_scoring.h"
#include "db/sessions/session_results.h"
#include "db/store/duties.h"
#include "db/teaching/attempt_sums.h"

namespace needlelab {
namespace {

constexpr int kRescoreFaultsListed = 100;
constexpr int kRescoreAtOnce = 64;
constexpr std::size_t kMaxSumsMended = 100'000;

struct DueScore {
  std::int64_t number = 0;
  Uuid session{};
};

/// The next sessions after `after` without a score of this version.
Result<std::vector<DueScore>> dueScores(Connection& reader, const std::string& exercise_id,
                                        std::int64_t after) {
  auto rows = reader.query(
      "SELECT number, id FROM sessions WHERE number > ?1 AND state <> ?2 AND recording = 1 AND erased = 0 "
      "AND samples > 0"
      " AND (?3 = '' OR exercise_id = ?3) AND NOT EXISTS (SELECT 1 FROM scores WHERE session = number AND"
      " definition_version >= ?4) ORDER BY number LIMIT ?5",
      after, static_cast<std::int64_t>(pb::SESSION_OPEN), exercise_id, kScoreDefinitionVersion,
      kRescoreAtOnce);
  std::vector<DueScore> due;
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) return due;
    const auto id = uuidOf(rows.text(1));
    if (id) due.push_back({rows.integer(0), *id});
  }
}

/// Recounts sums of attempts that differ from the sessions; returns how many.
Result<std::size_t> mendSums(const RescoreTools& tools) {
  std::vector<SumFault> wrong;
  {
    ASSIGN_OR_RETURN(auto reader, tools.readers.borrow());
    ASSIGN_OR_RETURN(wrong, AttemptSums(*reader).faults(kMaxSumsMended));
  }
  if (wrong.empty()) return wrong.size();
  const auto mend = [&](Connection& writer) -> Status {
    for (const SumFault& pair : wrong)
      RETURN_IF_ERROR(AttemptSums(writer).recount(pair.exercise_id, pair.trainee));
    return {};
  };
  RETURN_IF_ERROR(tools.writer.run(mend));
  return wrong.size();
}

}  // namespace

Result<pb::RescoreReport> runRescoring(const RescoreTools& tools, const std::string& exercise_id,
                                       const Doer& by_whom, bool dry_run) {
  pb::RescoreReport report;
  report.set_dry_run(dry_run);
  report.set_definition_version(kScoreDefinitionVersion);
  const auto stopped = [&] { return tools.stop.load(std::memory_order_relaxed); };
  std::int64_t after = 0;
  while (!stopped()) {
    std::vector<DueScore> due;
    {
      ASSIGN_OR_RETURN(auto reader, tools.readers.borrow());
      ASSIGN_OR_RETURN(auto found, dueScores(*reader, exercise_id, after));
      due = std::move(found);
    }
    if (due.empty()) break;
    for (const DueScore& one : due) {
      if (stopped()) break;
      after = one.number;
      if (dry_run) {
        report.set_rescored(report.rescored() + 1);
        continue;
      }
      // reading and scoring also load the disk: wait while others are busy
      while ((tools.writer.counters().waiting > tools.pace.queue || tools.hold()) && !stopped())
        tools.pace.sleep(tools.pace.look);
      if (stopped()) break;
      Result<std::string> measures = std::string();
      {
        ASSIGN_OR_RETURN(auto reader, tools.readers.borrow());
        measures = tools.score(*reader, one.session);
      }
      Status stored;
      if (measures && !measures->empty()) {
        const pb::Score score = newScore(one.session, *measures);
        stored = tools.writer.run([&](Connection& writer) { return ScoreStore(writer).put(score); });
        if (!stored && tools.writer.failed()) return stored.error();
      }
      if (measures && !measures->empty() && stored) {
        report.set_rescored(report.rescored() + 1);
      } else {
        report.set_left_alone(report.left_alone() + 1);
        if (report.faults_size() < kRescoreFaultsListed) {
          auto* fault = report.add_faults();
          fault->set_session_id(one.session.data(), one.session.size());
          fault->set_text(!measures ? measures.error().message
                          : !stored ? stored.error().message
                                    : "nothing to measure");
        }
      }
      tools.pace.sleep(tools.pace.pause);
    }
  }
  report.set_stopped(stopped());
  if (dry_run) return report;
  std::size_t mended = 0;
  if (!report.stopped()) {
    ASSIGN_OR_RETURN(mended, mendSums(tools));
  }
  if (report.rescored() + report.left_alone() + mended == 0) return report;
  const std::string what =
      fmt::format("{} sessions scored by definition version {}, {} left alone{}{}", report.rescored(),
                  kScoreDefinitionVersion, report.left_alone(),
                  (mended == 0 ? "" : fmt::format("; {} sums of attempts counted again", mended)),
                  (report.stopped() ? "; stopped, to be gone on with" : ""));
  RETURN_IF_ERROR(tools.writer.run([&](Connection& writer) {
    AuditRow line{0, wallNowNs(), by_whom.name, "rescore all", exercise_id, what};
    return AuditStore(writer).add(line);
  }));
  return report;
}

Result<pb::RescoreReport> RescoringRuns::run(const Doer& by_whom, const pb::RescoreAll& call) {
  std::unique_lock one_run(mutex_, std::try_to_lock);
  if (!one_run)
    return Error{ErrorCode::kUnavailable, "another run of rescoring is under way: try again when it is done"};
  std::optional<DutyLock> duty;
  if (!call.dry_run()) {
    ASSIGN_OR_RETURN(duty, long_work_.duties->take(Duty::kRescoring));
    if (!duty)
      return Error{ErrorCode::kUnavailable,
                   "a run of rescoring is under way at another server: try again when it is done"};
  }
  const RescoreTools tools{
      writer_,
      readers_,
      [this](Connection& reader, const Uuid& id) { return scoring_.scoreSession(reader, id); },
      [this] { return backups_.isUnderWay(); },
      long_work_.is_stopped,
      long_work_.pace};
  // an unknown name would otherwise give "0 sessions"
  {
    ASSIGN_OR_RETURN(auto reader, readers_.borrow());
    if (auto known = RetentionStore(*reader).checkExercise(call.exercise_id(), "exercise"); !known)
      return Error{ErrorCode::kNotFound, known.error().message};
  }
  return runRescoring(tools, call.exercise_id(), by_whom, call.dry_run());
}

}  // namespace needlelab
