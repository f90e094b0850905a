#include "client/device/plunger.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

namespace needlelab {
namespace {

constexpr double kLongestPress_s = 0.1;

bool isPressed(std::uint32_t buttons, int button) {
  return button >= 0 && button < 32 && ((buttons >> static_cast<unsigned>(button)) & 1u) != 0;
}

// -1: not a button
int buttonOf(std::string_view text) {
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number >= 0 && number < 32 ? number : -1;
}

}  // namespace

Plunger::Plunger(const PlungerSettings& settings, double rate_hz) noexcept
    : settings_(settings),
      per_tick_(1 / (settings.stroke_s * rate_hz)),
      max_ticks_(std::max<std::int64_t>(1, static_cast<std::int64_t>(kLongestPress_s * rate_hz))),
      position_(settings.source == PlungerSource::kButtons ? std::clamp(settings.start, 0.0, 1.0) : 0) {}

double Plunger::update(const DeviceReading& reading, bool fresh, std::int64_t elapsed_ticks) noexcept {
  waiting_ticks_ = std::min(waiting_ticks_ + std::max<std::int64_t>(elapsed_ticks, 0), max_ticks_);
  if (!fresh) return position_;
  const auto ticks = static_cast<double>(waiting_ticks_);
  waiting_ticks_ = 0;
  switch (settings_.source) {
    case PlungerSource::kNone:
      break;
    case PlungerSource::kAnalog:
      if (std::isfinite(reading.plunger)) position_ = std::clamp(reading.plunger, 0.0, 1.0);
      break;
    case PlungerSource::kButtons: {
      const int push = isPressed(reading.buttons, settings_.push_button) ? 1 : 0;
      const int pull = isPressed(reading.buttons, settings_.pull_button) ? 1 : 0;
      position_ = std::clamp(position_ + (push - pull) * per_tick_ * ticks, 0.0, 1.0);
      break;
    }
  }
  return position_;
}

Status parsePlungerOption(const std::string& text, PlungerSettings& settings) {
  const std::string_view all = text;
  const std::size_t comma = all.find(',');
  const bool has_pull = comma != std::string_view::npos;
  const int push = buttonOf(all.substr(0, comma));
  const int pull = has_pull ? buttonOf(all.substr(comma + 1)) : -1;
  if (push < 0 || (has_pull && pull < 0) || push == pull)
    return Error{ErrorCode::kInvalidInput,
                 "--plunger: found '" + text +
                     "', allowed are one or two different buttons from 0 to 31, as in 0,1: the first presses "
                     "the plunger, the second draws it back"};
  settings.push_button = push;
  settings.pull_button = pull;
  return {};
}

}  // namespace needlelab
