#include "tests/load/load_options.h"

#include "common/base/range.h"

namespace needlelab::test {
namespace {

Status within(const char* option, double value, double min, double max) {
  const NumberRange range{min, max};
  if (range.contains(value)) return {};
  return outOfRange(option, value, range);
}

Error invalid(const std::string& text) {
  return {ErrorCode::kInvalidInput, text};
}

}  // namespace

Status checkOptions(const LoadOptions& options) {
  Status checks[] = {
      within("--stations", static_cast<double>(options.stations), 1, 4000),
      within("--viewers", static_cast<double>(options.viewers), 0, 100),
      within("--seconds", options.seconds, 0.1, 7200),
      within("--spread", options.spread_s, 0, 60),
      within("--gestures", static_cast<double>(options.gestures), 1, 500),
      within("--connect-rate", options.connect_per_s, 1, 10'000),
      within("--fault-every", options.fault_every_s, 0.5, 3600),
  };
  for (Status& check : checks)
    if (!check.ok()) return std::move(check);
  if (options.server && options.ca_file.empty())
    return invalid("--server needs --ca FILE: the server's tls/ca.crt");
  if (options.server && options.password_file.empty())
    return invalid(
        "--server needs --password-file FILE, the password of the administrator --user: the stations are "
        "enrolled and the database is read by him");
  if (options.server && !options.data.empty())
    return invalid("--data is the folder of an own server: it does not go with --server");
  if (options.server && options.faults)
    return invalid("--faults kills and restarts an own server: it does not go with --server");
  if (!options.server && (!options.ca_file.empty() || !options.password_file.empty()))
    return invalid("--ca and --password-file go with --server HOST:PORT");
  return {};
}

}  // namespace needlelab::test
