#include "db/store/lab_settings.h"

#include "db/store/schema.h"

namespace needlelab {

Result<bool> LabSettingsStore::codesRequired() {
  return is(kCodesRequiredKey);
}
Status LabSettingsStore::setCodesRequired(bool required) {
  return set(kCodesRequiredKey, required);
}

Result<bool> LabSettingsStore::keepsRecordingsOfErased() {
  return is(kKeepErasedKey);
}
Status LabSettingsStore::setKeepsRecordingsOfErased(bool keeps) {
  return set(kKeepErasedKey, keeps);
}

Result<bool> LabSettingsStore::is(std::string_view key) {
  ASSIGN_OR_RETURN(const auto value, MetaStore(connection_).get(key));
  return value == "1";
}

Status LabSettingsStore::set(std::string_view key, bool value) {
  return MetaStore(connection_).set(key, value ? "1" : "0");
}

}  // namespace needlelab
