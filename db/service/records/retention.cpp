#include "db/service/records/retention.h"

#include <fmt/core.h>
#include <algorithm>
#include <charconv>
#include <cstddef>
#include <limits>
#include <utility>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "common/gesture/thinning.h"
#include "db/audit/audit.h"
#include "db/erasure/retention_store.h"
#include "db/sessions/session_store.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr int kMaxSteps = 1000;                 // per report
constexpr std::size_t kSamplesPerChunk = 1000;  // of a thinned recording
constexpr std::uint32_t kChunksAtOnce = 64;     // per read

/// The facts from a complete read of a recording.
struct ReadOriginal {
  Bytes crcs;  ///< of its chunks, u32 little-endian
  SessionHash hash;
};

class Run {
 public:
  Run(const RetentionTools& tools, Doer by_whom, std::int64_t now_unix_ns)
      : tools_(tools), by_whom_(std::move(by_whom)), now_unix_ns_(now_unix_ns) {}

  Result<pb::RetentionReport> run(bool dry_run) {
    report_.set_dry_run(dry_run);
    LeftoversSoFar leftovers;
    if (!dry_run) {
      RETURN_IF_ERROR(removeLeftovers(std::numeric_limits<std::size_t>::max(), leftovers));
      for (const auto& [session, fault] : leftovers.damaged) noteDamaged(session, fault);
    }
    ASSIGN_OR_RETURN(auto due, read([&](Connection& c) { return RetentionStore(c).due(now_unix_ns_); }));
    // deletions first: they free space for the thinned recordings
    std::stable_partition(due.begin(), due.end(), [](const DueRecording& one) { return one.deletes; });
    for (const DueRecording& one : due) {
      if (stopped()) break;
      // already in the report
      if (leftovers.damaged.contains(one.session)) continue;
      RETURN_IF_ERROR(take(one, dry_run));
    }
    report_.set_stopped(stopped());
    if (!dry_run && !stopped()) {
      RETURN_IF_ERROR(noteRun());
    }
    ASSIGN_OR_RETURN(const auto space, read([](Connection& c) { return RetentionStore(c).space(); }));
    report_.set_free_bytes(space.free_bytes);
    return report_;
  }

  Status removeLeftovers(std::size_t pieces, LeftoversSoFar& so_far) {
    ASSIGN_OR_RETURN(const auto sessions, read([](Connection& c) { return RetentionStore(c).leftovers(); }));
    for (std::size_t next = 0; next < sessions.size(); --pieces) {
      if (pieces == 0 || stopped()) return {};
      RETURN_IF_ERROR(removeUnreadRows(sessions, next, so_far));
    }
    so_far.more = false;
    return {};
  }

 private:
  void noteDamaged(const Uuid& session, const std::string& fault) {
    pb::RetentionStep step;
    step.set_action(pb::RetentionStep::LEFT_ALONE);
    step.set_session_id(session.data(), session.size());
    step.set_text(fault);
    count(step);
    if (report_.steps_size() < kMaxSteps) *report_.add_steps() = std::move(step);
  }

  [[nodiscard]] bool stopped() const { return tools_.stop.load(std::memory_order_relaxed); }

  template <typename F>
  auto read(const F& work) -> decltype(work(std::declval<Connection&>())) {
    ASSIGN_OR_RETURN(auto reader, tools_.readers.borrow());
    return work(*reader);
  }

  /// An error if the disk has less free space than `keep_free` plus `more`, the bytes to be written. Called
  /// before each piece: a full disk would stop the writer, and the server with it.
  Status checkDiskRoom(std::uint64_t keep_free, std::uint64_t more) {
    if (!tools_.room) return {};
    const auto left = tools_.room();
    if (!left) return {};
    if (*left >= keep_free + more) return {};
    // free pages in the database are used before the file grows
    ASSIGN_OR_RETURN(const auto space, read([](Connection& c) { return RetentionStore(c).space(); }));
    if (*left >= keep_free && *left + space.free_bytes >= keep_free + more) return {};
    return Error{ErrorCode::kUnavailable,
                 fmt::format("no room: the database's disk has {} MiB left, {} MiB shall stay free and up to "
                             "{} MiB would be written: make room there",
                             *left >> 20, keep_free >> 20, (more >> 20) + 1)};
  }

  /// Runs one piece of work on the writer, then pauses.
  Status piece(const DbWriter::Work& work) {
    while ((tools_.writer.counters().waiting > tools_.pace.queue || tools_.hold()) && !stopped())
      tools_.pace.sleep(tools_.pace.look);
    auto done = tools_.writer.run(work);
    tools_.pace.sleep(tools_.pace.pause);
    return done;
  }

  /// Processes one recording. Records a fault of this session alone and continues; a failed database ends the
  /// run.
  Status take(const DueRecording& due, bool dry_run) {
    pb::RetentionStep step;
    step.set_action(due.deletes ? pb::RetentionStep::DELETE : pb::RetentionStep::THIN);
    step.set_session_id(due.session.data(), due.session.size());
    step.set_exercise_id(due.exercise_id);
    step.set_bytes_before(due.stored_bytes);
    step.set_text(due.reason);
    if (due.clock_was_behind) {
      step.set_action(pb::RetentionStep::LEFT_ALONE);
      step.set_bytes_after(due.stored_bytes);
    } else if (due.waits_for_backup) {
      step.set_action(pb::RetentionStep::WAITS_FOR_BACKUP);
      step.set_bytes_after(due.stored_bytes);
    } else if (!dry_run) {
      const auto left = due.deletes ? remove(due) : thin(due);
      if (!left && tools_.writer.failed()) return left.error();
      if (left && !*left) return {};  // stopped before the end
      if (left) {
        step.set_bytes_after(**left);
      } else {
        step.set_action(pb::RetentionStep::LEFT_ALONE);
        step.set_bytes_after(due.stored_bytes);
        step.set_text(left.error().message);
      }
    }
    count(step);
    if (report_.steps_size() < kMaxSteps) *report_.add_steps() = std::move(step);
    return {};
  }

  void count(const pb::RetentionStep& step) {
    switch (step.action()) {
      case pb::RetentionStep::THIN:
        report_.set_thinned(report_.thinned() + 1);
        break;
      case pb::RetentionStep::DELETE:
        report_.set_deleted(report_.deleted() + 1);
        break;
      case pb::RetentionStep::WAITS_FOR_BACKUP:
        report_.set_waiting_for_backup(report_.waiting_for_backup() + 1);
        return;
      default:
        report_.set_left_alone(report_.left_alone() + 1);
        return;
    }
    report_.set_bytes_before(report_.bytes_before() + step.bytes_before());
    report_.set_bytes_after(report_.bytes_after() + step.bytes_after());
  }

  /// Reads and checks every chunk in order. False: stopped.
  Result<bool> readAll(const Uuid& session, std::uint64_t chunks, ReadOriginal& original,
                       const std::function<Status(const StoredChunk&)>& each) {
    std::uint64_t next = 0;
    while (next < chunks) {
      if (stopped()) return false;
      // short reads: a long one would block the log's checkpoints
      ASSIGN_OR_RETURN(const auto some, read([&](Connection& c) {
                         return SessionStore(c).readChunks(session, next, kChunksAtOnce, tools_.pace.bytes);
                       }));
      if (some.empty()) return Error{ErrorCode::kCorrupt, fmt::format("chunk {} is missing", next)};
      for (const StoredChunk& chunk : some) {
        original.hash.update(chunk.bytes);
        original.crcs.insert(original.crcs.end(), chunk.bytes.end() - 4, chunk.bytes.end());
        RETURN_IF_ERROR(each(chunk));
      }
      next += some.size();
    }
    return true;
  }

  /// Returns the remaining bytes, or nothing if stopped.
  Result<std::optional<std::uint64_t>> remove(const DueRecording& due) {
    ASSIGN_OR_RETURN(const auto info, read([&](Connection& c) { return SessionStore(c).info(due.session); }));
    RETURN_IF_ERROR(checkDiskRoom(tools_.pace.min_free_bytes / 8, 0));
    ReadOriginal original;
    if (!due.thinned) {
      RETURN_IF_ERROR(tools_.settle(due.session));
    }
    // an unreadable chunk may be on a damaged page, which must not be changed: keep a damaged recording
    ASSIGN_OR_RETURN(const auto all, readAll(due.session, info.chunks(), original,
                                             [](const StoredChunk&) { return Status(); }));
    if (!all) return std::optional<std::uint64_t>();
    if (textOf(original.hash.digest()) != info.hash())
      return Error{ErrorCode::kCorrupt, "session " + uuidText(due.session) +
                                            ": the hash over its chunks is not the one that was noted"};
    RETURN_IF_ERROR(piece([&](Connection& c) {
      return RetentionStore(c).markDeleted(due, original.crcs, by_whom_, now_unix_ns_);
    }));
    RETURN_IF_ERROR(removeRows(due.session));
    return std::optional<std::uint64_t>(0);
  }

  /// Returns as remove().
  Result<std::optional<std::uint64_t>> thin(const DueRecording& due) {
    ASSIGN_OR_RETURN(const auto info, read([&](Connection& c) { return SessionStore(c).info(due.session); }));
    const double rate_hz = info.description().rate_hz(), target_hz = due.policy.thin_rate_hz();
    const std::string name = "session " + uuidText(due.session);
    if (info.samples() == 0) return Error{ErrorCode::kNotFound, name + " has no samples to thin"};
    RETURN_IF_ERROR(checkDiskRoom(tools_.pace.min_free_bytes, due.stored_bytes));
    if (target_hz >= rate_hz && due.policy.thin_coarser() <= 1)
      return Error{ErrorCode::kInvalidInput, fmt::format("{} has {:f} Hz: nothing to thin", name, rate_hz)};
    RETURN_IF_ERROR(tools_.settle(due.session));
    RETURN_IF_ERROR(piece(
        [&](Connection& c) { return RetentionStore(c).beginDerived(due.session, target_hz, now_unix_ns_); }));

    const auto written = writeThinned(due, info);
    if (!written || !*written) {
      // discard an incomplete thinned recording; if this fails, the next run removes it
      if (auto done = removeRows(due.session); !done && written) return done.error();
      if (!written) return written.error();
      return std::optional<std::uint64_t>();
    }
    RETURN_IF_ERROR(removeRows(due.session));
    return std::optional<std::uint64_t>((**written).stored_bytes);
  }

  /// Writes the thinned recording, reads it back, switches over.
  Result<std::optional<DerivedSums>> writeThinned(const DueRecording& due, const pb::SessionInfo& info) {
    Thinner thinner(info.description().rate_hz(), due.policy.thin_rate_hz());
    ReadOriginal original;
    std::vector<GestureSample> samples;
    std::vector<Bytes> ready;
    std::optional<Resolution> resolution;
    DerivedSums written;
    SessionHash written_hash;

    const auto encode = [&](bool all) {
      while (samples.size() >= kSamplesPerChunk || (all && !samples.empty())) {
        const std::size_t count = std::min(samples.size(), kSamplesPerChunk);
        ready.push_back(encodeChunk(*resolution, std::span(samples).first(count)));
        samples.erase(samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count));
      }
    };
    const auto store = [&]() -> Status {
      if (ready.empty()) return {};
      RETURN_IF_ERROR(checkDiskRoom(tools_.pace.min_free_bytes, 0));
      auto done = piece([&](Connection& c) -> Status {
        std::uint64_t seq = written.chunks;
        for (const Bytes& chunk : ready) {
          RETURN_IF_ERROR(RetentionStore(c).appendDerived(due.session, seq++, chunk));
        }
        return {};
      });
      if (!done) return done;
      for (const Bytes& chunk : ready) {
        written_hash.update(chunk);
        written.stored_bytes += chunk.size();
        ++written.chunks;
      }
      ready.clear();
      return {};
    };
    ASSIGN_OR_RETURN(const auto all,
                     readAll(due.session, info.chunks(), original, [&](const StoredChunk& chunk) -> Status {
                       if (!resolution) {
                         ASSIGN_OR_RETURN(const auto head, inspectChunk(chunk.bytes));
                         resolution = coarser(head.resolution, std::max(1.0, due.policy.thin_coarser()));
                       }
                       ASSIGN_OR_RETURN(const auto decoded, decodeChunk(chunk.bytes));
                       const std::size_t before = samples.size();
                       for (const GestureSample& sample : decoded) thinner.add(sample, samples);
                       written.samples += samples.size() - before;
                       encode(false);
                       std::size_t bytes = 0;
                       for (const Bytes& one : ready) bytes += one.size();
                       return bytes < tools_.pace.bytes ? Status() : store();
                     }));
    if (!all) return std::optional<DerivedSums>();
    const std::size_t before = samples.size();
    thinner.finish(samples);
    written.samples += samples.size() - before;
    encode(true);
    RETURN_IF_ERROR(store());
    written.hash = written_hash.digest();

    // never give up an original for a wrong copy, or for one that is not safely on disk
    const std::string name = "session " + uuidText(due.session);
    if (textOf(original.hash.digest()) != info.hash())
      return Error{ErrorCode::kCorrupt,
                   name + ": the hash over its chunks is not the one it was closed with"};
    ASSIGN_OR_RETURN(const auto stored,
                     read([&](Connection& c) { return RetentionStore(c).sums(due.session); }));
    if (stored.hash != written.hash || stored.samples != written.samples)
      return Error{ErrorCode::kCorrupt, name + ": its thinned recording was not read back as it was written"};
    RETURN_IF_ERROR(piece([&](Connection& c) {
      return RetentionStore(c).switchToDerived(due, stored, original.crcs, by_whom_, now_unix_ns_);
    }));
    return std::optional(stored);
  }

  /// Removes rows piece by piece. If stopped, leaves the rest to the next run.
  Status removeRows(const Uuid& session) {
    for (bool more = true; more && !stopped();) RETURN_IF_ERROR(removePiece(session, more));
    return {};
  }

  /// Removes one piece of rows that this run has not read yet, from the sessions at `next` on, after reading
  /// them: the writer must not be the first to hit a damaged page. Advances `next` past finished sessions.
  Status removeUnreadRows(const std::vector<Uuid>& sessions, std::size_t& next, LeftoversSoFar& so_far) {
    struct Part {
      std::size_t session = 0;  // index in `sessions`
      RetentionStore::RemovableRows looked;
    };
    std::vector<Part> parts;
    std::size_t end = next;
    // a session counts as at least one row, even if damaged
    for (std::uint32_t rows = 0; end < sessions.size() && rows < tools_.pace.rows; ++end) {
      if (so_far.damaged.contains(sessions[end])) continue;
      const auto looked = read(
          [&](Connection& c) { return RetentionStore(c).checkSome(sessions[end], tools_.pace.rows - rows); });
      rows += looked ? std::max(looked->rows, 1u) : 1;
      if (looked) {
        parts.push_back({end, *looked});
      } else if (tools_.writer.failed()) {
        return looked.error();
      } else {
        so_far.damaged.emplace(sessions[end], looked.error().message);
      }
    }
    std::size_t at = 0;  // index in `parts` of the first unfinished one
    const Status removed = parts.empty() ? Status() : piece([&](Connection& c) -> Status {
      RetentionStore store(c);
      for (at = 0; at < parts.size(); ++at) {
        const auto& [session, looked] = parts[at];
        if (looked.rows > 0) RETURN_IF_ERROR(store.removeSome(sessions[session], looked.rows));
        if (looked.more) return {};
        ASSIGN_OR_RETURN(const bool more, store.removeSome(sessions[session], 1));
        if (more) return {};
      }
      return {};
    });
    if (!removed && (tools_.writer.failed() || at == parts.size())) return removed;
    // nothing of the piece was removed: the next one skips this session
    if (!removed) {
      so_far.damaged.emplace(sessions[parts[at].session], removed.error().message);
    } else {
      next = at < parts.size() ? parts[at].session : end;
    }
    return {};
  }

  Status removePiece(const Uuid& session, bool& more) {
    return piece([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(more, RetentionStore(c).removeSome(session, tools_.pace.rows));
      return {};
    });
  }

  Status noteRun() {
    const std::string what =
        fmt::format("{} thinned, {} deleted, {} wait for a backup, {} left alone; {} bytes before, {} after",
                    report_.thinned(), report_.deleted(), report_.waiting_for_backup(), report_.left_alone(),
                    report_.bytes_before(), report_.bytes_after());
    return piece([&](Connection& c) -> Status {
      // a run without work adds no audit line
      if (report_.steps_size() > 0) {
        AuditRow line{0, now_unix_ns_, by_whom_.name, "retention run", "", what};
        RETURN_IF_ERROR(AuditStore(c).add(line));
      }
      return MetaStore(c).set("retention_unix_ns", std::to_string(now_unix_ns_));
    });
  }

  const RetentionTools& tools_;
  const Doer by_whom_;
  const std::int64_t now_unix_ns_;
  pb::RetentionReport report_;
};

}  // namespace

Result<pb::RetentionReport> runRetention(const RetentionTools& tools, const Doer& by_whom,
                                         std::int64_t now_unix_ns, bool dry_run) {
  return Run(tools, by_whom, now_unix_ns).run(dry_run);
}

Status removeSomeLeftovers(const RetentionTools& tools, std::size_t max_pieces, LeftoversSoFar& so_far) {
  return Run(tools, {"erasure"}, 0).removeLeftovers(max_pieces, so_far);
}

}  // namespace needlelab
