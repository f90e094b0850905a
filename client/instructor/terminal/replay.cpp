// Replays a stored session at its recorded speed, with remarks.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include <fmt/core.h>

#include "client/instructor/terminal/headless.h"
#include "client/instructor/terminal/update_line.h"
#include "common/base/text/strict_json.h"
#include "common/gesture/chunk.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr double kReplayRateHz = 10;
constexpr std::uint32_t kChunksAtOnce = 16;
constexpr std::int64_t kNap_ns = 100'000'000;  // between two checks of the connection

class Replay {
 public:
  explicit Replay(const HeadlessRun& run) : run_(run) {}

  Status run() {
    RETURN_IF_ERROR(readHead());
    std::uint64_t next = 0;
    bool end = info_.chunks() == 0;
    while (!end && !run_.over()) {
      ASSIGN_OR_RETURN(auto chunks, readChunks(next));
      for (const auto& damaged : chunks.damaged()) run_.note("damaged, omitted: " + damaged.text());
      const std::uint64_t behind =
          std::max(chunks.next_seq(), next + static_cast<std::uint64_t>(chunks.chunks_size()));
      end = chunks.end() || behind == next;
      next = behind;
      for (const pb::Chunk& chunk : chunks.chunks()) {
        const auto samples = decodeChunk(viewOf(chunk.data()));
        if (!samples.ok()) {
          return Error{samples.error().code,
                       fmt::format("chunk {}: {}", chunk.seq(), samples.error().message)};
        }
        if (!show(*samples)) break;
      }
    }
    summary();
    return {};
  }

 private:
  /// Reads description and annotations.
  Status readHead() {
    pb::Request request;
    request.mutable_get_session()->set_session_id(sessionBytes(run_.options));
    ASSIGN_OR_RETURN(auto reply, run_.client.call(request));
    info_ = reply.session();
    const auto& d = info_.description();
    if (const auto profile = parseProfile(d.profile_json(), "profile")) layer_names_ = layerNames(*profile);
    run_.note(fmt::format("session {} of {} at {}, exercise {}, profile {}, {} samples, {}",
                          run_.options.session, d.trainee(), d.station(), d.exercise_id(), d.profile_id(),
                          info_.samples(), pb::SessionState_Name(info_.state())));
    if (info_.has_removed_original()) run_.note("retention: " + info_.removed_original().reason());
    pb::Request list;
    list.mutable_list_annotations()->set_session_id(sessionBytes(run_.options));
    ASSIGN_OR_RETURN(auto annotations, run_.client.call(list));
    annotations_.assign(annotations.annotations().annotations().begin(),
                        annotations.annotations().annotations().end());
    std::stable_sort(annotations_.begin(), annotations_.end(),
                     [](const auto& a, const auto& b) { return a.tick() < b.tick(); });
    return {};
  }

  Result<pb::Chunks> readChunks(std::uint64_t from) {
    pb::Request request;
    request.mutable_read_chunks()->set_skip_damaged(true);
    request.mutable_read_chunks()->set_hash(info_.hash());
    request.mutable_read_chunks()->set_session_id(sessionBytes(run_.options));
    request.mutable_read_chunks()->set_from_seq(from);
    request.mutable_read_chunks()->set_max_chunks(kChunksAtOnce);
    for (;;) {
      auto reply = run_.client.call(request);
      if (reply.ok()) return std::move(*reply->mutable_chunks());
      if (reply.error().code != ErrorCode::kUnavailable) return reply.error();
      RETURN_IF_ERROR(recover(run_, reply.error()));
    }
  }

  /// Returns false when the time is over.
  bool show(const std::vector<GestureSample>& samples) {
    const double rate_hz = run_.options.rate_hz.value_or(kReplayRateHz);
    for (const GestureSample& sample : samples) {
      if (!first_ns_) first_ns_ = sample.time_ns;
      const double time_s = 1e-9 * static_cast<double>(sample.time_ns - *first_ns_);
      ++samples_;
      for (; noted_ < annotations_.size() && annotations_[noted_].tick() <= sample.tick; ++noted_) {
        run_.note(annotations_[noted_].author() + ": " + annotations_[noted_].text());
      }
      if (rate_hz > 0 && time_s < next_line_s_) continue;
      if (rate_hz > 0)
        next_line_s_ += 1 / rate_hz * std::max(1.0, 1 + std::floor((time_s - next_line_s_) * rate_hz));
      if (!waitUntil(time_s)) return false;
      Update update = updateOf(sample, layer_names_);
      update.time_s = time_s;
      update.station = info_.description().station();
      update.trainee = info_.description().trainee();
      update.session = run_.options.session;
      run_.update(update);
      ++lines_;
    }
    return !run_.over();
  }

  bool waitUntil(double time_s) {
    if (run_.options.speed <= 0) return !run_.over();
    const std::int64_t due_ns = started_ns_ + std::llround(1e9 * (time_s / run_.options.speed));
    for (std::int64_t now_ns = run_.time.nowNs(); now_ns < due_ns; now_ns = run_.time.nowNs()) {
      if (run_.over()) return false;
      // keeps the connection alive; a loss shows with the next chunk
      if (run_.client.connected()) (void)run_.client.receive(std::chrono::milliseconds(0)).ok();
      run_.time.sleepUntilNs(std::min(due_ns, now_ns + kNap_ns));
    }
    return true;
  }

  void summary() const {
    if (run_.options.json) {
      nlohmann::ordered_json json = {{"type", "summary"}, {"samples", samples_}, {"updates", lines_}};
      const auto score = readShallowJson<nlohmann::ordered_json>(info_.score_json());
      if (!score.is_discarded()) json["score"] = score;
      run_.line(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
      return;
    }
    run_.line(fmt::format("samples {} of {}  lines {}", samples_, info_.samples(), lines_));
  }

  const HeadlessRun& run_;
  pb::SessionInfo info_;
  std::vector<std::string> layer_names_;
  std::vector<pb::Annotation> annotations_;
  std::size_t noted_ = 0;
  std::uint64_t samples_ = 0, lines_ = 0;
  std::optional<std::int64_t> first_ns_;
  double next_line_s_ = 0;
  const std::int64_t started_ns_ = run_.time.nowNs();
};

}  // namespace

Status replaySession(const HeadlessRun& run) {
  return Replay(run).run();
}

}  // namespace needlelab
