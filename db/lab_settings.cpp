#include "db/lab_settings.h"

#include "db/schema.h"

namespace needlelab {

Result<bool> LabSettingsStore::codesRequired() {
  ASSIGN_OR_RETURN(const auto value, MetaStore(connection_).get(kCodesRequiredKey));
  return value == "1";
}

Status LabSettingsStore::setCodesRequired(bool required) {
  return MetaStore(connection_).set(kCodesRequiredKey, required ? "1" : "0");
}

}  // namespace needlelab
