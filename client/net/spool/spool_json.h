/// The spool's small files: JSON, then a line with a checksum over it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// A copy of the session's description, in case session.json is damaged.
inline constexpr const char* kDescriptionCopy = "session.copy.json";

/// Returns the text with a last line "crc32c HHHHHHHH": the CRC-32C, in hex digits, of everything before it.
std::string sealed(std::string text);

/// Whether the text ends with a line as written by `sealed`.
bool hasSeal(std::string_view text);
/// Returns the text before the last line of `sealed`. Errors: kCorrupt if the line is missing or its checksum
/// is wrong.
Result<std::string> unsealed(const std::string& text);

/// Parses an untrusted text. Null if it is nested deeper than 16 levels: copying or writing a value takes a
/// stack frame per level, and a megabyte can hold a million levels. A discarded value if it is not JSON.
nlohmann::json parsedShallow(const std::string& text);

/// Refuses an existing file that is not a regular one: the spool makes no links, and opening a pipe for
/// writing would block the program. Errors: kCorrupt.
Status checkSpoolFile(const std::filesystem::path& path);
/// Reads a whole file of the spool. Errors: kCorrupt (not a regular file), kInvalidInput.
Result<std::string> readSpoolText(const std::filesystem::path& path, std::size_t max_bytes);
/// Writes a file of the spool atomically, mode 0600. Errors: kUnavailable.
Status writeSpoolText(const std::filesystem::path& path, const std::string& text);

/// Reads a small sealed JSON object; a null value if the file is missing. Errors: kCorrupt (also for JSON
/// nested deeper than 16), kInvalidInput.
Result<nlohmann::json> readSpoolJson(const std::filesystem::path& path);
/// Writes it sealed, atomically, mode 0600. Errors: kUnavailable.
Status writeSpoolJson(const std::filesystem::path& path, const nlohmann::json& json);

/// Returns the value of `key`, or 0 or false if it is missing or of another type.
std::uint64_t countAt(const nlohmann::json& json, const char* key);
bool flagAt(const nlohmann::json& json, const char* key);

}  // namespace needlelab
