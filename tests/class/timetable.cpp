#include "tests/class/timetable.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "client/device/hand/hand.h"

namespace needlelab {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000, kMinute_ns = 60 * kSecond_ns, kHour_ns = 60 * kMinute_ns,
                       kDay_ns = 24 * kHour_ns;
constexpr std::int64_t kBetween_ns = 5 * kMinute_ns;
constexpr int kFirstHour = 8, kHours = 9;

/// That day, or the Friday before a weekend. 1 January 1970 was a Thursday.
std::int64_t workingDay(std::int64_t day) {
  const std::int64_t weekday = ((day + 3) % 7 + 7) % 7;  // 0: Monday
  return weekday < 5 ? day : day - (weekday - 4);
}

}  // namespace

std::vector<PlannedAttempt> planClass(const std::vector<ClassTrainee>& trainees,
                                      const TimetableOptions& options, std::int64_t now_unix_ns) {
  std::vector<PlannedAttempt> plan;
  const std::int64_t last_ns = now_unix_ns - kHour_ns;
  const std::size_t each = options.exercises * options.attempts;
  for (std::size_t trainee = 0; trainee < trainees.size(); ++trainee) {
    HandRandom random(options.seed * 1'000'003 + trainee);
    std::vector<std::int64_t> times;
    for (std::size_t k = 0; k < each; ++k) {
      // evenly over the weeks, the last day yesterday; everybody at an hour of their own
      const double share = static_cast<double>(k) / static_cast<double>(each);
      const double days_ago = 1 + options.weeks * 7 * (1 - share);
      const std::int64_t day =
          workingDay((now_unix_ns - std::llround(days_ago * static_cast<double>(kDay_ns))) / kDay_ns);
      times.push_back(day * kDay_ns + kFirstHour * kHour_ns +
                      static_cast<std::int64_t>(random.uniform() * kHours * 60) * kMinute_ns +
                      static_cast<std::int64_t>(random.uniform() * 60) * kSecond_ns);
    }
    std::sort(times.begin(), times.end());
    for (std::size_t k = 1; k < each; ++k) times[k] = std::max(times[k], times[k - 1] + kBetween_ns);
    // attempts that exceed the days' capacity move to earlier days, not into the future
    std::int64_t latest = last_ns;
    for (std::size_t k = each; k-- > 0;) {
      times[k] = std::min(times[k], latest);
      latest = times[k] - kBetween_ns;
    }
    double missing = 1 - std::clamp(trainees[trainee].skill, 0.0, 1.0);
    for (std::size_t k = 0; k < each; ++k) {
      plan.push_back(
          {trainee, k / options.attempts, k % options.attempts, 1 - missing, times[k], random.next()});
      missing *= 1 - options.practice;
    }
  }
  return plan;
}

Result<ClassTrainee> parseTrainee(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  ClassTrainee trainee;
  if (equals != std::string::npos && equals > 0) {
    trainee.name = text.substr(0, equals);
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data() + equals + 1, end, trainee.skill);
    if (error == std::errc() && stop == end && trainee.skill >= 0 && trainee.skill <= 1) return trainee;
  }
  return Error{ErrorCode::kInvalidInput,
               "--trainee '" + text + "': wanted is NAME=SKILL, with a skill from 0 to 1, as in tom=0.3"};
}

}  // namespace needlelab
