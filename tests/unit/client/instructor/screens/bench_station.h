/// Protocol-level stations in threads of the test. Their lessons run and can be watched.
#pragma once

#include <atomic>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/unit/client/instructor/model/lesson_gestures.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {

/// A station with a running lesson that repeats the same hand motion. Keeps the instructor's messages.
class BenchStation {
 public:
  /// `change` modifies every status line. `placement`: the limb's pose in W, as in a session's description.
  BenchStation(RunningServer& server, const std::string& name, std::string key, const std::string& trainee,
               std::function<void(pb::StationStatus&)> change = {}, const std::vector<double>& placement = {})
      : change_(std::move(change)),
        info_(lessonInfo(sampleProfile("shoulder-adult"), trainee)),
        samples_(lessonSamples(info_.description().profile_json(), {.depth_m = 0.02, .seconds = 1.2})) {
    info_.mutable_description()->set_station(name);
    for (const double number : placement) info_.mutable_description()->add_placement(number);
    info_.mutable_description()->set_started_unix_ns(wallNowNs());
    thread_ = std::thread([this, &server, key = std::move(key)] { run(server, key); });
  }
  ~BenchStation() {
    stop_ = true;
    thread_.join();
  }
  [[nodiscard]] const pb::SessionInfo& info() const { return info_; }
  [[nodiscard]] std::string heard() const {
    const std::scoped_lock lock(mutex_);
    return heard_;
  }

 private:
  void run(RunningServer& server, const std::string& key) {
    const auto config = server.config(stationLogin(info_.description().station(), key));
    while (!stop_) {
      auto client = BlockingClient::connect(config);
      if (!client.ok()) {
        std::this_thread::sleep_for(milliseconds(50));
        continue;
      }
      pb::Envelope open;
      *open.mutable_open_session()->mutable_description() = info_.description();
      if (!client->send(open).ok()) continue;
      while (!stop_ && client->connected()) turn(*client);
    }
  }
  void turn(BlockingClient& client) {
    const auto due = std::chrono::steady_clock::now() + milliseconds(20);
    for (auto left = due - std::chrono::steady_clock::now(); left.count() > 0;
         left = due - std::chrono::steady_clock::now()) {
      const auto got = client.receive(std::chrono::ceil<milliseconds>(left));
      if (!got.ok() && got.error().code != ErrorCode::kNotFound) return;
      if (got.ok()) hear(*got);
    }
    if (frames_ % 5 == 0) sendStatus(client);
    if (watched_) sendFrame(client);
    ++frames_;
  }
  void hear(const pb::Envelope& envelope) {
    if (envelope.has_watch_state()) watched_ = envelope.watch_state().watched();
    const std::scoped_lock lock(mutex_);
    if (envelope.has_trainee_message())
      heard_ += envelope.trainee_message().from() + ": " + envelope.trainee_message().text() + "\n";
    if (envelope.has_next_exercise()) heard_ += "next " + envelope.next_exercise().exercise_id() + "\n";
    if (envelope.has_set_aids()) heard_ += "aids " + std::to_string(envelope.set_aids().aids_size()) + "\n";
    if (envelope.has_stop_lesson()) heard_ += "stop " + envelope.stop_lesson().reason() + "\n";
  }
  void sendStatus(BlockingClient& client) {
    const GestureSample& now = samples_[static_cast<std::size_t>(frames_) * 20 % samples_.size()];
    pb::Envelope envelope;
    pb::StationStatus& status = *envelope.mutable_station_status();
    status.set_session_id(info_.description().session_id());
    status.set_trainee(info_.description().trainee());
    status.set_exercise_id(info_.description().exercise_id());
    status.set_phase(now.phase);
    status.set_layer(now.layer);
    status.set_insertion_m(now.insertion_m);
    status.set_force_n(norm({now.force_W_N[0], now.force_W_N[1], now.force_W_N[2]}));
    status.set_samples(static_cast<std::uint64_t>(frames_) * 20);
    status.set_wakeup_p99_us(45);
    if (change_) change_(status);
    (void)client.send(envelope).ok();
  }
  void sendFrame(BlockingClient& client) {
    std::vector<GestureSample> piece(20);
    for (std::size_t i = 0; i < piece.size(); ++i) {
      const std::uint64_t tick = static_cast<std::uint64_t>(frames_) * 20 + i;
      piece[i] = samples_[tick % samples_.size()];
      piece[i].tick = tick;
      piece[i].time_ns = 1'000'000'000 + static_cast<std::int64_t>(tick) * 1'000'000;
    }
    const Bytes data = encodeChunk(Resolution::standard(), piece);
    pb::Envelope envelope;
    pb::LiveFrame& frame = *envelope.mutable_live_frame();
    frame.set_session_id(info_.description().session_id());
    frame.set_frame_seq(frame_seq_++);
    frame.set_data(data.data(), data.size());
    frame.set_capture_unix_ns(wallNowNs());
    (void)client.send(envelope).ok();
  }

  std::function<void(pb::StationStatus&)> change_;
  pb::SessionInfo info_;
  std::vector<GestureSample> samples_;
  std::uint64_t frames_ = 0, frame_seq_ = 0;
  bool watched_ = false;
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;
  std::string heard_;
  std::thread thread_;
};

}  // namespace needlelab::test
