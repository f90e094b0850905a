#include "server/web/static_files.h"

#include <sodium.h>

#include <array>
#include <fstream>
#include <sstream>
#include <string_view>
#include <utility>

namespace needlelab {
namespace {

constexpr std::size_t kMostFiles = 1000;
constexpr std::uintmax_t kMostBytes = 16u << 20;

constexpr std::array<std::pair<std::string_view, std::string_view>, 10> kWebTypes = {{
    {".html", "text/html; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".json", "application/json"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
    {".woff2", "font/woff2"},
    {".txt", "text/plain; charset=utf-8"},
}};

std::string_view typeOfFile(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  for (const auto& [known, type] : kWebTypes) {
    if (ending == known) return type;
  }
  return {};
}

bool isHidden(const std::filesystem::path& relative) {
  for (const auto& part : relative) {
    const std::string name = part.string();
    if (name.empty() || name.front() == '.' || name.front() == '_') return true;
  }
  return false;
}

std::string etagOf(const std::string& body) {
  std::array<unsigned char, 16> hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(body.data()),
                     body.size(), nullptr, 0);
  std::array<char, 2 * hash.size() + 1> hex{};
  sodium_bin2hex(hex.data(), hex.size(), hash.data(), hash.size());
  return "\"" + std::string(hex.data()) + "\"";
}

Error fileFault(const std::filesystem::path& folder, const std::string& text) {
  return {ErrorCode::kInvalidInput, "--web-root " + folder.string() + ": " + text};
}

}  // namespace

Result<StaticFiles> StaticFiles::load(const std::filesystem::path& folder) {
  StaticFiles all;
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) return all;
  std::uintmax_t bytes = 0;
  std::filesystem::recursive_directory_iterator walk(folder, error), end;
  if (error) return fileFault(folder, error.message());
  for (; walk != end; walk.increment(error)) {
    if (error) return fileFault(folder, error.message());
    const auto relative = walk->path().lexically_relative(folder);
    // a link could lead out of the folder
    if (walk->is_symlink(error) || !walk->is_regular_file(error) || isHidden(relative)) continue;
    const std::string_view type = typeOfFile(relative);
    if (type.empty()) continue;
    bytes += walk->file_size(error);
    if (bytes > kMostBytes || all.files_.size() >= kMostFiles)
      return fileFault(folder, "has more than 1000 files or 16 MiB: is this the console's folder?");
    std::ifstream file(walk->path(), std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    if (!file) return fileFault(folder, "cannot read " + walk->path().string());
    auto body = std::make_shared<const std::string>(std::move(text).str());
    std::string etag = etagOf(*body);
    all.files_["/" + relative.generic_string()] = {std::string(type), std::move(etag), std::move(body)};
  }
  return all;
}

const StaticFile* StaticFiles::find(const std::string& path) const {
  const auto found = files_.find(path == "/" ? "/index.html" : path);
  return found == files_.end() ? nullptr : &found->second;
}

}  // namespace needlelab
