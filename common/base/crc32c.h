/// CRC-32C (Castagnoli, polynomial 0x1EDC6F41 reflected), as in iSCSI (RFC 3720, appendix B.4).
#pragma once

#include <cstdint>

#include "common/base/bytes.h"

namespace needlelab {

/// Returns the CRC of `bytes`; to continue, pass the CRC of the preceding bytes. Check value:
/// crc32c("123456789") = 0xE3069283.
std::uint32_t crc32c(ByteView bytes, std::uint32_t previous = 0) noexcept;

/// Portable version for processors without the CRC instruction; a test compares both.
std::uint32_t crc32cByTables(ByteView bytes, std::uint32_t previous = 0) noexcept;

}  // namespace needlelab
