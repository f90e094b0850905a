/// A fresh folder for one test, removed with its content at the end.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace needlelab::test {

class TempFolder {
 public:
  TempFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "needlelab-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a folder like " + name);
    path_ = name;
  }
  ~TempFolder() {
    std::error_code ignored;  // a destructor may not throw; a leftover folder under /tmp is harmless
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Writes `text` to a file with that name and returns its path; throws on failure.
  std::filesystem::path write(const std::string& name, std::string_view text) const {
    const auto file = path_ / name;
    std::ofstream stream(file, std::ios::binary);
    stream << text;
    stream.close();
    if (!stream) {
      std::error_code unknown;
      const auto room = std::filesystem::space(path_, unknown).available;
      throw std::runtime_error("cannot write " + std::to_string(text.size()) + " bytes to " + file.string() +
                               ": " + std::to_string(room) +
                               " bytes are free there; make room, or set TMPDIR");
    }
    return file;
  }

 private:
  std::filesystem::path path_;
};

}  // namespace needlelab::test
