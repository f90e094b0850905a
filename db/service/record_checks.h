/// What the schema cannot say of a record that is read in. Private to this folder.
#pragma once

#include "common/base/result.h"
#include "db/service/record_tables.h"

namespace needlelab {

/// kInvalidInput, naming the field: every field has its column's type, every text is one, numbers are in
/// their ranges. Never throws.
Status checkFields(const RecordTable& table, const RecordJson& record);
/// The same of what the fields hold, before a record is stored: names, and what is read later as JSON or as a
/// message. After checkFields().
Status checkRecord(const RecordTable& table, const RecordJson& record);

}  // namespace needlelab
