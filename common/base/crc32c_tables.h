/// The way of crc32c on a processor without an instruction for it; a test compares both.
#pragma once

#include <cstdint>

#include "common/base/bytes.h"

namespace needlelab {

/// As crc32c.
std::uint32_t crc32cByTables(ByteView bytes, std::uint32_t previous = 0) noexcept;

}  // namespace needlelab
