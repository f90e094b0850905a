// The same inputs give the same bits: in debug and release builds, with every compiler, on every machine.
// Each row of golden.csv is the FNV-1a hash over the raw bits of every tick's report. If a hash changes, the
// replay of a session changes too: state the reason in the commit and in CHANGELOG.md.
//
// NEEDLELAB_GOLDEN_OUT=FILE writes a new golden.csv there and skips the comparison.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <sstream>

#include "common/base/text/csv.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"
#include "tests/support/scenes/model_scenes.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/scenes.h"
#ifdef NEEDLELAB_RECORDINGS
#include "tests/support/recordings/recordings.h"
#endif

namespace needlelab::test {
namespace {

// FNV-1a, 64 bit, byte by byte
class Hash {
 public:
  void add(std::uint64_t word) {
    for (int byte = 0; byte < 8; ++byte)
      value_ = (value_ ^ ((word >> (8 * byte)) & 0xFFu)) * 0x100000001B3ull;
  }
  // All NaNs hash to the same value: their sign and payload depend on the compiler.
  void add(double number) {
    add(std::isnan(number) ? std::uint64_t{0x7FF8000000000000} : std::bit_cast<std::uint64_t>(number));
  }
  void add(Vec3 v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  void add(const StepReport& r) {
    add(r.wrench_W.force_N);
    add(r.wrench_W.torque_Nm);
    add(r.p_wall_W_m);
    add(static_cast<std::uint64_t>(r.phase));
    add(static_cast<std::uint64_t>(static_cast<std::int64_t>(r.layer)));
    for (const double number :
         {r.depth_m, r.insertion_m, r.speed_mps, r.lateral_error_m, r.cutting_N, r.attracted_N, r.friction_N,
          r.puncture_N, r.clamping_N, r.clamping_stiffness_N_per_m})
      add(number);
    add(std::uint64_t{r.flags});
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325ull;
};

std::uint64_t hashOfRun(const SceneSpec& spec, double rate_hz, const Motion& motion) {
  const auto model = compile(spec, rate_hz);
  EXPECT_TRUE(model.ok());
  if (!model.ok()) return 0;
  const auto state = std::make_unique<SimState>();
  StepReport report;
  Hash hash;
  std::uint32_t seen = 0;
  for (const auto& sample : motion) {
    step(*model, sample, *state, report);
    hash.add(report);
    seen |= report.flags;
  }
  EXPECT_TRUE(seen & kFlagEntry) << "a case that never enters the tissue pins nothing";
  return hash.value();
}

struct Case {
  std::string name;
  std::function<std::uint64_t()> hash;
};

SceneSpec turning(SceneSpec scene, ClampingMode mode) {
  scene.virtual_fixture.mode = mode;
  scene.virtual_fixture.max_force_N = 0.8;
  return scene;
}

// The motions use + − × ÷ sqrt only (support/motions.h).
std::vector<Case> preparedScenes() {
  const auto straight = [](double rate_hz, LimbKind limb) {
    const Site site = siteOf(limb);
    return insertHoldWithdraw(rate_hz, site, site.inward, site.inward, 0.038, 0.03, 1.2);
  };
  const auto oblique = [](double rate_hz, LimbKind limb) {
    const Site site = siteOf(limb);
    const Vec3 axis = tilted(site.inward, 0.6, site.across_2);
    return insertHoldWithdraw(rate_hz, site, axis, axis, 0.04, 0.025, 0.5);
  };
  return {
      {"paper_one_dof_straight",
       [=] { return hashOfRun(paperOneDof(), 1000, straight(1000, LimbKind::kPlane)); }},
      {"paper_six_layers_straight",
       [=] { return hashOfRun(paperSixLayers(), 1000, straight(1000, LimbKind::kPlane)); }},
      {"paper_six_layers_oblique_tilted_plane",
       [=] {
         return hashOfRun(withLimb(paperSixLayers(), LimbKind::kTiltedPlane), 1000,
                          oblique(1000, LimbKind::kTiltedPlane));
       }},
      {"all_effects_straight_with_tremor",
       [=] {
         return hashOfRun(allEffects(), 1000, withTremor(straight(1000, LimbKind::kPlane), 1000, 8e-5, 11));
       }},
      {"all_effects_exponential_sphere",
       [=] {
         return hashOfRun(withStop(withLimb(allEffects(), LimbKind::kSphere), StopMode::kExponential), 500,
                          straight(500, LimbKind::kSphere));
       }},
      {"random_plane_proportional_turning",
       [] {
         return hashOfRun(turning(allEffects(), ClampingMode::kProportional), 1000,
                          randomGesture(101, 1000, siteOf(LimbKind::kPlane)));
       }},
      {"random_sphere_passive_turning",
       [] {
         return hashOfRun(turning(withLimb(allEffects(), LimbKind::kSphere), ClampingMode::kConservative),
                          1000, randomGesture(102, 1000, siteOf(LimbKind::kSphere)));
       }},
      {"random_capsule_passive_turning_4khz",
       [] {
         return hashOfRun(turning(withLimb(allEffects(), LimbKind::kCapsule), ClampingMode::kConservative),
                          4000, randomGesture(103, 4000, siteOf(LimbKind::kCapsule)));
       }},
      {"grazing_capsule",
       [] {
         return hashOfRun(withLimb(allEffects(), LimbKind::kCapsule), 1000,
                          grazing(1000, siteOf(LimbKind::kCapsule), 0.0875, 0.03, 0.04));
       }},
      {"multiple_entries_encoder_steps",
       [] {
         return hashOfRun(allEffects(), 1000,
                          quantised(multipleEntries(104, 1000, siteOf(LimbKind::kPlane), 6), 0x1p-15));
       }},
      {"needle_flipped_and_starting_inside",
       [] {
         const Site site = defaultSite();
         MotionBuilder builder(1000, site.p_surface_m + site.inward * 0.01, -site.inward);
         builder.moveTo(site.p_surface_m - site.inward * 0.005, 0.3);
         builder.moveTo(site.p_surface_m + site.inward * 0.03, 0.5).hold(0.3);
         builder.moveTo(site.p_surface_m - site.inward * 0.005, site.inward, 0.5);
         return hashOfRun(allEffects(), 1000, builder.take());
       }},
  };
}

SceneSpec remembering(SceneSpec scene) {
  scene.effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), scene);
  return scene;
}

// in and out near the same places again and again
std::vector<Case> casesWithCuts() {
  GestureRange near;
  near.aside_m = 0.002;
  return {
      {"cut_memory_plane_passive_turning",
       [=] {
         return hashOfRun(remembering(turning(allEffects(), ClampingMode::kConservative)), 1000,
                          randomGesture(107, 1000, siteOf(LimbKind::kPlane), near));
       }},
      {"cut_memory_sphere_statistical",
       [=] {
         return hashOfRun(remembering(modelScene(AxialModel::kStatistical, LimbKind::kSphere)), 1000,
                          randomGesture(108, 1000, siteOf(LimbKind::kSphere), near));
       }},
  };
}

SceneSpec onBone(SceneSpec scene) {
  scene.layers.back().is_bone = true;
  scene.effects |= bitOf(Effect::kBone);
  useUsualNumbers(effectEntry(Effect::kBone), scene);
  return scene;
}

// the last layer is bone
std::vector<Case> casesWithBone() {
  return {
      {"bone_tilted_plane_passive_turning",
       [] {
         const SceneSpec scene = withLimb(allEffects(), LimbKind::kTiltedPlane);
         return hashOfRun(onBone(turning(scene, ClampingMode::kConservative)), 1000,
                          randomGesture(109, 1000, siteOf(LimbKind::kTiltedPlane)));
       }},
      {"bone_capsule_cut_memory",
       [] {
         return hashOfRun(onBone(remembering(withLimb(allEffects(), LimbKind::kCapsule))), 1000,
                          randomGesture(110, 1000, siteOf(LimbKind::kCapsule)));
       }},
      {"bone_sphere_okamura",
       [] {
         return hashOfRun(onBone(modelScene(AxialModel::kOkamura, LimbKind::kSphere)), 1000,
                          randomGesture(111, 1000, siteOf(LimbKind::kSphere)));
       }},
  };
}

// every axial model, on a gesture during which u turns
std::vector<Case> preparedCases() {
  std::vector<Case> cases = preparedScenes();
  for (const AxialModel model : kAllModels)
    cases.push_back({"model_" + std::string(axialModelName(model)), [model] {
                       return hashOfRun(
                           turning(modelScene(model, LimbKind::kSphere), ClampingMode::kConservative), 1000,
                           randomGesture(106, 1000, siteOf(LimbKind::kSphere)));
                     }});
  for (Case& with_cuts : casesWithCuts()) cases.push_back(std::move(with_cuts));
  for (Case& with_bone : casesWithBone()) cases.push_back(std::move(with_bone));
  return cases;
}

#ifdef NEEDLELAB_RECORDINGS
// a recorded path, with the tissue at its middle
std::uint64_t hashOfRecording(const std::filesystem::path& file) {
  const auto table = readCsv(file, {"px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"});
  EXPECT_TRUE(table.ok()) << (table.ok() ? "" : table.error().message);
  if (!table.ok()) return 0;
  const auto column = [&](const char* name) -> const std::vector<double>& {
    return table->columns[static_cast<std::size_t>(table->find(name))];
  };
  Motion motion;
  for (std::size_t k = 0; k < table->rows(); ++k)
    motion.push_back({{column("px_m")[k], column("py_m")[k], column("pz_m")[k]},
                      normalized(Quat{column("qx")[k], column("qy")[k], column("qz")[k], column("qw")[k]})});
  // a plane across the path, half-way between its ends, facing the start
  const Vec3 first = motion.front().p_WT_m, last = motion.back().p_WT_m;
  Vec3 farthest = last;
  for (const auto& sample : motion)
    if (norm(sample.p_WT_m - first) > norm(farthest - first)) farthest = sample.p_WT_m;
  SceneSpec scene = withClamping(allEffects(), ClampingMode::kConservative);
  scene.limb = PlaneLimb{first + (farthest - first) * 0.5, first - farthest};
  return hashOfRun(scene, 1000, motion);
}

// {row of golden.csv, hash}: of a real Virtuose's recordings and of those that a simulated hand makes
std::map<std::string, std::uint64_t> hashesOf(const Recordings& recordings) {
  std::map<std::string, std::uint64_t> hashes;
  for (const std::string name : kPoseRecordings)
    hashes[(recordings.real ? "recording_" : "made_") + name] =
        hashOfRecording(recordings.folder / "virtuose" / (name + ".csv"));
  return hashes;
}
#endif

// name,hash lines
std::map<std::string, std::uint64_t> readGolden() {
  std::ifstream in(std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "tests/determinism/golden.csv");
  std::map<std::string, std::uint64_t> golden;
  std::string line;
  std::getline(in, line);  // header
  while (std::getline(in, line)) {
    const auto comma = line.find(',');
    if (comma != std::string::npos)
      golden[line.substr(0, comma)] = std::stoull(line.substr(comma + 1), nullptr, 16);
  }
  return golden;
}

std::string hex(std::uint64_t value) {
  std::ostringstream text;
  text << std::hex << value;
  return text.str();
}

TEST(Golden, preparedMotionsGiveTheRecordedBits) {
  const char* out = std::getenv("NEEDLELAB_GOLDEN_OUT");
  if (out != nullptr) {
    std::ofstream file(out);
    file << "case,fnv1a_64\n";
    for (const auto& c : preparedCases()) file << c.name << "," << hex(c.hash()) << "\n";
#ifdef NEEDLELAB_RECORDINGS
    for (const Recordings& recordings : allRecordings())
      for (const auto& [name, hash] : hashesOf(recordings)) file << name << "," << hex(hash) << "\n";
#endif
    GTEST_SKIP() << "wrote " << out;
  }
  const auto golden = readGolden();
  for (const auto& c : preparedCases()) {
    ASSERT_TRUE(golden.contains(c.name)) << c.name << " is not in golden.csv";
    EXPECT_EQ(hex(c.hash()), hex(golden.at(c.name))) << c.name;
  }
}

#ifdef NEEDLELAB_RECORDINGS
TEST(Golden, recordedHandMotionsGiveTheRecordedBits) {
  const auto golden = readGolden();
  for (const Recordings& recordings : allRecordings())
    for (const auto& [name, hash] : hashesOf(recordings)) {
      ASSERT_TRUE(golden.contains(name)) << name << " is not in golden.csv";
      EXPECT_EQ(hex(hash), hex(golden.at(name))) << name;
    }
}
#endif

TEST(Golden, runningTwiceGivesTheSameBits) {
  for (const auto& c : preparedCases()) EXPECT_EQ(c.hash(), c.hash()) << c.name;
}

TEST(Golden, theHashSeesOneBit) {
  const Motion motion = randomGesture(105, 1000, defaultSite());
  Motion changed = motion;
  double& z = changed[changed.size() / 2].p_WT_m.z;
  z = std::nextafter(z, 1.0);
  EXPECT_NE(hashOfRun(allEffects(), 1000, motion), hashOfRun(allEffects(), 1000, changed));
}

}  // namespace
}  // namespace needlelab::test
