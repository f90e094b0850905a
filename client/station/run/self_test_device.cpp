/// The device's part of the self-test: it is opened, listened to, and never moved.

#include <algorithm>
#include <cmath>
#include <memory>

#include "client/station/run/self_test.h"
#include "client/station/run/ticks_in.h"
#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

constexpr double kWindow_s = 0.2;
constexpr double kKeptRate_hz = 1000;
constexpr std::uint32_t kWaitFor = kDeviceNotReady | kDeviceLost;

// mean square distance of a window's samples from their straight line
double aboutLine(std::span<const QuietSample> w) {
  const auto n = static_cast<double>(w.size());
  double t_mean = 0;
  Vec3 p_mean;
  for (const QuietSample& s : w) {
    t_mean += s.t_s / n;
    p_mean += s.X_WH.p / n;
  }
  double tt = 0, pp = 0;
  Vec3 tp;
  for (const QuietSample& s : w) {
    const double t = s.t_s - t_mean;
    const Vec3 p = s.X_WH.p - p_mean;
    tt += t * t;
    pp += normSquared(p);
    tp += p * t;
  }
  // two of the n numbers of each coordinate went into the line
  return tt > 0 ? std::max(0.0, pp - normSquared(tp) / tt) / (n - 2) : 0;
}

}  // namespace

double restNoise_m(std::span<const QuietSample> samples) {
  std::vector<double> squares;
  for (std::size_t from = 0, i = 1; i <= samples.size(); ++i) {
    if (i < samples.size() && samples[i].t_s - samples[from].t_s < kWindow_s) continue;
    if (i - from >= 10) squares.push_back(aboutLine(samples.subspan(from, i - from)));
    from = i;
  }
  if (squares.empty()) return 0;
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  return std::sqrt(*middle);
}

DeviceFacts measureDevice(Device& device, LoopClock& clock, const RtOptions& real_time, double seconds,
                          const sigset_t& stop_signals, const std::function<void(const std::string&)>& say,
                          bool& stopped, double patience_s) {
  DeviceFacts facts;
  const double rate_hz = real_time.rate_hz;
  facts.info = device.info();
  facts.rate_hz = rate_hz;
  stopped = false;
  if (Status opened = device.open(rate_hz); !opened.ok()) {
    facts.trouble = opened.error().message;
    return facts;
  }
  facts.info = device.info();

  // what the device has to say is passed on, once each
  std::string said;
  const auto passOn = [&] {
    const std::string words = device.status();
    if (!words.empty() && words != said) say(words);
    said = words;
  };

  // some need time, or a person's hand, before they report
  QuietLoop ready(device, clock, {rate_hz, ticksIn(patience_s, rate_hz), 1});
  QuietRun run = runQuietly(ready, device, &real_time, stop_signals, [&] {
    passOn();
    return ready.samples().empty() || (ready.condition() & kWaitFor) != 0;
  });
  stopped = run.stopped;

  QuietSettings settings;
  settings.rate_hz = rate_hz;
  settings.max_ticks = ticksIn(seconds, rate_hz);
  settings.keep_every = static_cast<std::uint64_t>(std::max(1.0, std::round(rate_hz / kKeptRate_hz)));
  QuietLoop loop(device, clock, settings);
  if (!stopped) {
    run = runQuietly(loop, device, &real_time, stop_signals, [&] {
      passOn();
      return true;
    });
    stopped = run.stopped;
  }
  facts.status = device.status();
  device.close();

  facts.loop = loop.stats();
  facts.realtime = run.realtime;
  const auto samples = loop.samples();
  Vec3 mean;
  for (const QuietSample& s : samples) mean += s.X_WH.p / static_cast<double>(samples.size());
  for (const QuietSample& s : samples) {
    facts.farthest_m = std::max(facts.farthest_m, norm(s.X_WH.p));
    facts.moved_m = std::max(facts.moved_m, norm(s.X_WH.p - mean));
  }
  if (!samples.empty()) facts.last_X_WH = samples.back().X_WH;
  facts.noise_m = restNoise_m(samples);
  return facts;
}

}  // namespace needlelab
