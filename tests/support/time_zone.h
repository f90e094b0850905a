/// The machine's time zone for the length of a test.
#pragma once

#include <cstdlib>
#include <ctime>
#include <optional>
#include <string>

namespace needlelab::test {

/// St. John's by its rule, so that no zone tables are needed: 3½ hours behind UTC, and 2½ from the second
/// Sunday of March to the first of November.
inline constexpr const char* kStJohns = "NST3:30NDT,M3.2.0,M11.1.0";

/// Sets TZ, and restores it at the end. Thread: the only one.
class WithZone {
 public:
  explicit WithZone(const char* zone) {
    if (const char* const now = std::getenv("TZ"); now != nullptr) before_ = now;
    ::setenv("TZ", zone, 1);
    ::tzset();
  }
  ~WithZone() {
    if (before_)
      ::setenv("TZ", before_->c_str(), 1);
    else
      ::unsetenv("TZ");
    ::tzset();
  }
  WithZone(const WithZone&) = delete;
  WithZone& operator=(const WithZone&) = delete;

 private:
  std::optional<std::string> before_;
};

}  // namespace needlelab::test
