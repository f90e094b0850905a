/// A lab of real programs: a server and eight stations with simulated hands, one of them in trouble, and
/// instructors' windows that a script drives.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/integration/lab.h"

namespace needlelab::test {

class LabOfEight {
 public:
  static constexpr int kStations = 8;
  /// This station has a device that jumps, so the gate removes its force.
  static constexpr int kInTrouble = 5;

  /// Makes accounts, stations and files; starts nothing.
  LabOfEight();

  void startServer() { lab_.startServer(); }
  void killServer() { lab_.killServer(); }
  int stopServer() { return lab_.stopServer(); }

  /// Runs a lesson that ends by itself, with a hand of this skill (0-1). Returns its session.
  std::string practise(int station, double skill, double seconds);
  /// Starts all eight stations; each runs until it is stopped.
  void startStations();
  [[nodiscard]] Process& station(int number) { return *stations_.at(static_cast<std::size_t>(number - 1)); }
  /// Sends SIGTERM to all stations. Each must exit with 0, except the station in trouble, which must report
  /// the fault by its exit code.
  void stopStations();

  /// Starts needlelab-instructor with its window, driven by `script`. Its output goes to `name`.log.
  std::unique_ptr<Process> window(const std::string& name, const std::string& script, bool off_screen);
  /// Runs needlelab-instructor --headless with these arguments. Returns its exit code.
  int headless(const std::vector<std::string>& arguments);
  /// Returns the rows of needlelab-admin … --json on the running server, as an administrator.
  [[nodiscard]] nlohmann::json rows(const std::vector<std::string>& arguments) const;

  /// Verifies every session in the stopped server's folder with needlelab-admin. Returns the session ids.
  std::vector<std::string> verifyAll();
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return lab_.path(name); }
  /// Returns the path for a picture: in NEEDLELAB_PICTURES if set, otherwise in the lab's own folder.
  [[nodiscard]] std::filesystem::path picture(const std::string& name) const;

 private:
  [[nodiscard]] std::vector<std::string> stationArguments(int number) const;
  [[nodiscard]] std::vector<std::string> peer(const std::string& user) const;
  Lab lab_;
  std::vector<std::unique_ptr<Process>> stations_;
};

}  // namespace needlelab::test
