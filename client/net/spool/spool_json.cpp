#include "client/net/spool/spool_json.h"

#include <fmt/core.h>
#include <sys/stat.h>

#include <utility>

#include "common/base/bytes.h"
#include "common/base/files/files.h"

namespace needlelab {
namespace {

using Json = nlohmann::json;
constexpr std::string_view kSeal = "crc32c ";
constexpr std::size_t kSealLine = kSeal.size() + 8 + 1;  // hex digits, newline

std::string sealOf(std::string_view text) {
  return fmt::format("{}{:08x}\n", kSeal, crc32c(viewOf(text)));
}

}  // namespace

std::string sealed(std::string text) {
  if (!text.ends_with('\n')) text += '\n';
  return text + sealOf(text);
}

bool hasSeal(std::string_view text) {
  if (text.size() <= kSealLine) return false;
  const std::string_view line = text.substr(text.size() - kSealLine);
  return text[text.size() - kSealLine - 1] == '\n' && line.starts_with(kSeal) && line.ends_with('\n');
}

Result<std::string> unsealed(const std::string& text) {
  const std::string body = hasSeal(text) ? text.substr(0, text.size() - kSealLine) : std::string();
  if (body.empty() || text.substr(body.size()) != sealOf(body))
    return Error{ErrorCode::kCorrupt, "its checksum does not agree: it was damaged"};
  return body;
}

Json parsedShallow(const std::string& text) {
  constexpr int kMostDepth = 16;
  bool deep = false;
  Json json = Json::parse(
      text,
      [&](int depth, Json::parse_event_t, Json&) {
        deep |= depth > kMostDepth;
        return !deep;
      },
      false);
  return deep ? Json() : json;
}

Status checkSpoolFile(const std::filesystem::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || S_ISREG(info.st_mode)) return {};
  return Error{ErrorCode::kCorrupt,
               path.string() + ": is not a regular file, and no station made it; remove it"};
}

Result<std::string> readSpoolText(const std::filesystem::path& path, std::size_t max_bytes) {
  RETURN_IF_ERROR(checkSpoolFile(path));
  return readWholeFile(path, max_bytes);
}

Status writeSpoolText(const std::filesystem::path& path, const std::string& text) {
  // writing into a pipe would block the program until it is read
  Status status = checkSpoolFile(path);
  if (status.ok()) status = writeFileAtomically(path, viewOf(text), 0600);
  if (!status.ok()) return Error{ErrorCode::kUnavailable, status.error().message};
  return {};
}

Result<Json> readSpoolJson(const std::filesystem::path& path) {
  std::error_code ignored;
  const auto kind = std::filesystem::symlink_status(path, ignored).type();
  if (kind == std::filesystem::file_type::not_found) return Json();
  ASSIGN_OR_RETURN(const auto text, readSpoolText(path, 1u << 20));
  const auto body = unsealed(text);
  if (!body.ok()) return Error{ErrorCode::kCorrupt, path.string() + ": " + body.error().message};
  Json json = parsedShallow(*body);
  if (!json.is_object()) return Error{ErrorCode::kCorrupt, path.string() + ": is not a JSON object"};
  return json;
}

Status writeSpoolJson(const std::filesystem::path& path, const Json& json) {
  return writeSpoolText(path, sealed(json.dump(1)));
}

std::uint64_t countAt(const Json& json, const char* key) {
  const auto at = json.find(key);
  return at != json.end() && at->is_number_unsigned() ? at->get<std::uint64_t>() : 0;
}

bool flagAt(const Json& json, const char* key) {
  const auto at = json.find(key);
  return at != json.end() && at->is_boolean() && at->get<bool>();
}

}  // namespace needlelab
