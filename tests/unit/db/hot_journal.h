/// A rollback journal beside a database, as a crash in a change of several databases leaves it, written as
/// SQLite's file format says (https://www.sqlite.org/fileformat2.html, "The Rollback Journal").
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace needlelab::test {

/// Whoever opens `database` as its owner rolls the journal back, and then deletes `victim`, which the journal
/// names as its super-journal. Returns the journal's path.
inline std::filesystem::path writeHotJournal(const std::filesystem::path& database,
                                             const std::filesystem::path& victim) {
  constexpr std::uint32_t kPage_bytes = 4096, kSector_bytes = 512, kPending_byte = 0x4000'0000;
  const std::string magic("\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8), name = victim.string();
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xffu);
    return bytes;
  };
  const auto pages = static_cast<std::uint32_t>(std::filesystem::file_size(database) / kPage_bytes);
  // no page, a nonce of 0
  std::string text =
      magic + number(0) + number(0) + number(pages) + number(kSector_bytes) + number(kPage_bytes);
  text.resize(kSector_bytes, '\0');
  std::uint32_t sum = 0;
  for (const char c : name) sum += static_cast<unsigned char>(c);
  text += number(kPending_byte / kPage_bytes + 1) + name + number(static_cast<std::uint32_t>(name.size())) +
          number(sum) + magic;
  const std::filesystem::path journal = database.string() + "-journal";
  std::ofstream(journal, std::ios::binary) << text;
  return journal;
}

}  // namespace needlelab::test
