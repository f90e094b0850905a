/// Writes metrics for Prometheus: text exposition format 0.0.4.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace needlelab {

/// Builds the text. Metric names and label names come from this program and must be legal
/// ([a-zA-Z_:][a-zA-Z0-9_:]*, asserted); label values may be any text and are escaped. Thread: one.
class PrometheusText {
 public:
  using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

  /// Begins a metric: "# HELP" and "# TYPE" (counter, gauge, histogram, summary). Its samples follow.
  void metric(std::string_view name, std::string_view type, std::string_view help);
  /// Adds a sample to the current metric; `suffix` is e.g. "_sum" or "_count".
  void sample(double value, Labels labels = {}, std::string_view suffix = {});

  /// Adds a metric with one sample.
  void counter(std::string_view name, double value, std::string_view help);
  void gauge(std::string_view name, double value, std::string_view help);

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
  std::string name_;
};

}  // namespace needlelab
