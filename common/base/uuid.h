/// UUID version 7 (RFC 9562): time-ordered, made without coordination. Sessions are identified by it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

using Uuid = std::array<std::uint8_t, 16>;

/// A new UUIDv7 from the wall clock (ms) and 74 random bits of the operating system. Thread: any except the
/// haptic thread.
Uuid makeUuidV7();
/// Lower-case text of 36 characters, e.g. 019aa0c3-7c1e-7b3a-9d5e-0123456789ab.
std::string uuidText(const Uuid& id);
/// The inverse; kInvalidInput when the text is not of that form.
Result<Uuid> parseUuid(std::string_view text);

}  // namespace needlelab
