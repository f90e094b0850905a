#include "db/service/records/retention_runs.h"

#include <fmt/core.h>

#include <charconv>
#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

#include "common/base/time/clock.h"
#include "db/service/context/backups.h"
#include "db/service/scoring/session_scoring.h"
#include "db/sessions/seen_time.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

/// Permission for one retention run; the destructor returns it. `run`, guarded by `mutex`, is the current
/// run.
class RetentionTurn {
 public:
  RetentionTurn(std::mutex& mutex, std::optional<RunUnderWay>& run, RunUnderWay wanted)
      : mutex_(mutex), run_(run) {
    const std::lock_guard lock(mutex_);
    other_ = run_;
    if (mine()) run_ = std::move(wanted);
  }
  ~RetentionTurn() {
    if (!mine()) return;
    const std::lock_guard lock(mutex_);
    run_.reset();
  }
  RetentionTurn(const RetentionTurn&) = delete;
  RetentionTurn& operator=(const RetentionTurn&) = delete;

  [[nodiscard]] bool mine() const { return !other_; }
  /// The current run, if another one is in progress.
  [[nodiscard]] const std::optional<RunUnderWay>& other() const { return other_; }

 private:
  std::mutex& mutex_;
  std::optional<RunUnderWay>& run_;
  std::optional<RunUnderWay> other_;
};

}  // namespace

Result<pb::RetentionReport> RetentionRuns::runOnRequest(const Doer& by_whom, bool dry_run) {
  // starting a run confirms the clock
  if (!dry_run)
    RETURN_IF_ERROR(
        writer_.run([](Connection& writer) { return SeenTimeStore(writer).confirm(wallNowNs()); }));
  return run(by_whom, dry_run);
}

Result<pb::RetentionReport> RetentionRuns::run(const Doer& by_whom, bool dry_run) {
  const std::int64_t now = wallNowNs();
  std::optional<RetentionTurn> turn;
  if (!dry_run) {
    turn.emplace(mutex_, run_, RunUnderWay{by_whom, now});
    if (const auto& other = turn->other()) {
      return Error{ErrorCode::kUnavailable,
                   fmt::format("a run of retention is under way since {} by {}: try again when it is done; a "
                               "dry run says what is left",
                               localTime(other->begun_unix_ns, TimeForm::kZoned), other->by_whom.name)};
    }
  }
  std::optional<DutyLock> duty;
  RetentionTools with = tools();
  if (!dry_run) {
    ASSIGN_OR_RETURN(duty, long_work_.duties->take(Duty::kRetention));
    if (!duty)
      return Error{ErrorCode::kUnavailable,
                   "a run of retention is under way at another server: try again when it is done; a dry run "
                   "says what is left"};
    // if the connection was lost and another server got the duty, its run comes first
    with.hold = [&duty, hold = std::move(with.hold)] {
      const auto held = duty->isHeld();
      return hold() || (held && !*held);
    };
  }
  auto report = runRetention(with, by_whom, now, dry_run);
  // an original that is gone has no path, as after a restart; runs that remove nothing must not discard
  // others' comparisons
  if (!dry_run && (!report || report->thinned() + report->deleted() > 0)) scoring_.forgetRecordings();
  return report;
}

Result<std::optional<pb::RetentionReport>> RetentionRuns::daily() {
  ASSIGN_OR_RETURN(const bool is_ours, long_work_.duties->isOurs());
  if (!is_ours) {
    // once a day recordings are read again: the other server may have removed some
    scoring_.forgetRecordings();
    return std::optional<pb::RetentionReport>();
  }
  const std::int64_t now = wallNowNs();
  std::int64_t last = 0;
  std::string ahead;
  {
    ASSIGN_OR_RETURN(auto reader, readers_.borrow());
    ASSIGN_OR_RETURN(const auto noted, MetaStore(*reader).get("retention_unix_ns"));
    if (noted) std::from_chars(noted->data(), noted->data() + noted->size(), last);
    // reported even if no run was noted: the server or its first policy is new
    ASSIGN_OR_RETURN(ahead, SeenTimeStore(*reader).aheadText(now));
  }
  if (last != 0 && (now < last || now - last > kMaxAhead_ns)) {
    return Error{ErrorCode::kUnavailable,
                 fmt::format("the last run of retention is noted as {} days ago: when the server's clock is "
                             "right, confirm it by: needlelab-admin retention run",
                             (now - last) / 86'400'000'000'000)};
  }
  if (!ahead.empty()) return Error{ErrorCode::kUnavailable, ahead};
  // notes the days even in a lab where nothing is closed for weeks
  RETURN_IF_ERROR(writer_.run([now](Connection& writer) { return SeenTimeStore(writer).note(now); }));
  auto report = run({"retention"}, false);
  // once a day all recordings are read again
  scoring_.forgetRecordings();
  if (!report) return report.error();
  return std::optional(std::move(*report));
}

std::string RetentionRuns::removeErased(const RetentionPace& pace, std::size_t max_pieces,
                                        LeftoversSoFar& so_far) {
  const RetentionTurn turn(mutex_, run_, {{"an erasure"}, wallNowNs()});
  if (!turn.mine()) {
    so_far.more = false;
    return "A run of retention is under way: the chunks go with the next one, at the latest tomorrow "
           "(at once by needlelab-admin retention run when this one has ended). ";
  }
  const auto duty = long_work_.duties->take(Duty::kRetention);
  if (duty && !*duty) {
    so_far.more = false;
    return "A run of retention is under way at another server: the chunks go with the next one, at the "
           "latest "
           "tomorrow (at once by needlelab-admin retention run when that one has ended). ";
  }
  RetentionTools with = tools();
  with.pace = pace;
  const auto removed = removeSomeLeftovers(with, max_pieces, so_far);
  if (removed && so_far.more && !with.stop) return {};
  const bool ended = std::exchange(so_far.more, false);
  if (!removed)
    return "Its chunks are not all removed yet (" + removed.error().message +
           "): they go with the next run of retention, at the latest tomorrow (at once by needlelab-admin "
           "retention run). ";
  if (ended) return "The program is ending: the chunks go with the next run of retention. ";
  if (so_far.damaged.empty()) return {};
  return fmt::format(
      "{} recordings are damaged, and what is left of them could not be removed: {} (see needlelab-admin "
      "check). ",
      so_far.damaged.size(), so_far.damaged.begin()->second);
}

RetentionTools RetentionRuns::tools() {
  return {writer_,
          readers_,
          [this](const Uuid& id) -> Status {
            // an exception (out of memory) concerns this recording only
            try {
              return scoring_.settleRecording(id);
            } catch (const std::exception& thrown) {
              return Error{ErrorCode::kFailed,
                           fmt::format("session {}: scoring failed inside: {}", uuidText(id), thrown.what())};
            }
          },
          [this] { return backups_.isUnderWay(); },
          long_work_.is_stopped,
          long_work_.pace,
          [this]() -> std::optional<std::uint64_t> {
            std::error_code error;
            const auto space = std::filesystem::space(readers_.path().parent_path(), error);
            if (error) return std::nullopt;
            return space.available;
          }};
}

}  // namespace needlelab
