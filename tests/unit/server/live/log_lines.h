/// What this process writes to its log.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "server/base/log.h"

namespace needlelab::test {

/// Returns the log's lines, from `level` up, while `work` runs; the log is off then.
inline std::string logOf(LogLevel level, const std::function<void()>& work) {
  testing::internal::CaptureStderr();
  setLogLevel(level);
  work();
  setLogLevel(LogLevel::kOff);
  return testing::internal::GetCapturedStderr();
}

inline std::size_t countOf(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

/// The end of a line that states how many lines were left out.
inline std::string leftOut(const std::string& who, const std::string& of, std::size_t count) {
  return "lines_left_out who=" + who + " of=" + of + " count=" + std::to_string(count) + "\n";
}

}  // namespace needlelab::test
