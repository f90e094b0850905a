#include "client/instructor/terminal/plunger_watch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

GestureSample at(double t_s, double plunger) {
  GestureSample sample;
  sample.time_ns = static_cast<std::int64_t>(t_s * 1e9) + 5'000'000'000;
  sample.plunger = plunger;
  return sample;
}

TEST(PlungerWatch, saysWhatThePlungerDoesAtOnceAndWhenItIsOver) {
  for (const double rate : {1000.0, 100.0, 10.0}) {
    SCOPED_TRACE(rate);
    PlungerWatch watch;
    for (int i = 0; i <= static_cast<int>(6 * rate); ++i) {
      const double t = i / rate;
      // back from 1 to 2 s, rest, pressed from 3 to 4 s
      const double plunger = t < 1   ? 0.3
                             : t < 2 ? 0.3 - 0.1 * (t - 1)
                             : t < 3 ? 0.2
                             : t < 4 ? 0.2 + 0.3 * (t - 3)
                                     : 0.5;
      watch.add(at(t, plunger));
      const std::string expected = t > 1.25 && t < 2 ? "aspirating" : t > 3.25 && t < 4 ? "injecting" : "";
      const double edge = std::round(t);  // the window's length after each change, either answer
      const bool in_between = t >= edge - 0.051 && t <= edge + 0.351 && edge >= 1 && edge <= 4;
      if (!in_between) {
        EXPECT_EQ(watch.action(), expected) << t;
      }
    }
  }
}

TEST(PlungerWatch, tremblingIsRest) {
  PlungerWatch watch;
  for (int i = 0; i < 3000; ++i) {
    watch.add(at(0.001 * i, 0.5 + 0.0015 * std::sin(0.06 * i)));
    ASSERT_EQ(watch.action(), "");
  }
}

TEST(PlungerWatch, aGapOrAnotherSessionBeginsAnew) {
  PlungerWatch watch;
  EXPECT_EQ(watch.action(), "");
  watch.add(at(1, 0.1));
  watch.add(at(1.1, 0.3));
  EXPECT_EQ(watch.action(), "injecting");
  watch.add(at(5, 0.9));
  EXPECT_EQ(watch.action(), "");
  watch.add(at(0.5, 0.2));
  EXPECT_EQ(watch.action(), "");
}

}  // namespace
}  // namespace needlelab
