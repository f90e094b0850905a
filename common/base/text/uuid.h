/// UUID version 7 (RFC 9562): time-ordered, made without coordination. Identifies sessions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

using Uuid = std::array<std::uint8_t, 16>;

/// Makes a UUIDv7 from the wall clock (ms) and 74 random bits from the operating system. Thread: any except
/// the haptic thread.
Uuid makeUuidV7();
/// Lower-case text of 36 characters, e.g. 019aa0c3-7c1e-7b3a-9d5e-0123456789ab.
std::string uuidText(const Uuid& id);
/// The inverse of uuidText. Errors: kInvalidInput when the text does not have that form.
Result<Uuid> parseUuid(std::string_view text);

/// 16 bytes as a Uuid; nothing for any other length.
std::optional<Uuid> uuidOf(std::string_view bytes);
/// A kNotFound error with the session's id.
Error unknownSession(const Uuid& session);

}  // namespace needlelab
