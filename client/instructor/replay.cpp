// A stored session again, at the speed of its own clock, with what was written beside it.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "gesture/chunk.h"
#include "instructor/headless.h"
#include "instructor/plunger_watch.h"
#include "instructor/update.h"

namespace needlelab {
namespace {

constexpr double kDefaultRateHz = 10;
constexpr std::uint32_t kChunksAtOnce = 16;

class Replay {
 public:
  explicit Replay(const HeadlessRun& run) : run_(run) {}

  Status run() {
    if (auto status = readHead(); !status.ok()) return status;
    std::uint64_t next = 0;
    bool end = false;
    while (!end && !run_.over()) {
      auto chunks = readChunks(next);
      if (!chunks.ok()) return chunks.error();
      next += static_cast<std::uint64_t>(chunks->chunks_size());
      end = chunks->end() || chunks->chunks_size() == 0;
      for (const pb::Chunk& chunk : chunks->chunks()) {
        const auto samples = decodeChunk(viewOf(chunk.data()));
        if (!samples.ok()) {
          return Error{samples.error().code,
                       "chunk " + std::to_string(chunk.seq()) + ": " + samples.error().message};
        }
        if (!show(*samples)) break;
      }
    }
    summary();
    return {};
  }

 private:
  /// The description and the annotations.
  Status readHead() {
    pb::Request request;
    request.mutable_get_session()->set_session_id(sessionBytes(run_.options));
    auto reply = run_.link.client().call(request);
    if (!reply.ok()) return reply.error();
    info_ = reply->session();
    const auto& d = info_.description();
    run_.note("session " + run_.options.session + " of " + d.trainee() + " at " + d.station() +
              ", exercise " + d.exercise_id() + ", profile " + d.profile_id() + ", " +
              std::to_string(info_.samples()) + " samples, " + pb::SessionState_Name(info_.state()));
    pb::Request list;
    list.mutable_list_annotations()->set_session_id(sessionBytes(run_.options));
    auto annotations = run_.link.client().call(list);
    if (!annotations.ok()) return annotations.error();
    annotations_.assign(annotations->annotations().annotations().begin(),
                        annotations->annotations().annotations().end());
    std::stable_sort(annotations_.begin(), annotations_.end(),
                     [](const auto& a, const auto& b) { return a.tick() < b.tick(); });
    return {};
  }

  Result<pb::Chunks> readChunks(std::uint64_t from) {
    pb::Request request;
    request.mutable_read_chunks()->set_session_id(sessionBytes(run_.options));
    request.mutable_read_chunks()->set_from_seq(from);
    request.mutable_read_chunks()->set_max_chunks(kChunksAtOnce);
    for (;;) {
      auto reply = run_.link.client().call(request);
      if (reply.ok()) return std::move(*reply->mutable_chunks());
      if (reply.error().code != ErrorCode::kUnavailable) return reply.error();
      if (const auto back = run_.recover(reply.error()); !back.ok()) return back.error();
    }
  }

  /// False: the time is over.
  bool show(const std::vector<GestureSample>& samples) {
    const double rate_hz = run_.options.rate_hz.value_or(kDefaultRateHz);
    for (const GestureSample& sample : samples) {
      if (samples_ == 0) first_ns_ = sample.time_ns;
      ++samples_;
      plunger_.add(sample);
      const double time_s = 1e-9 * static_cast<double>(sample.time_ns - first_ns_);
      for (; noted_ < annotations_.size() && annotations_[noted_].tick() <= sample.tick; ++noted_) {
        run_.note(annotations_[noted_].author() + ": " + annotations_[noted_].text());
      }
      if (rate_hz > 0 && time_s < next_line_s_) continue;
      if (rate_hz > 0)
        next_line_s_ += 1 / rate_hz * std::max(1.0, 1 + std::floor((time_s - next_line_s_) * rate_hz));
      if (!waitUntil(time_s)) return false;
      Update update = updateOf(sample);
      update.syringe = plunger_.action();
      update.time_s = time_s;
      update.station = info_.description().station();
      update.trainee = info_.description().trainee();
      update.session = run_.options.session;
      run_.line(run_.options.json ? jsonLine(update) : textLine(update));
      ++lines_;
    }
    return !run_.over();
  }

  bool waitUntil(double time_s) {
    if (run_.options.speed <= 0) return !run_.over();
    using Clock = ServerLink::Clock;
    const auto due = started_ + std::chrono::duration_cast<Clock::duration>(
                                    std::chrono::duration<double>(time_s / run_.options.speed));
    while (Clock::now() < due) {
      if (run_.over()) return false;
      // waiting here keeps the connection alive; a loss shows at the next chunk
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(due - Clock::now());
      const auto nap = std::clamp(left, std::chrono::milliseconds(1), std::chrono::milliseconds(100));
      if (run_.link.client().connected()) {
        (void)run_.link.client().receive(nap).ok();
      } else {
        std::this_thread::sleep_for(nap);
      }
    }
    return true;
  }

  void summary() const {
    if (run_.options.json) {
      nlohmann::ordered_json json = {{"type", "summary"}, {"samples", samples_}, {"updates", lines_}};
      const auto score = nlohmann::ordered_json::parse(info_.score_json(), nullptr, false);
      if (!score.is_discarded()) json["score"] = score;
      run_.line(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
      return;
    }
    run_.line("samples " + std::to_string(samples_) + " of " + std::to_string(info_.samples()) + "  lines " +
              std::to_string(lines_));
  }

  const HeadlessRun& run_;
  pb::SessionInfo info_;
  std::vector<pb::Annotation> annotations_;
  std::size_t noted_ = 0;
  PlungerWatch plunger_;
  std::uint64_t samples_ = 0, lines_ = 0;
  std::int64_t first_ns_ = 0;
  double next_line_s_ = 0;
  const ServerLink::Clock::time_point started_ = ServerLink::Clock::now();
};

}  // namespace

Status replaySession(const HeadlessRun& run) {
  return Replay(run).run();
}

}  // namespace needlelab
