// A spool as a crash, a failing disk or a stranger left it.
#include <array>
#include <cstring>

#include "base/crc32c.h"
#include "gesture/chunk.h"
#include "net/spool.h"
#include "net/spool_lessons.h"
#include "target.h"

namespace needlelab::fuzz {
namespace {

namespace fs = std::filesystem;

/// Seven files one after the other, each behind its length (u16): the order is that of kFiles.
constexpr std::array kFiles = {"session.json", "chunks", "tail", "end.json", "acked.json", "lost", "lesson"};
constexpr const char* kSession = "01890a5d-ac96-774b-bcce-b302099a8057";

std::array<std::pair<std::size_t, std::size_t>, kFiles.size()> partsOf(ByteView data) {
  std::array<std::pair<std::size_t, std::size_t>, kFiles.size()> parts{};
  std::size_t at = 0;
  for (auto& part : parts) {
    std::uint16_t length = 0;
    if (at + 2 <= data.size()) {
      std::memcpy(&length, data.data() + at, 2);
      at += 2;
    }
    const std::size_t count = std::min<std::size_t>(length, data.size() - at);
    part = {at, count};
    at += count;
  }
  return parts;
}

// record: magic, bytes of data, seq, part, CRC over 16 bytes of header and the data
void repairRecords(std::span<std::uint8_t> file) {
  std::size_t at = 0;
  while (at + kSpoolRecordHeader <= file.size()) {
    std::uint32_t length = 0;
    std::memcpy(&length, file.data() + at + 4, 4);
    if (length > file.size() - at - kSpoolRecordHeader) return;
    repairChunk(file.subspan(at + kSpoolRecordHeader, length));
    std::uint32_t crc = crc32c(ByteView(file).subspan(at + 4, 16));
    crc = crc32c(ByteView(file).subspan(at + kSpoolRecordHeader, length), crc);
    std::memcpy(file.data() + at + 20, &crc, 4);
    at += kSpoolRecordHeader + length;
  }
}

}  // namespace

void repairSpool(std::span<std::uint8_t> data) {
  const auto parts = partsOf(data);
  for (const std::size_t i : {1u, 2u}) repairRecords(data.subspan(parts[i].first, parts[i].second));
}

void spool(ByteView data) {
  const fs::path folder = scratchFolder() / "spool";
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  fs::create_directories(folder / kSession);
  fs::create_directories(folder / "lessons");
  const auto parts = partsOf(data);
  for (std::size_t i = 0; i < kFiles.size(); ++i) {
    const auto [at, count] = parts[i];
    if (count == 0) continue;
    const bool lesson = i + 1 == kFiles.size();
    writeFile(lesson ? folder / "lessons/practice.json" : folder / kSession / kFiles[i],
              data.subspan(at, count));
  }
  const LessonCache lessons(folder);
  const auto lesson = lessons.find("practice");
  for (const CachedLesson& listed : lessons.list())
    require(listed.trouble.empty() == lesson.ok(), "a lesson in the list can be found");

  SpoolContents first;
  bool found = false;
  // twice: what the first opening mended is whole at the second
  for (int round = 0; round < 2; ++round) {
    const auto opened = Spool::open(folder);
    if (!opened.ok()) return;
    const auto sessions = (*opened)->unfinished();
    require(round == 0 || sessions.empty() == !found, "a session that was there is there again");
    for (const auto& session : sessions) {
      const SpoolContents contents = session->contents();
      std::uint64_t samples = 0;
      for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
        const auto bytes = session->readChunk(seq);
        require(bytes.ok(), "every chunk that is counted can be read");
        const auto info = inspectChunk(*bytes);
        require(info.ok(), "every chunk that is counted is one");
        samples += info->count;
        if (kPlanted) {
          // the fault: a number of the file is an index
          static std::array<std::uint8_t, 4> seen{};
          seen.data()[seq] = 1;
        }
      }
      require(samples == contents.samples, "samples are counted");
      require(session->samplesIn(contents.chunks) == samples, "samples are counted twice alike");
      if (round == 1) {
        require(contents.chunks == first.chunks && contents.samples == first.samples &&
                    contents.hash == first.hash,
                "what was mended stays as it is");
      }
      first = contents;
      found = true;
    }
  }
}

}  // namespace needlelab::fuzz
