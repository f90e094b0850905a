#include "db/session_words.h"

#include <utility>
#include <vector>

#include "common/base/text.h"

namespace needlelab {
namespace {

ErasedNames withoutOthers(ErasedNames names) {
  names.others = {};
  return names;
}

}  // namespace

void clearStationWords(pb::SessionDescription& description) {
  pb::SessionDescription needed;
  needed.set_session_id(description.session_id());
  needed.set_station(description.station());
  needed.set_trainee(description.trainee());
  needed.set_exercise_id(description.exercise_id());
  needed.set_profile_id(description.profile_id());
  needed.set_profile_revision(description.profile_revision());
  needed.set_engine_version(description.engine_version());
  needed.set_rate_hz(description.rate_hz());
  if (description.has_resolution()) *needed.mutable_resolution() = description.resolution();
  needed.set_started_unix_ns(description.started_unix_ns());
  needed.set_started_steady_ns(description.started_steady_ns());
  needed.DiscardUnknownFields();  // those of the resolution
  description = std::move(needed);
}

ErasedDescriptions::ErasedDescriptions(Connection& connection, ErasedNames names, Names known)
    : connection_(connection),
      names_(withoutOthers(std::move(names))),
      search_(names_),
      some_gone_(known == Names::kSomeGone) {}

std::string ErasedDescriptions::without(const std::string& text) const {
  if (!search_.finds(text)) return text;
  std::string replaced = withoutNames(text, names_, true);
  return replaced.size() > kMaxNameBytes || search_.finds(replaced) ? names_.in_its_place : replaced;
}

Result<bool> ErasedDescriptions::isStored(const std::string& id) {
  auto row = connection_.query(
      "SELECT 1 FROM profiles WHERE id = ?1 UNION ALL SELECT 1 FROM curricula WHERE id = ?1"
      " UNION ALL SELECT 1 FROM exercises WHERE id = ?1 LIMIT 1",
      id);
  return row.step();
}

Status ErasedDescriptions::erase(pb::SessionDescription& description) {
  clearStationWords(description);
  description.set_trainee(names_.in_its_place);
  const std::string& version = description.engine_version();
  const bool is_number = version.find_first_not_of("0123456789.") == std::string::npos;
  description.set_engine_version(some_gone_ && !is_number ? names_.in_its_place : without(version));
  for (std::string* id : {description.mutable_exercise_id(), description.mutable_profile_id()}) {
    std::string replaced = some_gone_ && !id->empty() ? names_.in_its_place : without(*id);
    if (replaced == *id) continue;
    ASSIGN_OR_RETURN(const bool stays, isStored(*id));
    if (!stays) *id = std::move(replaced);
  }
  return {};
}

std::string wordsOf(pb::SessionDescription description) {
  description.clear_session_id();
  description.clear_station();
  description.clear_trainee();
  std::string words;
  const auto add = [&](const std::string& text) { words.append(text) += '\n'; };
  const auto* const reflection = description.GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection->ListFields(description, &fields);
  for (const auto* const field : fields) {
    if (field->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_STRING) continue;
    if (!field->is_repeated()) {
      add(reflection->GetString(description, field));
      continue;
    }
    for (int i = 0; i < reflection->FieldSize(description, field); ++i)
      add(reflection->GetRepeatedString(description, field, i));
  }
  const std::string bytes = description.SerializeAsString();
  description.DiscardUnknownFields();
  if (description.ByteSizeLong() != bytes.size()) add(bytes);
  return words;
}

}  // namespace needlelab
