/// Where a running program's processor time goes, by Linux perf (software clock, no counters needed).
#pragma once

#include <sys/types.h>

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab::test {

/// Samples by kind of work, and by thread.
struct Profile {
  std::size_t samples = 0;
  std::map<std::string, std::size_t> work;
  std::map<pid_t, std::map<std::string, std::size_t>> threads;
};

/// Which kind of work a sample is: its stack, innermost frame first, as perf script prints it
/// ("ip symbol (object)"). In the kernel the system call decides, elsewhere the innermost frame.
std::string workOf(const std::vector<std::string>& frames);

/// From `perf script -F tid,ip,sym,dso`.
Profile profileOf(std::string_view perf_script);

}  // namespace needlelab::test
