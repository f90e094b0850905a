#include "client/station/run/io/live_line.h"

#include <fmt/core.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <utility>

#include "common/base/text/text.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/phase_words.h"

namespace needlelab {
namespace {

constexpr std::int64_t kTerminalEvery_ns = 1'000'000'000, kElsewhereEvery_ns = 10'000'000'000;
constexpr int kPatience_ms = 50;
constexpr const char* kClearLine = "\r\x1b[K";

std::size_t widthOf(int file) {
  winsize size{};
  if (::ioctl(file, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

std::string place(const LiveView& view) {
  const GestureSample& s = view.sample;
  std::string text;
  const auto add = [&](bool shown, const std::string& part) {
    if (shown) text += (text.empty() ? "" : " ") + part;
  };
  add(view.aids.phase, std::string(phaseWord(static_cast<Phase>(s.phase))));
  if (s.layer >= 0) {
    add(view.aids.layer, view.layer.empty() ? fmt::format("layer {}", s.layer + 1) : view.layer);
    add(view.aids.depth, fixedText(1e3 * s.insertion_m, 1) + " mm");
  }
  add(view.aids.force, fmt::format("{:.2f} N", std::hypot(s.force_W_N[0], s.force_W_N[1], s.force_W_N[2])));
  return text;
}

}  // namespace

std::string liveText(const LiveView& view) {
  const auto seconds = static_cast<long>(view.time_s);
  std::string text = fmt::format("{}:{:02}  ", seconds / 60, seconds % 60);
  if (view.fault != Fault::kNone) text += fmt::format("FAULT: {} | ", faultText(view.fault));
  if (view.fault == Fault::kNone && !view.hold.empty()) text += "NO FORCE: " + view.hold + " | ";
  const std::string where = place(view);
  text += where.empty() ? "practising" : where;
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-3; };
  text += fmt::format(" | wake-up p50 {:.0f} p99 {:.0f} max {:.0f} µs, {} missed", us(view.wakeup.p50_ns),
                      us(view.wakeup.p99_ns), us(view.wakeup.max_ns), view.missed_ticks);
  for (const std::string* more : {&view.spool, &view.server})
    if (!more->empty()) text += " | " + *more;
  return text;
}

std::string cutToWidth(const std::string& text, std::size_t width) {
  std::size_t columns = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    // bytes 10xxxxxx continue the previous character
    if ((static_cast<unsigned char>(text[i]) & 0xC0) == 0x80) continue;
    if (columns++ == width) return text.substr(0, i);
  }
  return text;
}

LiveLine::LiveLine(int file) : file_(file), terminal_(::isatty(file) == 1) {}

void LiveLine::write(const std::string& text) const {
  // a lost terminal must not end the lesson: drops text that it refuses
  for (std::size_t at = 0; at < text.size();) {
    // a paused terminal (Ctrl-S) or a pipe without a reader must not block the callers, because one of them
    // takes the stop signals
    pollfd ready{file_, POLLOUT, 0};
    if (::poll(&ready, 1, kPatience_ms) == 0) return;
    const ssize_t written = ::write(file_, text.data() + at, text.size() - at);
    if (written > 0) at += static_cast<std::size_t>(written);
    if (written < 0 && errno != EINTR) return;
  }
}

void LiveLine::printMessage(const std::string& message) {
  const std::scoped_lock lock(mutex_);
  write((shown_.empty() ? "" : kClearLine) + message + "\n" + shown_);
}

bool LiveLine::due(std::int64_t now_ns) {
  const std::scoped_lock lock(mutex_);
  if (!next_ns_) next_ns_ = terminal_ ? now_ns : now_ns + kElsewhereEvery_ns;
  return now_ns >= *next_ns_;
}

void LiveLine::show(const LiveView& view, std::int64_t now_ns) {
  const std::scoped_lock lock(mutex_);
  next_ns_ = now_ns + (terminal_ ? kTerminalEvery_ns : kElsewhereEvery_ns);
  if (!terminal_) {
    write(liveText(view) + "\n");
    return;
  }
  // one column less, because a full line would wrap
  shown_ = cutToWidth(liveText(view), widthOf(file_) - 1);
  write(kClearLine + shown_);
}

void LiveLine::end() {
  const std::scoped_lock lock(mutex_);
  if (!shown_.empty()) write("\n");
  shown_.clear();
}

std::string holdText(std::uint32_t flags) {
  // first the hold that a person can influence most
  if ((flags & kDeviceReleased) != 0) return "no one holds the handle";
  if ((flags & kDevicePowerOff) != 0) return "the motors have no power";
  if ((flags & kDeviceNotReady) != 0) return "the device is not ready yet";
  if ((flags & kFlagStartedInside) != 0)
    return (flags & kFlagCapped) != 0 ? "the cap began on the skin, lift it off once"
                                      : "the needle began in the tissue, take it out once";
  return {};
}

std::string spoolText(const SpoolWriterCounts& counts) {
  return counts.disk_error.empty() ? "recording" : "NOT RECORDING: " + counts.disk_error;
}

std::string serverText(const UplinkState& state) {
  const std::string chunks =
      fmt::format("{}{}", state.chunks_left, state.chunks_left == 1 ? " chunk" : " chunks");
  if (state.denied) return "server refuses";
  if (!state.connected) return "server away, " + chunks + (state.chunks_left == 1 ? " waits" : " wait");
  if (!state.server_full.empty())
    return "server has no room, " + chunks + (state.chunks_left == 1 ? " waits" : " wait");
  // the chunk in progress and the one in transfer always exist
  const std::string off = clockOffText(state.wall_ahead_ns);
  return (state.chunks_left <= 2 ? "server" : "server, " + chunks + " behind") +
         (off.empty() ? "" : "; " + off);
}

LiveView LiveViewer::look(std::string spool, std::string server) {
  LiveView view;
  static_cast<void>(loop_.latest(sample_));
  view.sample = sample_;
  view.time_s = static_cast<double>(sample_.tick) * period_s_;
  if (sample_.layer >= 0 && static_cast<std::size_t>(sample_.layer) < layers_.size())
    view.layer = layers_[static_cast<std::size_t>(sample_.layer)];
  view.fault = loop_.fault();
  view.hold = holdText(loop_.condition() | (sample_.flags & kFlagStartedInside));
  view.wakeup = loop_.stats().wakeup.quantiles();
  view.missed_ticks = loop_.missedTicks();
  view.spool = std::move(spool);
  view.server = std::move(server);
  return view;
}

}  // namespace needlelab
