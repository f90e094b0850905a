#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

TEST(AsciiDigits, areThoseOfAnyScriptAndTheRestStays) {
  EXPECT_EQ(asciiDigits("٤٧١٢٢١"), "471221");
  EXPECT_EQ(asciiDigits("۴۷ ४७ ４７"), "47 47 47");
  EXPECT_EQ(asciiDigits("é-7ab²"), "é-7ab²");
  EXPECT_EQ(asciiDigits("\xd9"), "\xd9") << "half a character";
}

TEST(Text, charactersAreCountedNotBytes) {
  const std::pair<std::string_view, std::size_t> counts[] = {
      {"", 0}, {"force", 5}, {"\u00b5m", 2}, {"N\u00b7m", 3}, {"\u2264 4 \u20ac", 5}, {"\U0001f489", 1}};
  for (const auto& [text, characters] : counts) EXPECT_EQ(countCharacters(text), characters) << text;
}

TEST(Text, utf8IsDistinguishedFromOtherBytes) {
  for (const std::string_view good : {"", "abc", "é", "漢字", "🙂", "\x7f", "\xf4\x8f\xbf\xbf"})
    EXPECT_TRUE(isUtf8(good)) << good;
  const std::string bad[] = {"\x80",         "\xc3",         "\xc0\x80",          "\xc1\xbf",
                             "\xe0\x80\x80", "\xed\xa0\x80", "\xf5\x80\x80\x80",  "\xf4\x90\x80\x80",
                             "\xe2\x82",     "\xff",         std::string(1, '\0')};
  for (const std::string& text : bad) EXPECT_FALSE(isUtf8(text));
}

TEST(NaturalOrder, takesDigitsAsNumbersAndLettersOfEitherCaseAlike) {
  const std::vector<std::string> sorted = {
      "",          "bench",      "Room 2 b",    "room 2 c",    "room 10", "station-1",
      "station-2", "Station-10", "station-010", "station-10a", "zoë"};
  for (std::size_t i = 0; i < sorted.size(); ++i)
    for (std::size_t k = 0; k < sorted.size(); ++k)
      EXPECT_EQ(beforeNaturally(sorted[i], sorted[k]), i < k) << sorted[i] << " and " << sorted[k];
}

TEST(AsciiLetters, changeTheirCaseAndNoOtherByteDoes) {
  EXPECT_EQ(lowerCase("CARTILAGE_2 Äß@[`{"), "cartilage_2 Äß@[`{");
  EXPECT_EQ(lowerCase(""), "");
  EXPECT_EQ(wordsOfName("ENHANCED_TRACKING_WALL"), "enhanced tracking wall");
  for (int byte = 0; byte < 256; ++byte) {
    const char c = static_cast<char>(byte);
    const bool capital = byte >= 65 && byte <= 90, small = byte >= 97 && byte <= 122;
    EXPECT_EQ(lowerCase(c), static_cast<char>(capital ? byte + 32 : byte)) << byte;
    EXPECT_EQ(upperCase(c), static_cast<char>(small ? byte - 32 : byte)) << byte;
    EXPECT_EQ(isLetterOrDigit(c), capital || small || (byte >= 48 && byte <= 57)) << byte;
  }
}

TEST(HexDigit, isReadInEitherCaseAndRefusesAllElse) {
  const std::string_view small = "0123456789abcdef", capital = "0123456789ABCDEF";
  for (int byte = 0; byte < 256; ++byte) {
    const char c = static_cast<char>(byte);
    const std::size_t value = std::min(small.find(c), capital.find(c));
    EXPECT_EQ(hexDigit(c), value == std::string_view::npos ? -1 : static_cast<int>(value)) << byte;
  }
}

TEST(FixedText, whatRoundsToZeroHasNoSign) {
  struct Row {
    double value;
    int decimals;
    const char *minus, *both;
  };
  for (const Row& row :
       {Row{-0.004, 2, "0.00", "0.00"}, Row{0.004, 2, "0.00", "0.00"}, Row{-0.0, 0, "0", "0"},
        Row{-0.006, 2, "-0.01", "-0.01"}, Row{0.006, 2, "0.01", "+0.01"}, Row{-0.4, 0, "0", "0"},
        Row{-10, 0, "-10", "-10"}, Row{3, 1, "3.0", "+3.0"}}) {
    EXPECT_EQ(fixedText(row.value, row.decimals), row.minus);
    EXPECT_EQ(fixedText(row.value, row.decimals, Sign::kBoth), row.both);
  }
}

TEST(Text, namesHaveLengthAndNoControlCharacters) {
  EXPECT_TRUE(checkName("name", "Anna-Lena Müller").ok());
  EXPECT_TRUE(checkName("name", "10 \u00b5m, caf\u00e9").ok());  // U+00A0 and above are letters and signs
  EXPECT_TRUE(checkName("name", std::string(kMaxNameBytes, 'x')).ok());
  for (const std::string& bad : {std::string(), std::string(kMaxNameBytes + 1, 'x'), std::string("a\tb"),
                                 std::string("a\x7f"), std::string("a\xc2\x9b[2J"), std::string("a\xc2\x80"),
                                 std::string(" a"), std::string("a "), std::string("\x80")}) {
    const auto refused = checkName("the field", bad);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_EQ(refused.error().message.rfind("the field: ", 0), 0u);
  }
}

TEST(Text, newNamesFitIntoAddressesOfTheWeb) {
  for (const std::string_view good : {"Anna-Lena Müller", "a.b", "...", "a\\b", "50 %", "x"})
    EXPECT_TRUE(checkNewName("name", good).ok()) << good;
  for (const std::string_view bad : {"a/b", "/", "//a", "b/", ".", ".."}) {
    EXPECT_TRUE(checkName("name", bad).ok()) << bad << " may be there already";
    const auto refused = checkNewName("the field", bad);
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_EQ(refused.error().message.rfind("the field: ", 0), 0u);
  }
  EXPECT_FALSE(checkNewName("name", " a").ok()) << "an invalid name is not a new one";
}

TEST(Text, aControlCharacterIsNamed) {
  EXPECT_EQ(checkText("note", "a\x1b[2J", 0, 9).error().message, "note: holds a control character (U+001B)");
  EXPECT_EQ(checkText("note", "a\xc2\x9b", 0, 9).error().message, "note: holds a control character (U+009B)");
  EXPECT_EQ(checkText("note", "\x7f", 0, 9).error().message, "note: holds a control character (U+007F)");
}

TEST(Text, newTextContainsNoInvisibleCharacters) {
  struct Row {
    const char *text, *character;
    int byte;  // position of the character, from 1
  };
  for (const Row& row : {
           Row{"Tom \u202eegroeG", "U+202E (right-to-left override)", 5},
           Row{"\u202aTom", "U+202A (left-to-right embedding)", 1},
           Row{"To\u202cm", "U+202C (pop directional formatting)", 3},
           Row{"To\u2066m", "U+2066 (left-to-right isolate)", 3},
           Row{"To\u2069m", "U+2069 (pop directional isolate)", 3},
           Row{"Tom\u200e", "U+200E (left-to-right mark)", 4},
           Row{"אברהם\u200f", "U+200F (right-to-left mark)", 11},
           Row{"\u061cTom", "U+061C (Arabic letter mark)", 1},
           Row{"To\u200bm", "U+200B (zero width space)", 3},
           Row{"T\u00adom", "U+00AD (soft hyphen)", 2},
           Row{"To\u200cm", "U+200C (zero width non-joiner)", 3},
           Row{"To\u200dm", "U+200D (zero width joiner)", 3},
           Row{"علی\u200d", "U+200D (zero width joiner)", 7},
           Row{"علی\u200c\u200cرضا", "U+200C (zero width non-joiner)", 7},
           Row{"\ufeffTom", "U+FEFF (zero width no-break space)", 1},
           Row{"Tom\u2028", "U+2028 (line separator)", 4},
           Row{"\xf3\xa0\x81\x81", "U+E0041 (tag)", 1},
       }) {
    EXPECT_TRUE(checkText("full_name", row.text, 0, 200).ok()) << row.character << " may be there already";
    for (const Status& refused :
         {checkVisible("full_name", row.text), checkNewText("full_name", row.text, 0, 200),
          checkNewName("full_name", row.text)}) {
      ASSERT_FALSE(refused.ok()) << row.character;
      EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
      EXPECT_EQ(refused.error().message,
                "full_name: contains the invisible character " + std::string(row.character) + " at byte " +
                    std::to_string(row.byte) +
                    ", which can make a name look like another: type it again without that character");
    }
  }
}

TEST(Text, namesOfAllScriptsAreNames) {
  for (const char* name : {"Zoë Müller", "אברהם בן־דוד", "محمد رضا", "علی\u200cرضا", "क्\u200dष", "ދިވެހި",
                           "Nguyễn Văn", "李小龍", "Владимир", "O’Neill"}) {
    EXPECT_TRUE(checkNewText("full_name", name, 1, 200).ok()) << name;
    EXPECT_TRUE(checkNewName("name", name).ok()) << name;
    EXPECT_EQ(showHidden(name), name);
    EXPECT_EQ(printable(name), name);
  }
}

TEST(Text, hiddenCharactersFromBeforeAreWrittenOut) {
  EXPECT_EQ(showHidden("Tom \u202eegroeG\u202c!"), "Tom [U+202E]egroeG[U+202C]!");
  EXPECT_EQ(printable("a\u200b\x1b\u2066"), "a[U+200B]?[U+2066]");
  EXPECT_EQ(showHidden("\xf3\xa0\x81\x81"), "[U+E0041]");
  EXPECT_EQ(showHidden("\xff\u202e"), "\xff\u202e") << "no UTF-8 stays as it is";
  EXPECT_EQ(printable("\xff\u202e"), "????");
  EXPECT_EQ(showHidden(""), "");
}

TEST(Text, notesMayHaveLines) {
  EXPECT_TRUE(checkNote("text", "one\ntwo\tthree\r\n", 1, 100).ok());
  EXPECT_FALSE(checkNote("text", std::string("a\0b", 3), 1, 100).ok());
  EXPECT_FALSE(checkNote("text", "\x1b[2J", 1, 100).ok());
}

TEST(Text, aCodeIs4To64PrintableAsciiCharactersNeverQuoted) {
  for (const std::string& code : {std::string("0815"), std::string("badge 7/b~"), std::string(64, '~')})
    EXPECT_TRUE(checkCode(code).ok()) << code;
  for (const std::string& code : {std::string(), std::string("123"), std::string(65, '7'),
                                  std::string("12\t4"), std::string("12\x7f") + "45", std::string("übel"),
                                  std::string("12\0"
                                              "45",
                                              5)}) {
    const Status refused = checkCode(code);
    ASSERT_FALSE(refused.ok()) << code;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_EQ(refused.error().message.rfind("code: ", 0), 0u) << refused.error().message;
    EXPECT_NE(refused.error().message.find("4 to 64"), std::string::npos) << refused.error().message;
    if (code.size() > 3) {
      EXPECT_EQ(refused.error().message.find(code), std::string::npos);
    }
  }
}

TEST(Columns, breaksAtBlanksAndCountsCharactersNotBytes) {
  EXPECT_EQ(wrapped("ab cd ef", 2, 7), "  ab cd\n  ef\n");
  EXPECT_EQ(wrapped("abcdefghij k", 0, 4), "abcdefghij\nk\n");
  EXPECT_EQ(wrapped("", 3, 10), "");
  EXPECT_EQ(padded("µ", 3), "µ  ");
}

/// The definition itself: the minimum over the last edit, without a table. For short ASCII texts.
std::size_t distanceByDefinition(std::string_view a, std::string_view b) {
  if (a.empty() || b.empty()) return a.size() + b.size();
  const std::string_view a1 = a.substr(1), b1 = b.substr(1);
  std::size_t least = std::min(distanceByDefinition(a1, b), distanceByDefinition(a, b1)) + 1;
  least = std::min(least, distanceByDefinition(a1, b1) + (a[0] == b[0] ? 0 : 1));
  if (a.size() > 1 && b.size() > 1 && a[0] == b[1] && a[1] == b[0])
    least = std::min(least, distanceByDefinition(a.substr(2), b.substr(2)) + 1);
  return least;
}

TEST(EditDistance, isThatOfItsDefinition) {
  std::mt19937 random(17);
  const auto text = [&] {
    std::string made;
    for (std::size_t i = random() % 6; i > 0; --i) made += "abc"[random() % 3];
    return made;
  };
  std::map<std::size_t, int> seen;
  for (int i = 0; i < 2000; ++i) {
    const std::string a = text(), b = text();
    const std::size_t expected = distanceByDefinition(a, b);
    EXPECT_EQ(editDistance(a, b, 10), expected) << a << " " << b;
    ++seen[expected];
    if (expected == 0) continue;
    EXPECT_EQ(editDistance(a, b, expected - 1), std::nullopt) << a << " " << b;
  }
  EXPECT_GE(seen.size(), 5u);
}

TEST(EditDistance, countsCharactersAndNotBytesOrCapitals) {
  EXPECT_EQ(editDistance("zoë", "zoe", 3), 1u);
  EXPECT_EQ(editDistance("zoë", "ozë", 3), 1u);
  EXPECT_EQ(editDistance("€", "", 3), 1u);
  EXPECT_EQ(editDistance("TOM", "tom", 0), 0u);
}

TEST(EditDistance, longTextsHaveNone) {
  const std::string longest(kMaxComparedBytes, 'a');
  EXPECT_EQ(editDistance(longest, longest, 1), 0u);
  EXPECT_EQ(editDistance(longest + "a", longest + "a", 1), std::nullopt);
  EXPECT_EQ(editDistance("", longest + "a", 1000), std::nullopt);
}

TEST(NearNames, theNearestComeFirst) {
  const std::vector<KnownName> known = {
      {"tim", ""}, {"tom", "Tom Smith"}, {"anna.bauer", "Anna Bauer"}, {"ben", "Benedikt Tmo"}, {"zoe", ""}};
  const auto names = [&](std::string_view typed, std::size_t count = 3) {
    std::vector<std::string> found;
    for (const KnownName& person : nearNames(typed, known, count)) found.push_back(person.name);
    return found;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names("tmo"), Names{"tom"}) << "a swap is one edit; tim is two";
  EXPECT_EQ(names("tam"), (Names{"tim", "tom"})) << "equally near: by name";
  EXPECT_EQ(names("tam", 1), Names{"tim"});
  EXPECT_EQ(names("TOM"), (Names{"tom", "tim"}));
  EXPECT_EQ(names("anna.baur"), Names{"anna.bauer"});
  EXPECT_EQ(names("anna bauer"), Names{"anna.bauer"}) << "the full name, typed in the name's place";
  EXPECT_EQ(names("quite another"), Names{});
  EXPECT_EQ(names(std::string(1000, 't')), Names{});
  EXPECT_TRUE(nearNames("tom", {}).empty());
}

}  // namespace
}  // namespace needlelab
