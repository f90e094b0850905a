#include "server/live/prometheus.h"

#include <cassert>
#include <charconv>
#include <cmath>

namespace needlelab {
namespace {

[[maybe_unused]] bool isName(std::string_view name) {
  if (name.empty() || (name[0] >= '0' && name[0] <= '9')) return false;
  for (const char c : name) {
    const bool legal =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == ':';
    if (!legal) return false;
  }
  return true;
}

void appendEscaped(std::string& out, std::string_view text, bool quotes) {
  for (const char c : text) {
    if (c == '\\' || (quotes && c == '"')) out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
}

/// Shortest digits that give the same number again; Prometheus' words for what is no number.
void appendNumber(std::string& out, double value) {
  if (std::isnan(value)) {
    out += "NaN";
  } else if (std::isinf(value)) {
    out += value > 0 ? "+Inf" : "-Inf";
  } else {
    char digits[40];
    const auto [end, error] = std::to_chars(digits, digits + sizeof digits, value);
    assert(error == std::errc());
    out.append(digits, end);
  }
}

}  // namespace

void PrometheusText::metric(std::string_view name, std::string_view type, std::string_view help) {
  assert(isName(name));
  name_ = name;
  text_ += "# HELP " + name_ + ' ';
  appendEscaped(text_, help, false);
  text_ += "\n# TYPE " + name_ + ' ';
  text_ += type;
  text_ += '\n';
}

void PrometheusText::sample(double value, Labels labels, std::string_view suffix) {
  text_ += name_;
  text_ += suffix;
  char separator = '{';
  for (const auto& [label, text] : labels) {
    assert(isName(label));
    text_ += std::exchange(separator, ',');
    text_ += label;
    text_ += "=\"";
    appendEscaped(text_, text, true);
    text_ += '"';
  }
  if (separator == ',') text_ += '}';
  text_ += ' ';
  appendNumber(text_, value);
  text_ += '\n';
}

void PrometheusText::counter(std::string_view name, double value, std::string_view help) {
  metric(name, "counter", help);
  sample(value);
}

void PrometheusText::gauge(std::string_view name, double value, std::string_view help) {
  metric(name, "gauge", help);
  sample(value);
}

}  // namespace needlelab
