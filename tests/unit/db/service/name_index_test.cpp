// Many words are found in a text at once, as a search for each of them finds them.
#include "db/service/name_index.h"

#include <gtest/gtest.h>

#include <random>

#include "common/base/text.h"
#include "tests/support/run_form.h"

namespace needlelab {
namespace {

using Found = std::map<std::string, std::set<std::string>>;

TEST(NameIndex, findsTheWordsOfEachPersonWhereverTheyStand) {
  NameIndex index;
  EXPECT_TRUE(index.in("anna").empty()) << "nobody";
  EXPECT_TRUE(index.add("Anna", "anna"));
  EXPECT_FALSE(index.add("anna", "anna")) << "the same word";
  EXPECT_TRUE(index.add("Anna Ohm", "anna"));
  EXPECT_TRUE(index.add("anna", "anna.ohm"));
  EXPECT_TRUE(index.add("Öst", "zoe"));
  EXPECT_FALSE(index.add("", "zoe"));
  EXPECT_EQ(index.in("said ANNA OHM"), (Found{{"anna", {"anna", "anna ohm"}}, {"anna.ohm", {"anna"}}}));
  EXPECT_EQ(index.in("Annabel of Östlund"),
            (Found{{"anna", {"anna"}}, {"anna.ohm", {"anna"}}, {"zoe", {lowerCase("Öst")}}}));
  EXPECT_TRUE(index.in("ann a").empty());
  EXPECT_TRUE(index.in("").empty());
  EXPECT_TRUE(index.add("n a", "tom")) << "also after a look";
  EXPECT_EQ(index.in("ann a"), (Found{{"tom", {"n a"}}}));
}

TEST(NameIndex, findsInRandomTextsWhatASearchForEachWordFinds) {
  const std::uint64_t seed = test::seedOr(std::random_device()());
  SCOPED_TRACE("NEEDLELAB_SEED=" + std::to_string(seed));
  std::mt19937_64 random(seed);
  const auto text = [&](std::size_t most) {
    std::string made(random() % most + 1, ' ');
    for (char& letter : made) letter = static_cast<char>('a' + random() % 3);
    return made;
  };
  for (int round = 0; round < 50; ++round) {
    NameIndex index;
    std::map<std::string, std::set<std::string>> words;
    for (int i = 0; i < 30; ++i) {
      const std::string word = text(6), person = std::to_string(random() % 5);
      EXPECT_EQ(index.add(word, person), words[person].insert(word).second);
    }
    for (int i = 0; i < 20; ++i) {
      const std::string read = text(40);
      Found expected;
      for (const auto& [person, own] : words)
        for (const std::string& word : own)
          if (read.find(word) != std::string::npos) expected[person].insert(word);
      EXPECT_EQ(index.in(read), expected) << read;
    }
  }
}

}  // namespace
}  // namespace needlelab
