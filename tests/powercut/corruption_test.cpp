// Bytes changed by a disk: detected and reported, never returned as samples; the rest stays readable.
#include <gtest/gtest.h>

#include <fstream>
#include <map>

#include "db/backup/check.h"
#include "db/service/start/bootstrap.h"
#include "db/store/connection.h"
#include "tests/powercut/campaign.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kSessions = 6, kChunks = 30;

Uuid idOf(std::uint64_t session) {
  Uuid id{};
  id[15] = static_cast<std::uint8_t>(session + 1);
  return id;
}

/// Small chunks, and long ones that need overflow pages.
Bytes chunkFor(std::uint64_t session, std::uint64_t seq) {
  return encodeChunk(Resolution{},
                     someSamples(session * 1'000'000 + seq * 10'000, seq % 4 == 3 ? 4'000 : 40));
}

void fill(Connection& writer, std::uint64_t from_seq, std::uint64_t to_seq) {
  SessionStore store(writer);
  for (std::uint64_t s = 0; s < kSessions; ++s) {
    auto transaction = TestDb::must(Transaction::begin(writer, Transaction::Kind::kWrite));
    ASSERT_OK(store.open(describe(idOf(s)), 1));
    for (std::uint64_t seq = from_seq; seq < to_seq; ++seq)
      ASSERT_OK(store.append(idOf(s), seq, chunkFor(s, seq)));
    ASSERT_OK(transaction.commit());
  }
}

/// Results of reading a damaged database. `wrong` must stay empty.
struct Found {
  bool opened = false, checked_ok = false;
  std::uint64_t readable = 0;  ///< chunks that came back as they were stored
  std::string wrong, words;
};

Found look(const fs::path& path) {
  Found found;
  auto opened = Connection::open(path, {});
  if (!opened) {
    found.words = opened.error().message;
    if (found.words.find(path.string()) == std::string::npos)
      found.wrong = "the words name no file: " + found.words;
    return found;
  }
  found.opened = true;
  const auto check = checkDatabase(*opened);
  if (check.ok()) {
    found.checked_ok = check->ok();
    if (!check->ok()) found.words = check->faults.front();
  } else {
    found.words = check.error().message;
  }
  for (std::uint64_t s = 0; s < kSessions; ++s) {
    for (std::uint64_t seq = 0; seq < kChunks;) {
      const auto around = SessionStore(*opened).readAround(idOf(s), seq, 8, SIZE_MAX);
      if (!around.ok()) {
        ++seq;
        continue;
      }
      for (const StoredChunk& chunk : around->chunks) {
        if (chunk.seq < kChunks && chunk.bytes == chunkFor(s, chunk.seq)) {
          ++found.readable;
        } else {
          found.wrong = "session " + std::to_string(s) + " gives another chunk " + std::to_string(chunk.seq);
        }
      }
      if (around->next_seq <= seq) break;
      seq = around->next_seq;
    }
  }
  if (found.readable > kSessions * kChunks) found.wrong = "more chunks than there are";
  if (found.readable < kSessions * kChunks && found.checked_ok)
    found.wrong = "the check finds nothing, and " + std::to_string(kSessions * kChunks - found.readable) +
                  " chunks are not readable";
  return found;
}

void flip(const fs::path& file, std::uint64_t offset, Random& random) {
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  stream.seekg(static_cast<std::streamoff>(offset));
  const int byte = stream.get();
  stream.seekp(static_cast<std::streamoff>(offset));
  stream.put(static_cast<char>(byte ^ (1 << random.below(8))));
}

/// The role of each page of a database: "header", "chunks leaf", "chunks overflow", "sessions leaf", …
std::map<std::string, std::vector<std::uint64_t>> pagesByUse(const fs::path& path) {
  std::map<std::string, std::vector<std::uint64_t>> pages;
  auto connection = TestDb::must(Connection::open(path, {}));
  auto rows = connection.prepare("SELECT pageno, name, pagetype FROM dbstat");
  for (;;) {
    const auto row = rows.step();
    if (!row.ok() || !*row) break;
    const std::uint64_t page = rows.natural(0);
    std::string name = rows.text(1);
    if (name.starts_with("sqlite_autoindex")) name = "index of " + name.substr(17, name.rfind('_') - 17);
    pages[page == 1 ? "header and schema" : name + " " + rows.text(2)].push_back(page);
  }
  return pages;
}

TEST(Corruption, aFlippedBitInAPageIsDetectedOrHarmless) {
  const std::uint64_t seed = seedOr(20261124);
  TestDb db;
  fill(db.writer, 0, kChunks);
  ASSERT_OK(db.writer.checkpointPassive());
  const auto pages = pagesByUse(db.path);
  { const Connection closed = std::move(db.writer); }
  fs::remove(db.path.string() + "-wal");
  Random random(seed);
  std::uint64_t all = 0, refused = 0, said = 0, readable = 0, opened = 0, started = 0;
  for (const auto& [use, numbers] : pages) {
    const bool holds_sessions = use.starts_with("chunks") || use.starts_with("index of chunks") ||
                                use.starts_with("sessions") || use.starts_with("header");
    const int tries =
        (longForm() ? 60 : 4) * (holds_sessions ? 2 : 1) / (use.find("chunks") == std::string::npos ? 2 : 1);
    std::uint64_t use_readable = 0, use_opened = 0;
    for (int i = 0; i < tries; ++i) {
      const TempFolder folder;
      const auto copy = folder.path() / "needlelab.db";
      fs::copy_file(db.path, copy);
      const std::uint64_t page = numbers[random.below(numbers.size())];
      // half of the time in the page header, where it does most harm
      const std::uint64_t within = random.chance(0.5) ? random.below(100) : random.below(4096);
      flip(copy, (page - 1) * 4096 + within, random);
      const Found found = look(copy);
      ++all;
      refused += found.opened ? 0 : 1;
      said += found.opened && !found.checked_ok ? 1 : 0;
      EXPECT_EQ(found.wrong, "") << use << ", page " << page << ", byte " << within << ", seed " << seed
                                 << ": " << found.words;
      // a server starts on it, or reports why not
      Store::Options options;
      const auto store = Store::open(folder.path(), options);
      started += store.ok() ? 1 : 0;
      if (!store.ok()) {
        EXPECT_NE(store.error().message.find(copy.string()), std::string::npos) << store.error().message;
      }
      if (!found.opened) continue;
      ++use_opened;
      use_readable += found.readable;
    }
    opened += use_opened;
    readable += use_readable;
    if (holds_sessions && use_opened > 0)
      std::printf(
          "  %-28s %3d flips, opened after %llu, of the chunks readable then: %.1f %%\n", use.c_str(), tries,
          static_cast<unsigned long long>(use_opened),
          100.0 * static_cast<double>(use_readable) / static_cast<double>(use_opened * kSessions * kChunks));
  }
  std::printf(
      "pages: %llu flips, %llu refused in words, %llu found by the check, the others harmless; a server "
      "starts on %llu\n",
      static_cast<unsigned long long>(all), static_cast<unsigned long long>(refused),
      static_cast<unsigned long long>(said), static_cast<unsigned long long>(started));
  EXPECT_TRUE(pages.contains("chunks overflow")) << "no chunk is longer than a page";
  EXPECT_GT(said, all / 10);
  EXPECT_GT(static_cast<double>(readable), 0.5 * static_cast<double>(opened * kSessions * kChunks));
}

TEST(Corruption, aFlippedBitInTheWalGivesAnEarlierUsableState) {
  const std::uint64_t seed = seedOr(20261125);
  TestDb db;
  fill(db.writer, 0, 10);
  ASSERT_OK(db.writer.checkpointPassive());
  fill(db.writer, 10, kChunks);  // in the log only
  Random random(seed);
  std::uint64_t earlier = 0;
  const int tries = longForm() ? 300 : 15;
  for (int i = 0; i < tries; ++i) {
    const TempFolder folder;
    const auto copy = folder.path() / "needlelab.db";
    fs::copy_file(db.path, copy);
    fs::copy_file(db.path.string() + "-wal", copy.string() + "-wal");
    flip(copy.string() + "-wal", random.below(fs::file_size(copy.string() + "-wal")), random);
    auto opened = Connection::open(copy, {.mode = Connection::Mode::kWriter});
    ASSERT_OK(opened);
    const auto check = checkDatabase(*opened);
    ASSERT_OK(check);
    EXPECT_TRUE(check->ok()) << check->faults.front();
    SessionStore store(*opened);
    for (std::uint64_t s = 0; s < kSessions; ++s) {
      const auto next = store.nextSeq(idOf(s));
      ASSERT_OK(next);
      EXPECT_GE(*next, 10u);
      const auto chunks = store.readChunks(idOf(s), 0, UINT32_MAX, SIZE_MAX);
      ASSERT_OK(chunks);
      for (const StoredChunk& chunk : *chunks) EXPECT_EQ(chunk.bytes, chunkFor(s, chunk.seq));
      earlier += *next < kChunks ? 1 : 0;
      // the station's spool has the rest
      for (std::uint64_t seq = *next; seq < kChunks; ++seq)
        ASSERT_OK(store.append(idOf(s), seq, chunkFor(s, seq)));
    }
    EXPECT_EQ(look(copy).readable, kSessions * kChunks);
  }
  EXPECT_GT(earlier, 0u) << "no flip hit a frame that counts";
}

}  // namespace
}  // namespace needlelab::test
