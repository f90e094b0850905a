/// The code of a trainee (a PIN, or what a badge reader types), so that nobody practises as somebody else.
/// The server alone knows who has one and whether it is right: the station sends it when the server asks, and
/// keeps it in memory only, for as long as the same trainee goes on.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include "client/station/run/options.h"
#include "common/base/result.h"
#include "common/base/secret.h"

namespace needlelab {

/// For the trainee, of a session that begins without the server although it asks for a code otherwise.
inline constexpr const char* kCodeUnchecked =
    "The server is away: your code was not checked. A manager confirms this session later.";

/// Gives the code after the server refused (kCode) because it is missing or wrong. `stopped`: whether to give
/// up waiting for a person. Errors end the lesson's preparation.
using AskForCode =
    std::function<Result<std::string>(const Error& refused, const std::function<bool()>& stopped)>;

/// What a lesson sends as its trainee's code.
struct GivenCode {
  std::string code;  ///< sent at once; empty: none until the server asks
  AskForCode ask;    ///< empty: a refusal ends the lesson's preparation
  ~GivenCode() { wipe(code); }
};

/// For a station without a window: the code in --code-file, once; else a person at the terminal, as often as
/// the server asks. Errors: kInvalidInput from the file (no such file, no code), and, when it asks, without
/// file and terminal; kCode when the file's code is wrong; kFailed (stopped, no code typed).
Result<AskForCode> askForCodeWithoutWindow(const StationOptions& options);

}  // namespace needlelab
