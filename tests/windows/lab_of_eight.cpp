#include "tests/windows/lab_of_eight.h"

#include <cstdlib>
#include <fstream>

#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

std::string bench(int number) {
  return "bench-" + std::to_string(number);
}

/// Remarks for a person may precede it.
nlohmann::json rowsIn(const std::string& said) {
  const auto begin = said.find('{');
  if (begin == std::string::npos) return nlohmann::json::array();
  const auto document = nlohmann::json::parse(said.substr(begin), nullptr, false);
  return document.is_object() && document.contains("rows") ? document["rows"] : nlohmann::json::array();
}

}  // namespace

LabOfEight::LabOfEight() {
  std::filesystem::permissions(path("password"), std::filesystem::perms::owner_read);
  EXPECT_EQ(
      lab_.admin({"user", "add", "ada", "--role", "administrator", "--password-file", path("password")}), 0);
  for (int number = 1; number <= kStations; ++number) {
    EXPECT_EQ(lab_.admin({"user", "add", "trainee-" + std::to_string(number), "--role", "trainee"}), 0);
    EXPECT_EQ(lab_.admin({"station", "add", bench(number), "--out", path(bench(number) + ".key")}), 0);
  }
  // Outside the tissue, at rest for two seconds; then the device jumps to another position and stays there.
  std::ofstream csv(path("jump.csv"));
  csv << "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  for (int k = 0; k < 60'000; ++k) csv << k * 0.01 << "," << (k < 200 ? 0 : 0.5) << ",0,1,0,0,0,1\n";
}

std::vector<std::string> LabOfEight::stationArguments(int number) const {
  return {"--server",
          "127.0.0.1:" + std::to_string(lab_.port()),
          "--ca",
          path("data") / "tls" / "ca.crt",
          "--key",
          path(bench(number) + ".key"),
          "--trainee",
          "trainee-" + std::to_string(number),
          "--exercise",
          "ball-free-practice",
          "--headless",
          "--spool",
          path("spool-" + std::to_string(number))};
}

std::string LabOfEight::practise(int number, double skill, double seconds) {
  auto arguments = stationArguments(number);
  const auto json = path("practise-" + std::to_string(number) + ".json");
  arguments.insert(arguments.end(),
                   {"--hand-skill", std::to_string(skill), "--hand-seed", std::to_string(number),
                    "--hand-repeat", "0", "--seconds", std::to_string(seconds), "--json", json});
  Process process("needlelab-station", arguments, path("practise.log"));
  EXPECT_EQ(process.wait(), kExitDone) << process.said();
  const auto text = readWholeFile(json);
  if (!text.ok()) return {};
  return nlohmann::json::parse(*text, nullptr, false).value("session_id", "");
}

void LabOfEight::startStations() {
  for (int number = 1; number <= kStations; ++number) {
    auto arguments = stationArguments(number);
    if (number == kInTrouble)
      arguments.insert(arguments.end(),
                       {"--device", "recording:" + path("jump.csv").string(), "--on-fault", "wait"});
    else
      arguments.insert(arguments.end(), {"--hand-skill", std::to_string(0.1 * number), "--hand-seed",
                                         std::to_string(number), "--hand-repeat", "0"});
    stations_.push_back(
        std::make_unique<Process>("needlelab-station", arguments, path(bench(number) + ".log")));
  }
}

void LabOfEight::stopStations() {
  // its device jumps two seconds after its lesson began, which may be now
  ASSERT_TRUE(eventually([&] { return station(kInTrouble).said().find("FAULT: ") != std::string::npos; }))
      << station(kInTrouble).said();
  for (const auto& process : stations_) process->signal(SIGTERM);
  for (int number = 1; number <= kStations; ++number) {
    const auto code = station(number).wait();
    ASSERT_TRUE(code.has_value()) << bench(number) << " does not end: " << station(number).said();
    EXPECT_EQ(*code, number == kInTrouble ? kExitFailed : kExitDone)
        << bench(number) << ": " << station(number).said();
  }
}

std::vector<std::string> LabOfEight::peer(const std::string& user) const {
  return {"--server",
          "127.0.0.1:" + std::to_string(lab_.port()),
          "--ca",
          path("data") / "tls" / "ca.crt",
          "--user",
          user,
          "--password-file",
          path("password")};
}

std::unique_ptr<Process> LabOfEight::window(const std::string& name, const std::string& script,
                                            bool off_screen) {
  std::ofstream(path(name + ".script")) << script;
  auto arguments = peer("ines");
  arguments.insert(arguments.end(), {"--script", path(name + ".script")});
  if (off_screen) arguments.emplace_back("--off-screen");
  return std::make_unique<Process>("instructor_script", arguments, path(name + ".log"));
}

int LabOfEight::headless(const std::vector<std::string>& more) {
  auto arguments = peer("ines");
  arguments.insert(arguments.end(), {"--headless", "--json"});
  arguments.insert(arguments.end(), more.begin(), more.end());
  Process process("needlelab-instructor", arguments, path("headless.log"));
  return process.wait().value_or(-1000);
}

nlohmann::json LabOfEight::rows(const std::vector<std::string>& more) const {
  auto arguments = peer("ada");
  arguments.insert(arguments.end(), more.begin(), more.end());
  arguments.emplace_back("--json");
  const auto log = path("rows.json");
  std::filesystem::remove(log);
  Process process("needlelab-admin", arguments, log);
  const auto code = process.wait();
  EXPECT_EQ(code, 0) << process.said();
  return rowsIn(process.said());
}

std::vector<std::string> LabOfEight::verifyAll() {
  std::filesystem::remove(path("list.json"));
  Process list("needlelab-admin", {"--data", path("data"), "session", "list", "--limit", "0", "--json"},
               path("list.json"));
  EXPECT_EQ(list.wait(), 0) << list.said();
  std::vector<std::string> ids;
  for (const auto& row : rowsIn(list.said())) {
    ids.push_back(row["session_id"]);
    EXPECT_NE(row["state"], "open") << ids.back();
    EXPECT_EQ(lab_.admin({"session", "verify", ids.back()}), 0);
  }
  return ids;
}

std::filesystem::path LabOfEight::picture(const std::string& name) const {
  const char* const kept = std::getenv("NEEDLELAB_PICTURES");
  return kept == nullptr || *kept == 0 ? path(name) : std::filesystem::path(kept) / name;
}

}  // namespace needlelab::test
