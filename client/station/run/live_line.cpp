#include "client/station/run/live_line.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>

#include "common/base/text.h"
#include "common/haptics/sim_state.h"

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
  const auto add = [&](bool shown, const std::string& words) {
    if (shown) text += (text.empty() ? "" : " ") + words;
  };
  add(view.aids.phase, phaseName(static_cast<Phase>(s.phase)));
  if (s.layer >= 0) {
    add(view.aids.layer, view.layer.empty() ? formatted("layer %d", s.layer) : view.layer);
    add(view.aids.depth, formatted("%.1f mm", 1e3 * s.insertion_m));
  }
  add(view.aids.force, formatted("%.2f N", std::hypot(s.force_W_N[0], s.force_W_N[1], s.force_W_N[2])));
  return text;
}

}  // namespace

std::string liveText(const LiveView& view) {
  const auto seconds = static_cast<long>(view.time_s);
  std::string text = formatted("%ld:%02ld  ", seconds / 60, seconds % 60);
  if (view.fault != Fault::kNone) text += formatted("FAULT: %s | ", faultText(view.fault));
  if (view.fault == Fault::kNone && !view.hold.empty()) text += "NO FORCE: " + view.hold + " | ";
  const std::string where = place(view);
  text += where.empty() ? "practising" : where;
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-3; };
  text += formatted(" | wake-up p50 %.0f p99 %.0f max %.0f µs, %llu missed", us(view.wakeup.p50_ns),
                    us(view.wakeup.p99_ns), us(view.wakeup.max_ns),
                    static_cast<unsigned long long>(view.missed_ticks));
  for (const std::string* more : {&view.spool, &view.server})
    if (!more->empty()) text += " | " + *more;
  return text;
}

std::string cutToWidth(const std::string& text, std::size_t width) {
  std::size_t columns = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    // bytes 10xxxxxx go on with the character before
    if ((static_cast<unsigned char>(text[i]) & 0xC0) == 0x80) continue;
    if (columns++ == width) return text.substr(0, i);
  }
  return text;
}

LiveLine::LiveLine(int file) : file_(file), terminal_(::isatty(file) == 1) {}

void LiveLine::write(const std::string& text) const {
  // a terminal that is gone must not end the lesson: what it refuses is dropped
  for (std::size_t at = 0; at < text.size();) {
    // nor may one that is paused (Ctrl-S), or a pipe that nobody reads, hold up those who speak: one of them
    // takes the stop signals
    pollfd ready{file_, POLLOUT, 0};
    if (::poll(&ready, 1, kPatience_ms) == 0) return;
    const ssize_t written = ::write(file_, text.data() + at, text.size() - at);
    if (written > 0) at += static_cast<std::size_t>(written);
    if (written < 0 && errno != EINTR) return;
  }
}

void LiveLine::say(const std::string& message) {
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
  // one column less: a full line would wrap
  shown_ = cutToWidth(liveText(view), widthOf(file_) - 1);
  write(kClearLine + shown_);
}

void LiveLine::end() {
  const std::scoped_lock lock(mutex_);
  if (!shown_.empty()) write("\n");
  shown_.clear();
}

}  // namespace needlelab
