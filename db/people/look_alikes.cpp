#include "db/people/look_alikes.h"

#include <fmt/core.h>

#include <array>
#include <cstddef>

#include "common/base/text/text.h"
#include "db/people/person_name.h"

namespace needlelab {
namespace {

struct ThingKind {
  std::string_view word, select;  ///< all ids and titles
};
/// By Thing.
constexpr std::array<ThingKind, 5> kThings = {{
    {"group", "SELECT id, name FROM groups WHERE removed = 0 ORDER BY id"},
    {"station", "SELECT name, name FROM stations ORDER BY name"},
    {"profile",
     "SELECT id, name FROM profiles AS p WHERE revision = (SELECT max(revision) FROM profiles WHERE id = p.id)"
     " ORDER BY id"},
    {"course",
     "SELECT id, name FROM curricula AS c WHERE revision = (SELECT max(revision) FROM curricula WHERE id = c.id)"
     " ORDER BY id"},
    {"exercise", "SELECT id, name FROM exercises ORDER BY id"},
}};

const ThingKind& kindOf(Thing thing) {
  return kThings[static_cast<std::size_t>(thing)];
}

std::string keyOf(std::string_view name) {
  return nameKey(trimmedName(name));
}

}  // namespace

Result<ThingNames> ThingNames::read(Connection& connection, Thing thing) {
  ThingNames names(thing);
  ASSIGN_OR_RETURN(const auto all,
                   connection.prepare(std::string(kindOf(thing).select)).all([](const Statement& row) {
                     return std::pair(row.text(0), row.text(1));
                   }));
  for (const auto& [id, title] : all) names.ids_.emplace(keyOf(id), id);
  for (const auto& [id, title] : all) names.add(id, title);
  return names;
}

void ThingNames::add(std::string_view id, std::string_view title) {
  titles_.emplace(id, title);
  for (const std::string_view name : {id, title}) ids_.emplace(keyOf(name), id);
}

std::string ThingNames::question(std::string_view typed) const {
  if (has(typed)) return {};
  const auto there = ids_.find(keyOf(typed));
  if (there == ids_.end()) return {};
  const std::string& id = there->second;
  const std::string& title = titles_.find(id)->second;
  return fmt::format("'{}' looks like the {} '{}'{}: use it? Then write '{}', else take another name",
                     printable(typed), kindOf(thing_).word, printable(id),
                     title == id ? "" : " (" + printable(title) + ")", printable(id));
}

Status ThingNames::require(std::string_view id) const {
  if (has(id)) return {};
  const std::string asked = question(id);
  return Error{ErrorCode::kNotFound, fmt::format("there is no {} '{}'{}{}", kindOf(thing_).word,
                                                 printable(id), asked.empty() ? "" : "; ", asked)};
}

Status ThingNames::checkNew(std::string_view id, std::string_view title) const {
  if (!has(id) && trimmedName(id) != id)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{} '{}': begins or ends with a space", kindOf(thing_).word, printable(id))};
  if (std::string asked = question(id); !asked.empty())
    return Error{ErrorCode::kAlreadyExists, std::move(asked)};
  const std::string key = keyOf(title);
  for (const auto& [other, its_title] : titles_)
    if (other != id && its_title != title && keyOf(its_title) == key)
      return Error{
          ErrorCode::kAlreadyExists,
          fmt::format("name: '{}' looks like '{}', the name of the {} '{}': use that one, or write '{}' "
                      "here, too, or take another name",
                      printable(title), printable(its_title), kindOf(thing_).word, printable(other),
                      printable(its_title))};
  return {};
}

Status checkNewNames(Connection& connection, Thing thing, std::string_view id, std::string_view title) {
  ASSIGN_OR_RETURN(const auto names, ThingNames::read(connection, thing));
  return names.checkNew(id, title);
}

Status checkSpelling(Connection& connection, Thing thing, std::string_view id) {
  ASSIGN_OR_RETURN(const auto names, ThingNames::read(connection, thing));
  return names.question(id).empty() ? Status() : names.require(id);
}

Status requireThing(Connection& connection, Thing thing, std::string_view id) {
  ASSIGN_OR_RETURN(const auto names, ThingNames::read(connection, thing));
  return names.require(id);
}

}  // namespace needlelab
