#include "client/device/plunger_option.h"

#include <charconv>
#include <string_view>

namespace needlelab {
namespace {

// -1 for what is no button
int buttonOf(std::string_view text) {
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number >= 0 && number < 32 ? number : -1;
}

}  // namespace

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
