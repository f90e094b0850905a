#include "client/station/run/io/terminal.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <iostream>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/text.h"

namespace needlelab {

LiveLine& liveLine() {
  // never destroyed, because threads still log while the program ends
  static LiveLine& line = *new LiveLine(STDERR_FILENO);
  return line;
}

void logMessage(const std::string& text) {
  // may contain text from the server, a file or an instructor: removes terminal control characters
  liveLine().printMessage("station: " + printable(text));
}

bool EnterKey::isTerminal() const {
  return ::isatty(descriptor_) == 1;
}

bool EnterKey::pressed() {
  bool pressed = false;
  // a bounded number of reads, because input may come from a file
  for (int reads = 0; !closed_ && reads < 16; ++reads) {
    if (isTerminal() && ::tcgetpgrp(descriptor_) != ::getpgrp()) break;
    pollfd ready{descriptor_, POLLIN, 0};
    if (::poll(&ready, 1, 0) <= 0 || (ready.revents & (POLLIN | POLLHUP)) == 0) {
      closed_ = closed_ || (ready.revents & (POLLNVAL | POLLERR)) != 0;
      break;
    }
    std::array<char, 256> text;
    const ssize_t count = ::read(descriptor_, text.data(), text.size());
    if (count <= 0) {
      closed_ = true;
      break;
    }
    pressed = pressed || std::find(text.data(), text.data() + count, '\n') != text.data() + count;
  }
  return pressed;
}

std::string reportJson(const nlohmann::ordered_json& rows) {
  const nlohmann::ordered_json report = {
      {"version", programVersion()}, {"machine", machineText()}, {"rows", rows}};
  // device text that is not UTF-8 must not end the program
  return report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int refused(const Error& error) {
  std::cerr << "needlelab-station: " << error.message << "\n";
  return exitCodeOf(error);
}

int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code) {
  const bool json_on_stdout = options.json && options.json_file.empty();
  (json_on_stdout ? std::cerr : std::cout) << text << std::flush;
  if (json_on_stdout) std::cout << json << std::flush;
  if (!std::cout) {
    std::cerr << "needlelab-station: cannot write to standard output\n";
    return kExitFailed;
  }
  if (options.json && !json_on_stdout)
    if (const Status status = writeFileAtomically(options.json_file, viewOf(json)); !status.ok()) {
      std::cerr << "needlelab-station: " << status.error().message << "\n";
      return kExitFailed;
    }
  return code;
}

}  // namespace needlelab
