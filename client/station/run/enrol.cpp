// --enrol: this computer becomes a station of a server, proved by logging in.
#include <sys/stat.h>

#include <iostream>

#include "client/net/connect.h"
#include "client/net/credentials.h"
#include "client/station/run/modes.h"
#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

/// What may help, after the server was asked in vain.
std::string adviceFor(const Error& error, const Enrolment& enrolment) {
  if (error.message.find(kNotForThisName) != std::string::npos)
    return "; the server's certificate is not for " + enrolment.server.host +
           ": on the server, needlelab-admin --data DIR certificate renew --host-name " +
           enrolment.server.host + ", then restart it";
  if (error.code == ErrorCode::kUnavailable)
    return "; see that the server runs and listens on an address that this computer reaches";
  return {};
}

}  // namespace

int runEnrol(const StationOptions& options) {
  const auto fail = [](const Error& error, const std::string& more = {}) {
    std::cerr << "needlelab-station: " << error.message << more << "\n";
    return exitCodeOf(error);
  };
  const auto text = readWholeFile(options.bundle, 1u << 20);
  if (!text.ok()) return fail(text.error());
  const auto enrolment = parseBundle(*text, options.bundle.string());
  if (!enrolment.ok()) return fail(enrolment.error());
  struct stat info {};
  if (::stat(options.bundle.c_str(), &info) == 0 && (info.st_mode & 077) != 0)
    std::cerr << "needlelab-station: " << options.bundle.string()
              << " holds the station's key and others may read it: chmod 600, and remove it after this\n";
  std::error_code error;
  std::filesystem::create_directories(options.enrolled, error);
  if (error)
    return fail({ErrorCode::kFailed, "cannot make " + options.enrolled.string() + ": " + error.message() +
                                         "; choose another folder with --enrolled DIR"});

  // nothing is kept before it is known to work
  const auto name = proveEnrolment(*enrolment, options.enrolled);
  if (!name.ok())
    return fail({name.error().code, "not enrolled: " + name.error().message},
                adviceFor(name.error(), *enrolment));
  if (auto saved = saveEnrolment(*enrolment, options.enrolled); !saved.ok()) return fail(saved.error());
  std::cout << "enrolled: logged in to " << endpointText(enrolment->server) << " as " << *name << "; kept in "
            << options.enrolled.string() << ". Remove " << options.bundle.string()
            << " now, and practise with: needlelab-station --enrolled"
            << (options.enrolled == defaultEnrolmentFolder() ? "" : " " + options.enrolled.string())
            << " --trainee NAME --exercise ID\n";
  return std::cout.flush() ? kExitDone : kExitFailed;
}

}  // namespace needlelab
