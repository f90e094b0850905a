/// People of many lengths of name in random order, some of whom are deleted: pages are parted and joined, and
/// keep copies of rows that moved.
#pragma once

#include <fmt/core.h>

#include <cstdint>
#include <filesystem>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {

class MovedRows {
 public:
  static constexpr std::uint64_t kPeople = 2000;
  /// Adds them, renames many, and deletes every fifth.
  void fill(Connection& writer) {
    std::vector<std::uint64_t> order(kPeople);
    std::iota(order.begin(), order.end(), 0u);
    for (std::size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[random(i + 1)]);
    auto transaction = Transaction::begin(writer, Transaction::Kind::kWrite);
    ASSERT_OK(transaction);
    for (const std::uint64_t i : order)
      ASSERT_OK(
          writer.run("INSERT INTO people (name, folded, role, created_unix_ns, full_name, changed_unix_ns)"
                     " VALUES (?1, ?1, 1, 1, ?2, 1)",
                     nameOf(i), fullNameOf(i)));
    for (std::uint64_t k = 0; k < kPeople; ++k) {
      const std::uint64_t i = random(kPeople);
      ASSERT_OK(writer.run("UPDATE people SET full_name = ? WHERE name = ?", fullNameOf(i), nameOf(i)));
    }
    for (std::uint64_t i = 0; i < kPeople; i += 5)
      ASSERT_OK(writer.run("DELETE FROM people WHERE name = ?", nameOf(i)));
    ASSERT_OK(transaction->commit());
  }
  /// How many of the deleted people's names stand in the file.
  static std::size_t leftIn(const std::filesystem::path& file) {
    const auto bytes = readWholeFile(file);
    EXPECT_OK(bytes);
    std::size_t found = 0;
    for (std::uint64_t i = 0; i < kPeople; i += 5)
      found += bytes->find(nameOf(i)) != std::string::npos ? 1 : 0;
    return found;
  }

 private:
  static std::string nameOf(std::uint64_t i) { return fmt::format("zq{:08x}", 0x51ab0000u + i * 7919); }
  std::string fullNameOf(std::uint64_t i) { return "F" + nameOf(i) + " " + std::string(random(700), 'x'); }
  std::uint64_t random(std::uint64_t below) {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return (state_ >> 33) % below;
  }
  std::uint64_t state_ = 1;
};

}  // namespace needlelab::test
