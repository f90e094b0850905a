#include "db/service/records/mentions.h"

#include <fmt/core.h>
#include <utf8proc.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"
#include "db/people/people.h"
#include "db/people/person_name.h"
#include "db/people/person_refs.h"
#include "db/sessions/session_rows.h"

namespace needlelab {
namespace {

constexpr std::string_view kRemoved = "[name removed]";
constexpr std::size_t kTextAround_bytes = 60;

struct Word {
  std::size_t first = 0, behind = 0;  ///< byte range in the text
  std::string key;
};

/// Whether a word may contain this character: letters, marks and numbers.
bool isNameCharacter(utf8proc_int32_t c) {
  if (c < 0) return false;
  const auto category = utf8proc_category(c);
  return category >= UTF8PROC_CATEGORY_LU && category <= UTF8PROC_CATEGORY_NO;
}

std::vector<Word> wordsOf(std::string_view text) {
  std::vector<Word> words;
  std::optional<std::size_t> first;
  const auto end = [&](std::size_t behind) {
    if (first) words.push_back({*first, behind, nameKey(text.substr(*first, behind - *first))});
    first.reset();
  };
  for (std::size_t at = 0; at < text.size();) {
    utf8proc_int32_t c = -1;
    const auto bytes = utf8proc_iterate(reinterpret_cast<const utf8proc_uint8_t*>(text.data()) + at,
                                        static_cast<utf8proc_ssize_t>(text.size() - at), &c);
    if (bytes > 0 && isNameCharacter(c)) {
      if (!first) first = at;
    } else {
      end(at);
    }
    at += static_cast<std::size_t>(std::max<utf8proc_ssize_t>(bytes, 1));
  }
  end(text.size());
  return words;
}

/// A column with texts that people wrote.
struct FreeText {
  std::string_view kind;    ///< first word of pb::Mention::where; the second is the key
  std::string_view about;   ///< format of the label
  std::string_view link;    ///< format of the label
  std::string_view select;  ///< key, label and text
  std::string_view update;  ///< ?1 the text, ?2 the key
  /// The text is the JSON of a course or profile whose name is also in a column of its own (?3).
  bool document = false;
};

constexpr std::array kFreeTexts = {
    FreeText{"remark", "a remark on session {}", "#/sessions/{}",
             "SELECT CAST(a.id AS TEXT), s.id, a.text FROM annotations a JOIN sessions s ON s.number ="
             " a.session ORDER BY a.id",
             "UPDATE annotations SET text = ?1 WHERE CAST(id AS TEXT) = ?2"},
    FreeText{"group", "the name of group '{}'", "#/groups/{}", "SELECT id, id, name FROM groups ORDER BY id",
             "UPDATE groups SET name = ?1, revision = revision + 1 WHERE id = ?2"},
    FreeText{"course", "course '{}'", "#/courses/{}",
             "SELECT id || '/' || revision, id, json FROM curricula ORDER BY id, revision",
             "UPDATE curricula SET json = ?1, name = ?3 WHERE id || '/' || revision = ?2", true},
    FreeText{"exercise", "exercise '{}' as stations get it", "",
             "SELECT id, id, json FROM exercises ORDER BY id",
             "UPDATE exercises SET json = ?1, name = ?3 WHERE id = ?2", true},
    FreeText{"profile", "patient profile '{}'", "#/profiles/{}",
             "SELECT id || '/' || revision, id, json FROM profiles ORDER BY id, revision",
             "UPDATE profiles SET json = ?1, name = ?3 WHERE id || '/' || revision = ?2", true},
    FreeText{"consent", "a note on a consent", "",
             "SELECT CAST(id AS TEXT), '', note FROM consents ORDER BY id",
             "UPDATE consents SET note = ?1 WHERE CAST(id AS TEXT) = ?2"},
    FreeText{"erasure", "the reason of an erasure", "",
             "SELECT CAST(erased_unix_ns AS TEXT), '', reason FROM erasures ORDER BY erased_unix_ns",
             "UPDATE erasures SET reason = ?1 WHERE CAST(erased_unix_ns AS TEXT) = ?2"},
};

/// The titles and descriptions in the JSON of a course, an exercise or a profile.
std::vector<std::string> titlesIn(const nlohmann::json& document) {
  std::vector<std::string> titles;
  if (!document.is_object()) return titles;
  for (const char* const key : {"name", "description"})
    if (const auto at = document.find(key); at != document.end() && at->is_string())
      titles.push_back(at->get<std::string>());
  if (const auto at = document.find("exercises"); at != document.end() && at->is_array())
    for (const nlohmann::json& exercise : *at)
      for (std::string& title : titlesIn(exercise)) titles.push_back(std::move(title));
  return titles;
}

/// The text to search: of a document its titles, one per line.
std::string searchedText(const FreeText& free, const std::string& text) {
  if (!free.document) return text;
  std::string titles;
  for (const std::string& title : titlesIn(readShallowJson<nlohmann::json>(text))) titles += title + "\n";
  return titles;
}

/// The document with names removed from its titles; everything else is unchanged byte for byte.
std::string documentWithout(const Phrases& phrases, std::string text) {
  const auto literal = [](const std::string& title) { return ": " + nlohmann::json(title).dump(); };
  for (const std::string& title : titlesIn(readShallowJson<nlohmann::json>(text))) {
    const std::string before = literal(title), after = literal(phrases.without(title));
    if (before == after) continue;
    for (std::size_t at = text.find(before); at != std::string::npos;
         at = text.find(before, at + after.size()))
      text.replace(at, before.size(), after);
  }
  return text;
}

/// The part of `text` around a range, cut at character boundaries.
std::string partAround(std::string_view text, std::pair<std::size_t, std::size_t> place) {
  std::size_t first = place.first > kTextAround_bytes ? place.first - kTextAround_bytes : 0;
  std::size_t behind = std::min(text.size(), place.second + kTextAround_bytes);
  const auto isInside = [&](std::size_t at) {
    return at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80;
  };
  while (first > 0 && isInside(first)) --first;
  while (isInside(behind)) ++behind;
  return (first > 0 ? "…" : "") + printable(std::string(text.substr(first, behind - first))) +
         (behind < text.size() ? "…" : "");
}

}  // namespace

Phrases::Phrases(std::span<const std::string> texts) {
  for (const std::string& text : texts) {
    std::vector<std::string> keys;
    for (Word& word : wordsOf(text)) keys.push_back(std::move(word.key));
    if (!keys.empty()) phrases_.push_back(std::move(keys));
  }
  // prefer the longer of two phrases that begin at the same place
  std::stable_sort(phrases_.begin(), phrases_.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
}

std::vector<std::pair<std::size_t, std::size_t>> Phrases::placesIn(std::string_view text) const {
  std::vector<std::pair<std::size_t, std::size_t>> places;
  const std::vector<Word> words = wordsOf(text);
  for (std::size_t at = 0; at < words.size();) {
    const auto found = std::find_if(phrases_.begin(), phrases_.end(), [&](const auto& phrase) {
      return phrase.size() <= words.size() - at &&
             std::equal(phrase.begin(), phrase.end(), words.begin() + static_cast<std::ptrdiff_t>(at),
                        [](const std::string& key, const Word& word) { return key == word.key; });
    });
    const std::size_t taken = found == phrases_.end() ? 1 : found->size();
    if (found != phrases_.end()) places.emplace_back(words[at].first, words[at + taken - 1].behind);
    at += taken;
  }
  return places;
}

std::string Phrases::without(std::string_view text) const {
  std::string rest;
  std::size_t at = 0;
  for (const auto& [first, behind] : placesIn(text)) {
    rest += text.substr(at, first - at);
    rest += kRemoved;
    at = behind;
  }
  return rest.append(text.substr(at));
}

Result<pb::Mentions> MentionStore::find(const Phrases& phrases, std::size_t skipped, std::size_t most) {
  pb::Mentions mentions;
  std::size_t before = 0;
  for (const FreeText& free : kFreeTexts) {
    Statement rows = connection_.prepare(free.select);
    for (;;) {
      ASSIGN_OR_RETURN(const bool more, rows.step());
      if (!more) break;
      const std::string text = searchedText(free, rows.text(2));
      const auto places = phrases.placesIn(text);
      if (places.empty()) continue;
      if (before++ < skipped) continue;
      if (static_cast<std::size_t>(mentions.mentions_size()) == most) {
        mentions.set_next_page(std::to_string(skipped + most));
        return mentions;
      }
      const bool of_session = free.kind == "remark";
      const std::string label =
          of_session ? uuidText(uuidOf(textOf(rows.bytes(1))).value_or(Uuid{})) : rows.text(1);
      pb::Mention& mention = *mentions.add_mentions();
      mention.set_where(fmt::format("{} {}", free.kind, rows.text(0)));
      mention.set_about(fmt::format(fmt::runtime(free.about), printable(label)));
      mention.set_text(partAround(text, places.front()));
      mention.set_link(fmt::format(fmt::runtime(free.link), label));
      mention.set_times(static_cast<std::uint32_t>(places.size()));
    }
  }
  return mentions;
}

Result<std::size_t> MentionStore::redact(const Phrases& phrases, std::string_view where) {
  const std::string_view kind = where.substr(0, where.find(' '));
  const auto free = std::find_if(kFreeTexts.begin(), kFreeTexts.end(),
                                 [&](const FreeText& one) { return one.kind == kind; });
  if (free == kFreeTexts.end() || kind.size() + 1 >= where.size())
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("where: '{}' is not one of the listed texts, such as 'remark 12'",
                             printable(std::string(where)))};
  const std::string_view key = where.substr(kind.size() + 1);
  Statement rows = connection_.prepare(free->select);
  std::vector<std::string> texts;  // several erasures may have the same time
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    if (rows.text(0) == key) texts.push_back(rows.text(2));
  }
  if (texts.empty())
    return Error{ErrorCode::kNotFound,
                 fmt::format("there is no {}: list the texts again", printable(std::string(where)))};
  const std::string& text = texts.front();
  const std::size_t places = phrases.placesIn(searchedText(*free, text)).size();
  if (places == 0) return places;
  if (!free->document) {
    RETURN_IF_ERROR(connection_.run(free->update, phrases.without(text), key));
    return places;
  }
  const std::string rest = documentWithout(phrases, text);
  const auto document = readShallowJson<nlohmann::json>(rest);
  RETURN_IF_ERROR(connection_.run(free->update, rest, key, document.value("name", std::string())));
  return places;
}

}  // namespace needlelab
