#include "tests/load/server_profile.h"

#include <cstdlib>
#include <initializer_list>
#include <sstream>

namespace needlelab::test {
namespace {

bool has(const std::string& text, std::initializer_list<const char*> words) {
  for (const char* word : words)
    if (text.find(word) != std::string::npos) return true;
  return false;
}

bool inKernel(const std::string& frame) {
  return has(frame, {"[kernel", "[guest.kernel"});
}

std::string kernelWork(const std::vector<std::string>& frames) {
  for (const std::string& frame : frames) {
    if (has(frame, {"sys_send", "sys_write"})) return "kernel: send (both halves of the loopback)";
    if (has(frame, {"sys_recv", "sys_read"})) return "kernel: receive";
    if (has(frame, {"sys_epoll", "sys_timerfd"})) return "kernel: epoll and timers";
    if (has(frame, {"sys_fdatasync", "sys_fsync"})) return "kernel: fsync";
    if (has(frame, {"sys_pwrite", "sys_pread", "sys_ftruncate", "sys_fallocate"}))
      return "kernel: database files";
    if (has(frame, {"sys_futex"})) return "kernel: waking threads";
  }
  return "kernel: other";
}

}  // namespace

std::string workOf(const std::vector<std::string>& frames) {
  if (frames.empty()) return "other";
  const std::string& leaf = frames.front();
  if (inKernel(leaf)) return kernelWork(frames);
  if (has(leaf, {"libcrypto", "libssl"})) return "TLS";
  if (has(leaf, {"libprotobuf", "needlelab::pb::", "google::protobuf"})) return "Protobuf";
  if (has(leaf, {"libsqlite3"})) return "SQLite";
  if (has(leaf, {"libsodium"})) return "BLAKE2b";
  if (has(leaf, {"Chunk", "Column", "crc32c", "pack", "zigzag"})) return "codec and CRC";
  if (has(leaf, {"libc.so", "libstdc++", "operator new", "operator delete"})) return "memory and copies";
  if (has(leaf, {"boost::asio", "std::__n4861", "coroutine", "wire/asio"})) return "Asio";
  if (has(leaf, {"needlelab::"})) return "needlelab's own code";
  return "other";
}

Profile profileOf(std::string_view perf_script) {
  Profile profile;
  pid_t thread = 0;
  std::vector<std::string> frames;
  const auto take = [&] {
    if (thread != 0) {
      const std::string work = workOf(frames);
      ++profile.samples;
      ++profile.work[work];
      ++profile.threads[thread][work];
    }
    thread = 0;
    frames.clear();
  };
  // blocks apart by empty lines: the thread, then its frames
  std::istringstream lines{std::string(perf_script)};
  for (std::string line; std::getline(lines, line);) {
    const auto first = line.find_first_not_of(" \t");
    if (first == std::string::npos) {
      take();
    } else if (thread == 0) {
      thread = static_cast<pid_t>(std::strtol(line.c_str() + first, nullptr, 10));
    } else {
      frames.push_back(line.substr(first));
    }
  }
  take();
  return profile;
}

}  // namespace needlelab::test
