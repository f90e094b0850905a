/// The computer's part of the self-test: processor, clock, disk, engine.

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <fstream>

#include "client/effect_cost/tick_run.h"
#include "client/station/run/sample_profiles.h"
#include "client/station/run/self_test.h"
#include "common/base/clock.h"
#include "common/base/program.h"
#include "common/fem/needle_mesh.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

std::string firstLine(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::string because(const char* what, const std::filesystem::path& path, int error) {
  return std::string(what) + " " + path.string() + ": " + std::strerror(error);
}

// the tick of one profile's scene; nothing when it is not valid
Result<double> tickOf(const EmbeddedFile& file, double rate_hz, std::string& id) {
  const auto profile = parseProfile(file.text, file.name);
  if (!profile.ok()) return profile.error();
  id = profile->id();
  auto scene = sceneSpecOf(*profile);
  if (!scene.ok()) return scene.error();
  if (Status status = addCompliance(*scene); !status.ok()) return status.error();
  const auto model = compile(*scene, rate_hz);
  if (!model.ok()) return model.error();
  const auto gesture = measuringGesture(*scene, rate_hz);
  TickRun run(*model, gesture);
  return timeFor(0.02, [&] { run.tick(); }).median_ns;
}

}  // namespace

MachineFacts measureMachine() {
  MachineFacts facts;
  facts.text = machineText();
  facts.cores = static_cast<unsigned>(std::max(0L, ::sysconf(_SC_NPROCESSORS_ONLN)));
  facts.clock_source = firstLine("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  timespec resolution{};
  if (::clock_getres(CLOCK_MONOTONIC, &resolution) == 0)
    facts.clock_resolution_ns =
        static_cast<double>(resolution.tv_sec) * 1e9 + static_cast<double>(resolution.tv_nsec);
  facts.clock_cost_ns = clockCost_ns();
  return facts;
}

DiskFacts measureDisk(const std::filesystem::path& folder) {
  constexpr int kSyncs = 20;
  DiskFacts facts;
  facts.folder = folder.string();
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    facts.trouble = "the folder " + facts.folder + " cannot be made: " + error.message();
    return facts;
  }
  const auto space = std::filesystem::space(folder, error);
  facts.free_bytes = error ? 0 : static_cast<double>(space.available);

  std::string name = (folder / "self-test-XXXXXX").string();
  const int fd = ::mkstemp(name.data());
  if (fd < 0) {
    facts.trouble = because("cannot write to", folder, errno);
    return facts;
  }
  const std::array<char, 8192> block{};
  std::vector<double> seconds;
  for (int i = 0; i < kSyncs && facts.trouble.empty(); ++i) {
    const std::int64_t from_ns = steadyNowNs();
    if (::write(fd, block.data(), block.size()) != static_cast<ssize_t>(block.size()) || ::fdatasync(fd) != 0)
      facts.trouble = because("cannot write to", folder, errno);
    seconds.push_back(static_cast<double>(steadyNowNs() - from_ns) * 1e-9);
  }
  ::close(fd);
  ::unlink(name.c_str());
  std::sort(seconds.begin(), seconds.end());
  facts.sync_median_s = seconds[seconds.size() / 2];
  facts.sync_max_s = seconds.back();
  return facts;
}

EngineFacts measureEngine(double rate_hz) {
  EngineFacts facts;
  for (const EmbeddedFile& file : sampleProfiles()) {
    std::string id;
    const auto tick_ns = tickOf(file, rate_hz, id);
    if (!tick_ns.ok()) {
      facts.trouble = tick_ns.error().message;
      return facts;
    }
    ++facts.scenes;
    if (*tick_ns > facts.tick_median_ns || facts.heaviest.empty()) {
      facts.tick_median_ns = *tick_ns;
      facts.heaviest = id;
    }
  }
  if (facts.scenes == 0) facts.trouble = "the program holds no sample scene";
  return facts;
}

}  // namespace needlelab
