#include "tests/support/recordings/recordings.h"

#include <fmt/core.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "client/device/hand/simulated_device.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

// uniform in [−1, 1]: noise without the C library, so that it has the same bits everywhere
double noise(HandRandom& random) {
  return 2 * random.uniform() - 1;
}

struct Stroke {
  const char* name;
  Vec3 from_m, to_m;
  double seconds;
};
// strokes as a person moves a Virtuose in free air: 0.3 to 0.4 m, up to about 0.45 m/s
constexpr Stroke kStrokes[] = {
    {"backward", {0.58, 0.02, 0.02}, {0.25, 0.06, 0.07}, 1.6},
    {"downward", {0.52, -0.06, 0.30}, {0.48, -0.02, -0.05}, 1.5},
    {"lateral_left", {0.45, 0.20, -0.06}, {0.48, -0.17, 0.01}, 1.7},
    {"virtuose_x_backward", {0.60, 0.03, -0.12}, {0.22, 0.05, -0.10}, 2.0},
};

std::string posesOf(const Stroke& stroke, std::uint64_t seed) {
  SimulatedDeviceOptions options;
  options.hand.seed = seed;
  options.hand.tremor_m = 8e-6;
  options.integration_hz = 5'000;
  const Vec3 along = stroke.to_m - stroke.from_m;
  const Pose start{stroke.from_m, orientationAlong(along)};
  // the wrist turns on the way
  const Pose end{stroke.to_m, orientationAlong(along + Vec3{0.05, -0.08, 0.06})};
  HandPlan plan(start);
  plan.hold(0.5).moveIn(end, stroke.seconds, Motion::kMinJerk).hold(0.7);
  SimulatedDevice device(options, plan);
  if (!device.open(1000).ok()) throw std::logic_error("the simulated device does not open");

  HandRandom random(seed + 100);
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  DeviceReading reading;
  for (int tick = 0; device.read(reading) == DeviceRead::kFresh; ++tick) {
    const double received_s = tick == 0 ? 0 : tick * 1e-3 + 0.2e-3 * random.uniform();
    const auto& [p, q] = reading.X_WH;
    text += fmt::format("{:.9f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n", received_s, p.x, p.y,
                        p.z, q.x, q.y, q.z, q.w);
  }
  return text;
}

// Liver and heart: contact at 10 mm, ruptures at 19, 30, 33 and 37 mm, peak 2.32 N. 371 rows, as digitised in
// several passes: 20 steps go back.
std::string forceOverDepth() {
  struct Part {
    double to_mm, from_N, to_N;
  };
  constexpr Part kParts[] = {
      {19, 0, 1.35}, {30, 0.2, 1.45}, {33, 1.0, 1.78}, {37, 1.25, 2.32}, {49, 1.5, 1.55}};
  const auto force_N = [&](double x_mm) {
    double begin_mm = 10, before_N = 0;
    if (x_mm < begin_mm) return 0.0;
    for (const Part& part : kParts) {
      const double share = (x_mm - begin_mm) / (part.to_mm - begin_mm);
      const double risen_N = part.from_N + (part.to_N - part.from_N) * share * share;
      const double fallen = (x_mm - begin_mm) / 0.8;  // a rupture takes 0.8 mm
      if (share < 1) return fallen < 1 ? before_N + (risen_N - before_N) * fallen : risen_N;
      begin_mm = part.to_mm;
      before_N = part.to_N;
    }
    return before_N;
  };
  HandRandom random(11);
  std::vector<std::string> rows;
  for (int i = 0; i < 371; ++i) {
    const double x_mm = 48.0 * i / 370;
    rows.push_back(fmt::format("{:.9f},{:.6f}\n", x_mm * 1e-3, force_N(x_mm) + 0.03 * noise(random)));
  }
  for (std::size_t i = 9; i < 9 + 20 * 18; i += 18) std::swap(rows[i], rows[i + 1]);
  std::string text = "depth_m,force_n\n";
  for (const std::string& row : rows) text += row;
  return text;
}

// Insertion to 0.45 N, a hold that relaxes from 0.337 N to 0.257 N with 1.9 s, withdrawal down to −0.147 N.
// The exponential is accumulated step by step, without the C library.
std::string forceOverTime() {
  constexpr double kStep_s = 8e-3, kHold_s = 2.2, kOut_s = 9.85, kEnd_s = 11.75;
  HandRandom random(12);
  std::string text = "t_s,force_n\n";
  double relaxing_N = 0.337 - 0.257;
  for (int i = 0; i * kStep_s <= kEnd_s; ++i) {
    const double t = i * kStep_s;
    double force_N = 0;
    if (t >= kOut_s) {
      // falls within 0.35 s, then the tissue pulls at the needle until it comes free
      const double s = t - kOut_s;
      if (s < 0.35) force_N = 0.25 * (1 - s / 0.35) * (1 - s / 0.35);
      if (s >= 0.45 && s < 0.95) force_N = -0.147 * (s - 0.45) / 0.5;
      if (s >= 0.95 && s < 1.1) force_N = -0.147 * (1.1 - s) / 0.15;
    } else if (t >= kHold_s) {
      force_N = 0.257 + relaxing_N;
      relaxing_N *= 1 - kStep_s / 1.9;
    } else if (t >= 1.9) {
      force_N = 0.45 - (0.45 - 0.337) * (t - 1.9) / 0.3;
    } else if (t >= 0.7) {
      force_N = 0.45 * (t - 0.7) / 1.2;
    }
    text += fmt::format("{:.9f},{:.6f}\n", t, force_N + 0.015 * noise(random));
  }
  return text;
}

// Five punctures of a film: 0.364 ± 0.013 N (16G), 0.298 ± 0.028 N (18G), 0.231 ± 0.023 N (21G).
std::string filmTraces() {
  struct Trace {
    const char* name;
    int samples, peak_at;
    double peak_N;
  };
  constexpr Trace kTraces[] = {{"16G-1", 120, 84, 0.355},
                               {"16G-2", 135, 97, 0.373},
                               {"18G-1", 125, 60, 0.285},
                               {"18G-2", 195, 78, 0.311},
                               {"21G-2", 76, 65, 0.231}};
  HandRandom random(13);
  std::string text = "trace,sample,force_n\n";
  for (const Trace& trace : kTraces)
    for (int i = 0; i < trace.samples; ++i) {
      double force_N = 0.115 + 0.012 * noise(random);
      if (i <= trace.peak_at && i > trace.peak_at - 40)
        force_N = 0.13 + (trace.peak_N - 0.13) * (1 - (trace.peak_at - i) / 40.0);
      text += fmt::format("{},{},{:.3f}\n", trace.name, i, force_N);
    }
  return text;
}

class MadeRecordings {
 public:
  MadeRecordings() {
    std::filesystem::create_directories(recordings_.folder / "virtuose");
    std::filesystem::create_directories(recordings_.folder / "needle_force");
    std::uint64_t seed = 1;
    for (const Stroke& stroke : kStrokes)
      folder_.write("virtuose/" + std::string(stroke.name) + ".csv", posesOf(stroke, seed++));
    folder_.write("needle_force/bovine_liver_heart_18g.csv", forceOverDepth());
    folder_.write("needle_force/insert_hold_withdraw.csv", forceOverTime());
    folder_.write("needle_force/film_puncture.csv", filmTraces());
    folder_.write("MADE_BY_NEEDLELAB.txt",
                  "Made by needlelab's tests (tests/support/recordings): a simulated hand and formulas.\n"
                  "Not measured on any device or tissue.\n");
  }
  [[nodiscard]] const Recordings& get() const { return recordings_; }

 private:
  TempFolder folder_;
  Recordings recordings_{folder_.path(), false};
};

}  // namespace

std::filesystem::path realRecordingsFolder() {
  const char* const set = std::getenv("NEEDLELAB_DATA");
  return set != nullptr && *set != 0 ? std::filesystem::path(set)
                                     : std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "../shared/data";
}

const Recordings& madeRecordings() {
  static const MadeRecordings made;
  return made.get();
}

std::vector<Recordings> allRecordings() {
  std::vector<Recordings> all = {madeRecordings()};
  if (std::filesystem::is_directory(realRecordingsFolder() / "virtuose"))
    all.push_back({realRecordingsFolder(), true});
  return all;
}

Recordings preferredRecordings() {
  return std::filesystem::is_directory(realRecordingsFolder() / "virtuose")
             ? Recordings{realRecordingsFolder(), true}
             : madeRecordings();
}

}  // namespace needlelab::test
