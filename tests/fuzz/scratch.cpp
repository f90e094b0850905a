#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

struct Folder {
  Folder() {
    // In memory: the code under test writes and syncs thousands of files per second.
    std::error_code error;
    const std::filesystem::path memory = "/dev/shm";
    const bool usable = std::filesystem::is_directory(memory, error) && ::access(memory.c_str(), W_OK) == 0;
    path = (usable ? memory : std::filesystem::temp_directory_path()) /
           ("needlelab-fuzz-" + std::to_string(::getpid()));
    std::filesystem::remove_all(path, error);
    std::filesystem::create_directories(path);
  }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path, error);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::filesystem::path path;
};

}  // namespace

std::vector<std::span<std::uint8_t>> partsOf(std::span<std::uint8_t> data, std::size_t most) {
  std::vector<std::span<std::uint8_t>> parts;
  auto from = data.begin();
  while (parts.size() < most) {
    const auto mark = std::search(from, data.end(), kPartMark.begin(), kPartMark.end(),
                                  [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); });
    parts.emplace_back(from, mark);
    if (mark == data.end()) break;
    from = mark + kPartMark.size();
  }
  return parts;
}

std::vector<ByteView> partsOf(ByteView data, std::size_t most) {
  // Only read here: the returned views are const again.
  const auto parts = partsOf(std::span(const_cast<std::uint8_t*>(data.data()), data.size()), most);
  return {parts.begin(), parts.end()};
}

const std::filesystem::path& scratchFolder() {
  static const Folder folder;
  return folder.path;
}

void writeFile(const std::filesystem::path& path, ByteView bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace needlelab::fuzz
