/// A trainee's code (a PIN, or what a badge reader types), so that no one practises as somebody else. Only
/// the server knows who has a code and whether it is right. The station sends it when the server asks, and
/// keeps it only in memory, while the same trainee continues.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include "client/station/run/io/options.h"
#include "common/base/result.h"
#include "common/base/secret.h"

namespace needlelab {

/// Shown to the trainee when a session begins without a server that would ask for a code.
inline constexpr const char* kCodeUnchecked =
    "The server is away: your code was not checked. A manager confirms this session later.";

/// Returns the code after the server refused (kCode) because it was missing or wrong. `stopped`: whether to
/// stop waiting for a person. Errors end the lesson's preparation.
using AskForCode =
    std::function<Result<std::string>(const Error& refused, const std::function<bool()>& stopped)>;

/// The code that a lesson sends for its trainee.
struct GivenCode {
  std::string code;  ///< sent at once; empty: none until the server asks
  AskForCode ask;    ///< empty: a refusal ends the lesson's preparation
  ~GivenCode() { wipe(code); }
};

/// For a station without a window: gives the code in --code-file once; otherwise asks at the terminal
/// whenever the server asks. Errors: kInvalidInput from the file (missing, no code). The returned function's
/// errors: kInvalidInput without file and terminal; kCode if the file's code is wrong; kFailed (stopped, no
/// code typed).
Result<AskForCode> headlessCodePrompt(const StationOptions& options);

}  // namespace needlelab
