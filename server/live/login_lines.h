/// The log's lines about log-ins that were refused: anybody on the network can cause them.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "server/base/log.h"

namespace needlelab {

/// Writes so many lines a minute of each event; the number of the others is a line `logins_left_out`, with
/// the first log-in after that minute. Times: steady clock (ns). Thread: one.
class LoginLines {
 public:
  explicit LoginLines(std::uint64_t lines_a_minute) : refused_(lines_a_minute), must_wait_(lines_a_minute) {}

  /// `login_refused`: a wrong name, password, key or token.
  void refused(std::int64_t now_ns, std::initializer_list<LogField> fields);
  /// `login_rate_limited`: it was not looked at, after too many failures.
  void mustWait(std::int64_t now_ns, std::initializer_list<LogField> fields);
  /// With each log-in, and at the end (INT64_MAX).
  void sayLeftOut(std::int64_t now_ns);

 private:
  LogBound refused_, must_wait_;
};

}  // namespace needlelab
