#include "client/effect_cost/tick_cost.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <system_error>
#include <utility>

#include "client/device/hand/hand_plan.h"
#include "common/base/files/files.h"
#include "common/haptics/surface.h"

extern char** environ;  // POSIX: the environment that the child gets

/// callgrind writes its counts at each call of this function; not inlined, because callgrind finds it by name
extern "C" [[gnu::noinline]] void needlelab_end_counted_part() {
  asm volatile("" ::: "memory");
}

namespace needlelab {
namespace {

constexpr double kMove_s = 1.0, kHold_s = 0.4;
constexpr double kAside_m = 2e-4, kTremor_m = 3e-5, kTremor_hz = 9.7;

struct Site {
  Vec3 p_surface_m, inward;
  double room_m = 1;  ///< depth of the shape
};

Site siteOn(const Limb& limb) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb))
    return {plane->point_m, -outwardNormal(limb, plane->point_m)};
  if (const auto* body = std::get_if<BodyLimb>(&limb)) {
    const Vec3 skin = nearestSkin(limb, body->X_WL.p, {0, 0, -1});
    return {skin, -outwardNormal(limb, skin)};
  }
  Vec3 middle;
  double radius = 0;
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    middle = sphere->center_m;
    radius = sphere->radius_m;
  } else {
    const auto& capsule = std::get<CapsuleLimb>(limb);
    middle = (capsule.a_m + capsule.b_m) * 0.5;
    radius = capsule.radius_m;
  }
  const Vec3 out = outwardNormal(limb, middle);
  return {middle + out * radius, -out, 0.8 * radius};
}

// depth through all layer tops, as far as needle and shape allow
double depthOf(const SceneSpec& scene, double room_m) {
  constexpr double kIntoLast_m = 0.01;
  double depth_m = 0;
  for (const LayerSpec& layer : scene.layers) depth_m += layer.thickness_m;
  const LayerSpec& last = scene.layers.back();
  depth_m += std::min(last.thickness_m, kIntoLast_m) - last.thickness_m;
  return std::min({depth_m, 0.9 * scene.needle_length_m, room_m});
}

// a hand does not press the needle through a body's bone: a little behind where the tip meets it, or 1
double roomBeforeBone_m(const SceneSpec& scene, const Site& site, double rate_hz) {
  constexpr double kStep_m = 1e-4, kBehind_m = 5e-4;
  const auto model = compile(scene, rate_hz);
  if (!std::holds_alternative<BodyLimb>(scene.limb) || !model.ok()) return 1;
  SceneEngine engine(*model);
  StepReport report;
  for (double in_m = -1e-3; in_m < scene.needle_length_m; in_m += kStep_m) {
    engine.step({site.p_surface_m + site.inward * in_m, orientationAlong(site.inward)}, report);
    if (engine.state().bone.touching) return in_m + kBehind_m;
  }
  return 1;
}

// share of the way at `t` seconds: in, hold, out
double shareAt(double t) {
  if (t < kMove_s) return shareOfWay(Motion::kMinJerk, t / kMove_s);
  if (t < kMove_s + kHold_s) return 1;
  return 1 - shareOfWay(Motion::kMinJerk, (t - kMove_s - kHold_s) / kMove_s);
}

}  // namespace

std::vector<TipSample> measuringGesture(const SceneSpec& scene, double rate_hz) {
  const Site site = siteOn(scene.limb);
  const double depth_m = std::min(depthOf(scene, site.room_m), roomBeforeBone_m(scene, site, rate_hz));
  const Quat q = orientationAlong(site.inward);
  const Vec3 aside = rotate(q, Vec3{1, 0, 0});
  const auto ticks = static_cast<std::size_t>((2 * kMove_s + kHold_s) * rate_hz);

  std::vector<TipSample> gesture;
  gesture.reserve(ticks + 1);
  gesture.push_back({site.p_surface_m - site.inward * 1e-3, q});
  for (std::size_t k = 0; k < ticks; ++k) {
    const double t = static_cast<double>(k) / rate_hz, share = shareAt(t);
    const double wave = std::sin(2 * std::numbers::pi * kTremor_hz * t);
    // never closer to the surface than the tremor's width
    const double in_m = 2 * kTremor_m + share * (depth_m - 3 * kTremor_m) + kTremor_m * wave;
    gesture.push_back(
        {site.p_surface_m + site.inward * in_m + aside * (share * (kAside_m + kTremor_m * wave)), q});
  }
  return gesture;
}

TickRun::TickRun(const SceneModel& model, const std::vector<TipSample>& gesture, bool capped)
    : model_(model),
      gesture_(gesture),
      capped_(capped),
      paths_(model.body_spec ? std::make_unique<FoundPaths>(model) : nullptr) {
  begin();
  if (!paths_) return;
  for (const TipSample& sample : gesture_) engine_->step(sample, report_);
  beginAgain();
}

TickRun::~TickRun() = default;

void TickRun::begin() {
  engine_ = std::make_unique<SceneEngine>(model_, paths_.get());
  if (!capped_) return;
  // the ball under the cap comes from outside
  constexpr double kOutside_m = 0.02;
  constexpr int kTicks = 40;
  engine_->wantCap(true);
  const TipSample& first = gesture_.front();
  for (int k = kTicks; k > 0; --k)
    engine_->step({first.p_WT_m - zAxis(first.q_WT) * (kOutside_m * k / kTicks), first.q_WT}, report_);
}

void TickRun::beginAgain() {
  next_ = 0;
  if (!paths_) return;
  engine_ = nullptr;  // it gives its path back
  paths_->rewind();
  begin();
}

namespace {

namespace fs = std::filesystem;

// a temporary folder for callgrind's files; the destructor removes it
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "needlelab-count-XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// runs the command to its end; returns the exit status, or −1
int runQuietly(std::vector<std::string> command, const fs::path& messages) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                     0600);
  std::vector<char*> arguments;
  for (std::string& argument : command) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, arguments.front(), &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// the number after "totals:" in a file of callgrind
Result<std::uint64_t> totalIn(const fs::path& file) {
  auto text = readWholeFile(file, 64u << 20);
  if (!text.ok()) return text.error();
  for (const char* key : {"\ntotals: ", "\nsummary: "})
    if (const auto at = text->find(key); at != std::string::npos)
      return std::strtoull(text->c_str() + at + std::strlen(key), nullptr, 10);
  return Error{ErrorCode::kFailed, file.string() + " has no total"};
}

}  // namespace

bool hasValgrind() {
  const char* path = std::getenv("PATH");
  std::stringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (::access((fs::path(folder) / "valgrind").c_str(), X_OK) == 0) return true;
  return false;
}

void endCountedPart() {
  needlelab_end_counted_part();
}

std::string ownProgram() {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).string();
}

Result<std::vector<std::uint64_t>> countStepInstructions(const std::vector<std::string>& command,
                                                         std::size_t parts) {
  return countInstructions(command, parts, "needlelab::step(*");
}

Result<std::vector<std::uint64_t>> countInstructions(const std::vector<std::string>& command,
                                                     std::size_t parts, const std::string& function) {
  if (!hasValgrind()) return Error{ErrorCode::kUnavailable, "valgrind is not on the PATH (Debian: valgrind)"};
  const ScratchFolder scratch;
  if (scratch.path().empty())
    return Error{ErrorCode::kFailed,
                 std::string("cannot make a folder for callgrind: ") + std::strerror(errno)};
  const fs::path out = scratch.path() / "count", messages = scratch.path() / "messages";
  std::vector<std::string> whole = {"valgrind",
                                    "--tool=callgrind",
                                    "--collect-atstart=no",
                                    "--toggle-collect=" + function,
                                    "--dump-before=needlelab_end_counted_part",
                                    "--callgrind-out-file=" + out.string()};
  whole.insert(whole.end(), command.begin(), command.end());
  if (const int status = runQuietly(whole, messages); status != 0) {
    const auto said = readWholeFile(messages, 1u << 20);
    const std::string text = said.ok() ? *said : "";
    return Error{ErrorCode::kFailed, "counting with valgrind failed (exit " + std::to_string(status) +
                                         "): " + text.substr(text.size() > 600 ? text.size() - 600 : 0)};
  }
  // count.1, count.2, … ; the last file has the counts after the last mark
  std::vector<std::uint64_t> counts;
  for (std::size_t part = 1; part <= parts; ++part) {
    const auto total = totalIn(out.string() + "." + std::to_string(part));
    if (!total.ok()) return total.error();
    counts.push_back(*total);
  }
  return counts;
}

}  // namespace needlelab
