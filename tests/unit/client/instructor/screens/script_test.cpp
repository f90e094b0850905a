#include "tests/windows/script/script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(Script, actionsLineByLine) {
  const auto script = parseScript(
      "# how a lesson is watched\n"
      "login\n"
      "\n"
      "  open station bench-1   # the first\r\n"
      "annotate \"slower, \\\"tina\\\" # not a remark\"\n"
      "seek 3.5",
      "tour");
  ASSERT_TRUE(script.ok()) << script.error().message;
  ASSERT_EQ(script->size(), 4u);
  EXPECT_EQ((*script)[0].verb, "login");
  EXPECT_EQ((*script)[0].line, 2u);
  EXPECT_THAT((*script)[1].words, ElementsAre("station", "bench-1"));
  EXPECT_EQ((*script)[1].line, 4u);
  EXPECT_THAT((*script)[2].words, ElementsAre("slower, \"tina\" # not a remark"));
  EXPECT_EQ((*script)[3].line, 6u);
  EXPECT_THAT(*parseScript("", "empty"), IsEmpty());
}

TEST(Script, faultsAreNamedByLine) {
  struct Row {
    const char* text;
    const char* message;
  };
  for (const Row& row :
       {Row{"login\nfly away\n", "tour:2: no such action: 'fly'"},
        Row{"seek", "tour:1: it is written: seek SECONDS"},
        Row{"\n\nseek now", "tour:3: 'now' is not a number"}, Row{"seek inf", "'inf' is not a number"},
        Row{"seek 3x", "'3x' is not a number"}, Row{"annotate \"open", "tour:1: a quote is not closed"},
        Row{"open bench-1 twice", "open station NAME"},
        Row{"compare a b sideways", "alignments are depth, dtw and time"}, Row{"loop 3", "loop FROM TO"},
        Row{"loop off 3", "'off' is not a number"}, Row{"latency soon", "'soon' is not a number"},
        Row{"wait-live", "it is written: wait-live N"}, Row{"wait-live on", "'on' is not a number"},
        Row{"wait-replay", "it is written: wait-replay SECONDS"},
        Row{"wait-replay on", "'on' is not a number"}, Row{"quit now", "it is written: quit"}}) {
    const auto script = parseScript(row.text, "tour");
    ASSERT_FALSE(script.ok()) << row.text;
    EXPECT_EQ(script.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(script.error().message, HasSubstr(row.message));
  }
  EXPECT_TRUE(parseScript("loop off\nloop 1 2\nlatency\nlatency 150", "tour").ok());
}

TEST(Script, eachVerbExistsOnceAndDescribesItsArguments) {
  std::set<std::string_view> verbs;
  for (const ScriptVerb& verb : scriptVerbs()) {
    EXPECT_TRUE(verbs.insert(verb.verb).second) << verb.verb;
    EXPECT_EQ(verb.usage.substr(0, verb.verb.size()), verb.verb);
    EXPECT_FALSE(verb.meaning.empty());
    EXPECT_LE(verb.least, verb.most);
  }
}

TEST(Script, anythingButText) {
  // No file content may crash the parser or be accepted.
  std::string bytes;
  for (int i = 0; i < 256; ++i) bytes += static_cast<char>(i);
  EXPECT_FALSE(parseScript(bytes, "bytes").ok());
  const test::TempFolder folder;
  EXPECT_FALSE(loadScript(folder.path() / "none").ok());
  EXPECT_EQ(loadScript(folder.write("one", "quit\n"))->size(), 1u);
}

}  // namespace
}  // namespace needlelab
