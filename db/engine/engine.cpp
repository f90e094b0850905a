#include "db/engine/engine.h"

#include <fmt/core.h>

namespace needlelab {

std::string_view durabilityText(Durability durability) {
  switch (durability) {
    case Durability::kNothing:
      return "nothing";
    case Durability::kProcess:
      return "the end of a program";
    case Durability::kPowerCut:
      return "a power cut";
    case Durability::kDiskLoss:
      return "the loss of a disk";
  }
  return "nothing";
}

std::string PostgresSettings::text() const {
  return fmt::format(
      "fsync = {}, full_page_writes = {}, synchronous_commit = {}, synchronous_standby_names = '{}'", fsync,
      full_page_writes, synchronous_commit, synchronous_standby_names);
}

Durability durabilityOf(const PostgresSettings& settings) {
  const std::string& commit = settings.synchronous_commit;
  if (commit != "on" && commit != "remote_apply" && commit != "remote_write" && commit != "local")
    return Durability::kNothing;
  // without full-page copies in the log, torn pages cannot be repaired after a power cut
  if (settings.fsync != "on" || settings.full_page_writes != "on") return Durability::kProcess;
  const std::string& names = settings.synchronous_standby_names;
  const bool named =
      names.find_first_not_of(' ') != std::string::npos && names.find('*') == std::string::npos;
  if (!named || commit == "local" || commit == "remote_write") return Durability::kPowerCut;
  return Durability::kDiskLoss;
}

}  // namespace needlelab
