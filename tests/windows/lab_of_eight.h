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
  /// The station with a device that jumps, so that its force is taken away.
  static constexpr int kInTrouble = 5;

  /// Accounts, stations, files; nothing runs yet.
  LabOfEight();

  void startServer() { lab_.startServer(); }
  void killServer() { lab_.killServer(); }
  int stopServer() { return lab_.stopServer(); }

  /// A lesson that is over by itself, of a hand of this skill (0-1); its session.
  std::string practise(int station, double skill, double seconds);
  /// All eight; each goes on until it is stopped.
  void startStations();
  [[nodiscard]] Process& station(int number) { return *stations_.at(static_cast<std::size_t>(number - 1)); }
  /// SIGTERM to all; each must end well but the one in trouble, which must report it by its exit code.
  void stopStations();

  /// needlelab-instructor with its window, doing what `script` says. Its words are in `name`.log.
  std::unique_ptr<Process> window(const std::string& name, const std::string& script, bool off_screen);
  /// needlelab-instructor --headless with these arguments; its exit code.
  int headless(const std::vector<std::string>& arguments);
  /// Rows of needlelab-admin … --json on the running server, asked as an administrator.
  [[nodiscard]] nlohmann::json rows(const std::vector<std::string>& arguments) const;

  /// On the stopped server's folder: every session, each verified by needlelab-admin; their ids.
  std::vector<std::string> verifyAll();
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return lab_.path(name); }
  /// Where pictures are kept for a look: NEEDLELAB_PICTURES, else the lab's own folder.
  [[nodiscard]] std::filesystem::path picture(const std::string& name) const;

 private:
  [[nodiscard]] std::vector<std::string> stationArguments(int number) const;
  [[nodiscard]] std::vector<std::string> peer(const std::string& user) const;
  Lab lab_;
  std::vector<std::unique_ptr<Process>> stations_;
};

}  // namespace needlelab::test
