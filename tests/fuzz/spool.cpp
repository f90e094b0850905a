// Fuzzes a spool as a crash, a failing disk or an attacker leaves it.
#include <array>
#include <cstring>

#include "client/net/spool/lesson_cache.h"
#include "client/net/spool/spool.h"
#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

namespace fs = std::filesystem;

/// Eight files one after the other, in the order of kFiles; those at the end may be missing.
constexpr std::array kFiles = {"session.json", "chunks", "tail",   "end.json",
                               "acked.json",   "lost",   "lesson", "session.copy.json"};
constexpr std::size_t kLesson = 6;
constexpr const char* kSession = "01890a5d-ac96-774b-bcce-b302099a8057";

// record: magic, bytes of data, seq, part, CRC over 16 bytes of header and the data. Bit 1: the numbers count
// up like chunk numbers.
void repairRecords(std::span<std::uint8_t> file, unsigned how) {
  std::size_t at = 0;
  for (std::uint64_t seq = 0; at + kSpoolRecordHeader <= file.size(); ++seq) {
    std::uint32_t length = 0;
    std::memcpy(&length, file.data() + at + 4, 4);
    if (length > file.size() - at - kSpoolRecordHeader) return;
    repairChunk(file.subspan(at + kSpoolRecordHeader, length), how);
    if ((how & 2) != 0) std::memcpy(file.data() + at + 8, &seq, sizeof seq);
    std::uint32_t crc = crc32c(ByteView(file).subspan(at + 4, 16));
    crc = crc32c(ByteView(file).subspan(at + kSpoolRecordHeader, length), crc);
    std::memcpy(file.data() + at + 20, &crc, 4);
    at += kSpoolRecordHeader + length;
  }
}

// the last line of the small files: "crc32c ", eight hex digits, newline
void repairSeal(std::span<std::uint8_t> file) {
  constexpr std::size_t kLine = 16;
  if (file.size() <= kLine) return;
  const auto line = file.last(kLine);
  if (std::memcmp(line.data(), "crc32c ", 7) != 0) return;
  const std::uint32_t crc = crc32c(ByteView(file).first(file.size() - kLine));
  for (std::size_t digit = 0; digit < 8; ++digit)
    line[7 + digit] = static_cast<std::uint8_t>("0123456789abcdef"[crc >> (28 - 4 * digit) & 15]);
}

}  // namespace

void repairSpool(std::span<std::uint8_t> data, unsigned how) {
  const auto parts = partsOf(data, kFiles.size());
  if (parts.size() > 1) repairRecords(parts[1], how);
  if (parts.size() > 2) repairRecords(parts[2], how & ~2u);
  for (const std::size_t small : {0u, 3u, 4u, 5u, 7u})
    if (parts.size() > small) repairSeal(parts[small]);
}

void spool(ByteView data) {
  const fs::path folder = scratchFolder() / "spool";
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  fs::create_directories(folder / kSession);
  fs::create_directories(folder / "lessons");
  const auto parts = partsOf(data, kFiles.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].empty()) continue;
    const bool lesson = i == kLesson;
    writeFile(lesson ? folder / "lessons/practice.json" : folder / kSession / kFiles[i], parts[i]);
  }
  const LessonCache lessons(folder);
  const auto lesson = lessons.find("practice");
  for (const CachedLesson& listed : lessons.list())
    require(listed.trouble.empty() == lesson.ok(), "a lesson in the list can be found");

  SpoolContents first;
  bool found = false;
  // Opens it twice: the second opening must find the spool that the first one repaired.
  for (int round = 0; round < 2; ++round) {
    const auto opened = Spool::open(folder);
    if (!opened.ok()) return;
    const auto sessions = (*opened)->unfinished();
    require(round == 0 || sessions.empty() == !found, "a session that was there is there again");
    for (const auto& session : sessions) {
      const SpoolContents contents = session->contents();
      if (kPlanted) {
        // The planted fault: a number from a file is used as an unchecked index.
        static std::array<std::uint8_t, 16> seen{};
        surely(seen.data()[contents.loss.samples]) = 1;
      }
      // a hostile end may say that the server has what is missing
      if (!session->allOnDisk()) {
        found = true;
        continue;
      }
      std::uint64_t samples = 0;
      for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
        const auto bytes = session->readChunk(seq);
        require(bytes.ok(), "every chunk that is counted can be read");
        const auto info = inspectChunk(*bytes);
        require(info.ok(), "every chunk that is counted is one");
        samples += info->count;
      }
      require(samples == contents.samples, "samples are counted");
      require(session->samplesIn(contents.chunks) == samples, "samples are counted twice alike");
      if (round == 1) {
        require(contents.chunks == first.chunks && contents.samples == first.samples &&
                    contents.hash == first.hash,
                "a mended spool stays as it is");
      }
      first = contents;
      found = true;
    }
  }
}

}  // namespace needlelab::fuzz
