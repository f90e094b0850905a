/// needlelab-soak: runs server, station and viewer together, and judges whether memory is flat and nothing is
/// lost.
#include <CLI/CLI.hpp>
#include <iostream>

#include "common/base/program.h"
#include "tests/soak/soak_judge.h"

namespace needlelab::test {
namespace {

int soak(const SoakOptions& options) {
  const auto fail = [](const Error& error) {
    std::cerr << "needlelab-soak: " << error.message << "\n";
    return exitCodeOf(error);
  };
  const auto data = runSoak(options);
  if (!data.ok()) return fail(data.error());
  const auto minutes = minutesOf(*data, options);
  if (!minutes.ok()) return fail(minutes.error());
  const auto findings = judge(*data, options, *minutes);
  const Status written = writeReport(*data, options, *minutes, findings);
  std::cout << tableText(findings, options.form()) << "files: " << options.out.string()
            << "/{samples,minutes}.csv, table.txt\n";
  if (!written.ok()) return fail(written.error());
  return verdictOf(findings) == Verdict::kBad ? kExitFailed : kExitDone;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::SoakOptions options;
  options.bin = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  double minutes = 30;
  CLI::App app{"Runs server, station and viewer together and judges memory, handles and losses",
               "needlelab-soak"};
  app.add_option("--minutes", minutes, "how long")->check(CLI::Range(0.1, 1440.0))->capture_default_str();
  app.add_option("--out", options.out, "a new folder for everything")->required();
  app.add_option("--bin", options.bin, "where the programs are")->capture_default_str();
  app.add_option("--rate", options.rate_hz, "ticks per second")
      ->check(CLI::Range(50.0, 4000.0))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  options.seconds = 60 * minutes;
  try {
    return needlelab::test::soak(options);
  } catch (const std::exception& error) {
    std::cerr << "needlelab-soak: " << error.what() << "\n";
    return needlelab::kExitFailed;
  }
}
