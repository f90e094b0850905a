/// What machine a figure was measured on, in words: it stands beside every result.
#pragma once

#include <string>

namespace needlelab {

/// Processor, cores, system, e.g. "Intel(R) Xeon(R) …, 2 cores, Linux 6.1.0 x86_64". Reads /proc/cpuinfo: not
/// for the haptic thread.
std::string machineText();

}  // namespace needlelab
