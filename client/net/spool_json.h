/// The spool's small files: JSON, then a line with a checksum over it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// A session's description again, for when session.json is damaged.
inline constexpr const char* kDescriptionCopy = "session.copy.json";

/// Returns the text with a last line "crc32c HHHHHHHH": the CRC-32C, in hex digits, of everything before it.
std::string sealed(std::string text);

/// Whether the text ends with a line as `sealed` writes it.
bool hasSeal(std::string_view text);
/// Returns the text before the last line of `sealed`. Errors: kCorrupt when the line is missing or its
/// checksum does not agree.
Result<std::string> unsealed(const std::string& text);

/// Parses a text that may be hostile. Null for one nested deeper than 16: copying or writing its value takes
/// a stack frame a level, and a megabyte can nest a million. A discarded value for what is not JSON.
nlohmann::json parsedShallow(const std::string& text);

/// Refuses what is there and is no regular file: the spool makes no links, and a pipe would hold the program
/// when it is opened for writing. Errors: kCorrupt.
Status checkSpoolFile(const std::filesystem::path& path);
/// Reads a whole file of the spool. Errors: kCorrupt (not a regular file), kInvalidInput.
Result<std::string> readSpoolText(const std::filesystem::path& path, std::size_t max_bytes);
/// Writes a file of the spool atomically, mode 0600. Errors: kUnavailable.
Status writeSpoolText(const std::filesystem::path& path, const std::string& text);

/// Reads a small sealed JSON object; a null value when the file is missing. Errors: kCorrupt (also for JSON
/// nested deeper than 16), kInvalidInput.
Result<nlohmann::json> readSpoolJson(const std::filesystem::path& path);
/// Writes it sealed, atomically, mode 0600. Errors: kUnavailable.
Status writeSpoolJson(const std::filesystem::path& path, const nlohmann::json& json);

/// Returns the value of `key`, or 0 or false when it is missing or of another type.
std::uint64_t countAt(const nlohmann::json& json, const char* key);
bool flagAt(const nlohmann::json& json, const char* key);

}  // namespace needlelab
