#include "client/station/run/lesson/trainee_code.h"

#include <fmt/core.h>
#include <unistd.h>

#include <memory>
#include <utility>

#include "client/net/link/credentials.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/curriculum.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

// lives as long as the function that holds it, and wipes the code
struct FileCode {
  std::string code;
  ~FileCode() { wipe(code); }
};

AskForCode codeOfFile(std::shared_ptr<FileCode> file, const std::string& path) {
  return [file = std::move(file), path](const Error& refused,
                                        const std::function<bool()>&) -> Result<std::string> {
    if (file->code.empty())
      return Error{refused.code, refused.message + "; the code is that of --code-file " + path};
    std::string code = file->code;
    wipe(file->code);
    return code;
  };
}

Result<std::string> codeOfPerson(const std::string& who, const Error& refused, bool again,
                                 const std::function<bool()>& stopped) {
  const std::string no_terminal =
      refused.message + "; without a terminal give the code in a file: --code-file FILE";
  // as for Enter: otherwise a service started at a terminal would wait for an answer there
  if (!EnterKey(STDIN_FILENO).isTerminal()) return Error{ErrorCode::kInvalidInput, no_terminal};
  if (again) logMessage(refused.message);
  for (;;) {
    auto code =
        passwordFromTerminal("Code of " + who + " (PIN or badge): ", kMaxCodeBytes, no_terminal, stopped);
    if (!code.ok()) return code;
    if (code->empty()) return Error{ErrorCode::kFailed, "no code was typed: the lesson does not begin"};
    code = asciiDigits(*code);
    // an invalid code is not sent, so that it does not use up a try
    const Status valid = checkCode(*code);
    if (valid.ok()) return code;
    wipe(*code);
    logMessage(valid.error().message);
  }
}

}  // namespace

Result<AskForCode> headlessCodePrompt(const StationOptions& options) {
  if (!options.code_file.empty()) {
    const auto file = std::make_shared<FileCode>();
    ASSIGN_OR_RETURN(file->code, readSecretLine(options.code_file));
    file->code = asciiDigits(file->code);
    if (const Status valid = checkCode(file->code); !valid.ok())
      return Error{valid.error().code,
                   "--code-file " + options.code_file.string() + ": " + valid.error().message};
    return codeOfFile(file, options.code_file.string());
  }
  const auto asked = std::make_shared<bool>(false);
  return AskForCode([spool = options.spool, key_file = options.key_file, trainee = options.trainee, asked](
                        const Error& refused, const std::function<bool()>& stopped) {
    const std::string who = shownName(CurriculumCache(spool, key_file).find().trainees, trainee);
    return codeOfPerson(who, refused, std::exchange(*asked, true), stopped);
  });
}

}  // namespace needlelab
