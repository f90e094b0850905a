#include "client/station/run/loop/black_box.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <iterator>
#include <string_view>
#include <utility>

#include "client/station/run/loop/real_time.h"
#include "common/base/files/files.h"
#include "common/base/text/csv.h"

namespace needlelab {
namespace {

constexpr double kBefore_s = 2, kAfter_s = 0.05, kLongestAfter_s = 0.5;
constexpr double kSpare_s = 1;  // extra space while the reader copies a range

// only one thread writes it, so it needs no atomic increment
void countUp(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

/// Writes a row or the column names from one list, so that they cannot differ. A name comes in parts. Uses no
/// heap but `out`'s.
class Row {
 public:
  Row(std::string& out, bool names) : out_(out), names_(names) {}
  void whole(std::string_view name, auto value) {
    begin();
    if (names_) {
      out_ += name;
    } else {
      const fmt::format_int text(value);
      out_.append(text.data(), text.size());
    }
  }
  void real(double value, auto... name) {
    begin();
    if (names_)
      (out_.append(name), ...);
    else
      appendNumber(out_, value);
  }
  void pose(std::string_view frames, const Pose& X) {
    vector(X.p, "_m", "p_", frames);
    real(X.q.x, "q_", frames, "_x");
    real(X.q.y, "q_", frames, "_y");
    real(X.q.z, "q_", frames, "_z");
    real(X.q.w, "q_", frames, "_w");
  }
  void wrench(std::string_view what, const Wrench& w) {
    vector(w.force_N, "_N", what, "_force_W");
    vector(w.torque_Nm, "_Nm", what, "_torque_W");
  }
  void end() { out_ += '\n'; }

 private:
  void begin() {
    if (!first_) out_ += ',';
    first_ = false;
  }
  void vector(Vec3 v, std::string_view unit, auto... name) {
    real(v.x, name..., "_x", unit);
    real(v.y, name..., "_y", unit);
    real(v.z, name..., "_z", unit);
  }
  std::string& out_;
  bool names_, first_ = true;
};

void write(Row row, const BlackBoxTick& t) {
  row.whole("tick", t.tick);
  row.whole("missed_before", t.missed_before);
  row.whole("due_ns", t.due_ns);
  row.whole("late_ns", t.late_ns);
  row.whole("read_ns", t.read_ns);
  row.whole("engine_ns", t.engine_ns);
  row.whole("write_ns", t.write_ns);
  row.whole("record_ns", t.record_ns);
  row.whole("fresh", static_cast<int>(t.fresh));
  row.whole("condition", t.reading.condition);
  row.whole("buttons", t.reading.buttons);
  row.real(t.reading.plunger, "plunger");
  row.real(t.reading.speed_mps, "handle_speed_mps");
  row.pose("WH", t.reading.X_WH);
  row.pose("WT", t.X_WT);
  row.whole("phase", static_cast<int>(t.phase));
  row.whole("layer", static_cast<int>(t.layer));
  row.real(t.depth_m, "depth_m");
  row.real(t.insertion_m, "insertion_m");
  row.real(t.speed_mps, "speed_mps");
  row.wrench("wanted", t.wanted_W);
  row.wrench("rendered", t.rendered_W);
  row.whole("flags", t.flags);
  row.whole("fault", static_cast<int>(t.fault));
  row.end();
}

namespace fs = std::filesystem;

// leaves half of the box's spare second for copying and writing
constexpr std::int64_t kPollPeriod_ns = 50'000'000;

constexpr std::size_t kRowBytes = 600;

/// Replaces `text` by a header with units (client/station/README.md explains the columns), then one row per
/// tick. Numbers read back bit for bit.
void writeCsv(const std::vector<BlackBoxTick>& ticks, std::string& text) {
  text.clear();
  write(Row(text, true), {});
  for (const BlackBoxTick& tick : ticks) write(Row(text, false), tick);
}

Status write(const fs::path& path, const std::string& text) {
  if (const auto made = makePrivateFolder(path.parent_path()); !made)
    return Error{ErrorCode::kUnavailable, made.error().message};
  // private to the station's user, like the rest of the spool
  return writeFileAtomically(path, viewOf(text), 0600);
}

}  // namespace

BlackBox::BlackBox(double rate_hz, std::uint32_t max_dumps)
    : before_(ticksIn(kBefore_s, rate_hz)),
      after_(ticksIn(kAfter_s, rate_hz)),
      longest_after_(ticksIn(kLongestAfter_s, rate_hz)),
      max_dumps_(std::clamp(max_dumps, 1u, kMaxDumps)),
      ring_(before_ + longest_after_ + ticksIn(kSpare_s, rate_hz)) {}

// returns whether the next tick would overwrite one that the reader has not copied yet
bool BlackBox::full() noexcept {
  const std::uint32_t taken = taken_.load(std::memory_order_acquire);
  assert(taken <= offered_ && offered_ <= max_dumps_);
  if (taken == offered_) return false;
  assert(written_ >= firsts_[taken]);
  // ranges are offered in order, so the oldest remaining one begins first
  return written_ - firsts_[taken] >= ring_.size();
}

BlackBoxTick& BlackBox::next() noexcept {
  refused_last_ = full();
  return refused_last_ ? nowhere_ : ring_[written_ % ring_.size()];
}

void BlackBox::commit() noexcept {
  if (refused_last_) {
    countUp(refused_);
    return;
  }
  ++written_;
  if (open_ && written_ >= ends_at_) offer();
}

void BlackBox::trigger(BlackBoxCause cause, Fault fault, std::uint64_t tick) noexcept {
  countUp(triggers_);
  if (open_) {
    ++dump_.triggers;
    ends_at_ = std::min(written_ + 1 + after_, opened_at_ + 1 + longest_after_);
    return;
  }
  if (offered_ == max_dumps_) {
    countUp(not_kept_);
    return;
  }
  assert(offered_ < max_dumps_);
  open_ = true;
  opened_at_ = written_;
  ends_at_ = written_ + 1 + after_;
  dump_ = {offered_ + 1, cause, fault, tick, 1, written_ - std::min(written_, before_), 0};
}

void BlackBox::offer() noexcept {
  assert(open_ && offered_ < max_dumps_ && dump_.first <= written_);
  open_ = false;
  dump_.count = written_ - dump_.first;
  assert(dump_.count <= ring_.size());
  firsts_[offered_++] = dump_.first;
  dumps_.push(dump_);  // never full: there are at most as many ranges as places
}

void BlackBox::finish() noexcept {
  if (open_) offer();
}

bool BlackBox::take(BlackBoxDump& dump, std::vector<BlackBoxTick>& ticks) {
  if (!dumps_.pop(dump)) return false;
  ticks.clear();
  ticks.reserve(mostTicks());
  for (std::uint64_t n = dump.first; n < dump.first + dump.count; ++n)
    ticks.push_back(ring_[n % ring_.size()]);
  // from here on the loop may overwrite them
  taken_.store(taken_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  return true;
}

std::string blackBoxText(const BlackBoxDump& dump) {
  const char* cause = dump.cause == BlackBoxCause::kFault ? faultText(dump.fault)
                                                          : "20 ms of ticks were missed within a short time";
  std::string text = fmt::format("black box {}: {}, at tick {}", dump.number, cause, dump.tick);
  if (dump.triggers > 1) text += fmt::format(", and {} more in the same stretch", dump.triggers - 1);
  return text;
}

BlackBoxWriter::BlackBoxWriter(BlackBox& box, fs::path folder, std::string session,
                               std::function<void(const std::string&)> log, TimeSource& time, bool own_thread)
    : box_(box), folder_(std::move(folder)), session_(std::move(session)), log_(std::move(log)), time_(time) {
  // reserve memory now, so that writing a range later needs no more
  ticks_.reserve(box.mostTicks());
  text_.reserve((box.mostTicks() + 1) * kRowBytes);
  if (own_thread) thread_ = std::thread([this] { run(); });
}

void BlackBoxWriter::run() {
  for (bool last = false; !last;) {
    const std::int64_t due_ns = pass();
    std::unique_lock lock(mutex_);
    last = time_.waitUntilNs(finish_ordered_, lock, due_ns, [this] { return finish_; });
  }
}

std::int64_t BlackBoxWriter::pass() {
  BlackBoxDump dump;
  while (box_.take(dump, ticks_)) {
    const fs::path path = folder_ / fmt::format("{}-{:02}.csv", session_, dump.number);
    writeCsv(ticks_, text_);
    const Status status = write(path, text_);
    auto& counter = status.ok() ? files_ : not_written_;
    counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    log_(blackBoxText(dump) + (status.ok() ? "; the 2 s before it and what followed are in " + path.string()
                                           : "; it is not kept: " + status.error().message));
  }
  return time_.nowNs() + kPollPeriod_ns;
}

void BlackBoxWriter::finish() {
  if (std::exchange(finished_, true)) return;
  {
    const std::scoped_lock lock(mutex_);
    finish_ = true;
  }
  finish_ordered_.notify_all();
  if (thread_.joinable()) thread_.join();
  pass();
  const BlackBoxCounts all = counts();
  if (all.not_kept > 0)
    log_(fmt::format(
        "black box: {} of {} faults and storms of missed ticks were not saved: the session has its most files",
        all.not_kept, all.triggers));
  if (all.ticks_refused > 0)
    log_(fmt::format("black box: {} ticks are not in it, because the disk was more than a second behind",
                     all.ticks_refused));
}

BlackBoxCounts BlackBoxWriter::counts() const noexcept {
  return {box_.triggers(), files_.load(std::memory_order_relaxed),
          not_written_.load(std::memory_order_relaxed), box_.droppedDumps(), box_.ticksRefused()};
}

std::size_t removeOldBlackBoxes(const fs::path& folder, std::int64_t age_s) {
  std::size_t removed = 0;
  std::error_code error;
  const auto oldest = fs::file_time_type::clock::now() - std::chrono::seconds(age_s);
  for (auto at = fs::directory_iterator(folder, error); !error && at != fs::end(at); at.increment(error)) {
    std::error_code ignored;
    if (at->path().extension() == ".csv" && at->last_write_time(ignored) < oldest && !ignored)
      removed += fs::remove(at->path(), ignored) ? 1 : 0;
  }
  return removed;
}

}  // namespace needlelab
