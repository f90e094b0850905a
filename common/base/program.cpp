#include "common/base/program.h"

#include <fmt/core.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <iostream>

namespace needlelab {

int afterOutput(int code, const char* program) {
  std::cout.flush();
  const bool written = std::cout.good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (written || code != kExitDone) return code;
  std::fprintf(stderr, "%s: cannot write to standard output\n", program);
  return kExitFailed;
}

void endProgram(int code) {
  std::cout.flush();
  std::cerr.flush();
  std::fflush(nullptr);
  ::_exit(code);
}

std::string machineText() {
  std::string processor = "unknown processor";
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);)
    if (line.starts_with("model name") && line.find(": ") != std::string::npos) {
      processor = line.substr(line.find(": ") + 2);
      break;
    }
  utsname system{};
  const bool known = ::uname(&system) == 0;
  return fmt::format(
      "{}, {} cores, {}", processor, ::sysconf(_SC_NPROCESSORS_ONLN),
      (known ? std::string(system.sysname) + " " + system.release + " " + system.machine : "unknown system"));
}

}  // namespace needlelab
