#include "common/profile/aid_list.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

using Aid = pb::Exercise::Aid;

bool isAid(int number) {
  return number != pb::Exercise::AID_UNSPECIFIED && pb::Exercise::Aid_IsValid(number);
}

AidList allAids() {
  AidList all;
  for (int number = pb::Exercise::Aid_MIN; number <= pb::Exercise::Aid_MAX; ++number)
    if (isAid(number)) all.Add(number);
  return all;
}

/// Returns `text` trimmed and in capitals.
std::string aidWord(std::string_view text) {
  std::string word;
  for (const char c : text)
    if (c != ' ' && c != '\t') word += upperCase(c);
  return word;
}

}  // namespace

Status checkAids(const std::string& path, const AidList& aids) {
  for (int i = 0; i < aids.size(); ++i) {
    const std::string at = fmt::format("{}[{}]: ", path, i);
    if (!isAid(aids.Get(i)))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{}{} is not an aid; allowed are {}", at, aids.Get(i), aidsText(allAids()))};
    // a list that is valid so far is no longer than the list of all aids
    if (std::find(aids.begin(), aids.begin() + i, aids.Get(i)) != aids.begin() + i)
      return Error{ErrorCode::kInvalidInput,
                   at + pb::Exercise::Aid_Name(static_cast<Aid>(aids.Get(i))) + " is listed twice"};
  }
  return {};
}

AidList usualAids() {
  AidList usual;
  for (const int aid : allAids())
    if (aid != pb::Exercise::ULTRASOUND && aid != pb::Exercise::STEPS) usual.Add(aid);
  return usual;
}

AidList aidsOfExercise(const pb::Exercise& exercise) {
  return exercise.has_aids() ? exercise.aids().allowed() : usualAids();
}

bool hasAid(const AidList& aids, Aid aid) {
  return std::find(aids.begin(), aids.end(), static_cast<int>(aid)) != aids.end();
}

std::string aidsText(const AidList& aids) {
  std::string text;
  for (const int aid : aids) {
    const std::string name = isAid(aid) ? pb::Exercise::Aid_Name(static_cast<Aid>(aid)) : std::to_string(aid);
    text += (text.empty() ? "" : ", ") + name;
  }
  return text.empty() ? "none" : text;
}

Result<AidList> parseAids(std::string_view text) {
  const std::string whole = aidWord(text);
  if (whole == "NONE") return AidList();
  if (whole == "ALL") return allAids();
  AidList aids;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    const std::string word = aidWord(text.substr(from, comma - from));
    from = comma + 1;
    Aid aid{};
    if (!pb::Exercise::Aid_Parse(word, &aid) || !isAid(aid))
      return Error{ErrorCode::kInvalidInput, "'" + printable(word) + "' is not an aid; allowed are " +
                                                 aidsText(allAids()) + ", or none, or all"};
    aids.Add(aid);
  }
  RETURN_IF_ERROR(checkAids("aids", aids));
  return aids;
}

}  // namespace needlelab
