/// needlelab-load: a skills lab in one process against a real server.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <iostream>

#include "client/sim/command.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/usage/usage.h"
#include "tests/load/load_report.h"
#include "tests/load/load_run.h"

namespace {

using namespace needlelab;
using namespace needlelab::test;

std::atomic<bool> interrupted{false};

void onSignal(int number) {
  interrupted.store(true, std::memory_order_relaxed);
  std::signal(number, SIG_DFL);  // a second signal ends it at once
}

int fail(const Error& error) {
  std::fprintf(stderr, "needlelab-load: %s\n", error.message.c_str());
  return exitCodeOf(error);
}

}  // namespace

int main(int argc, char** argv) try {
  LoadOptions options;
  options.bin = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  std::string server;
  std::filesystem::path out;
  JsonOption json;
  CLI::App app{
      "A skills lab in one process: stations and instructors over TLS against a real server; at the end "
      "every stored sample is compared with what was generated. Exit code 0 only if nothing is lost, doubled "
      "or different.",
      "needlelab-load"};
  app.set_version_flag("--version", "needlelab-load " + programVersion());
  app.add_option("--stations", options.stations, "how many, each at 1 kHz")->capture_default_str();
  app.add_option("--viewers", options.viewers, "who split the stations between them, at full rate")
      ->capture_default_str();
  app.add_option("--seconds", options.seconds, "of streaming")->capture_default_str();
  app.add_option("--seed", options.seed, "of gestures and faults")->capture_default_str();
  app.add_option("--server", server,
                 "HOST:PORT of a server that runs, or several of one lab, with commas; else one is started");
  app.add_option("--ca", options.ca_file, "with --server: its tls/ca.crt");
  app.add_option("--user", options.user, "with --server: an administrator")->capture_default_str();
  app.add_option("--password-file", options.password_file, "with --server: his password, first line");
  app.add_option("--servers", options.servers,
                 "names of own servers, such as a,b: they work together on --store and are connected by an "
                 "own nats-server; stations and viewers spread over them, and each viewer also watches "
                 "stations of the others")
      ->delimiter(',');
  app.add_option("--store", options.store,
                 "the own server's database on PostgreSQL, which must be empty; else SQLite");
  app.add_option("--standby", options.standby,
                 "with --store: postmaster.pid of its standby on this computer, for what it costs");
  app.add_flag("--faults", options.faults,
               "random lost connections, kill -9 and restart of the own server, slow viewers");
  app.add_option("--out", out, "a folder for a judged soak: table, samples.csv, load.json");
  app.add_flag("--quiet", options.quiet, "no progress on standard error");
  addJsonOption(app, json);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return endOfParsing(app, error, argc, argv);
  }
  if (!server.empty()) {
    auto endpoints = parseEndpoints(server);
    if (!endpoints.ok()) return fail(endpoints.error());
    options.server = *endpoints;
  }
  if (!options.servers.empty() && !out.empty())
    return fail({ErrorCode::kInvalidInput, "--out judges the memory of one server: leave --servers out"});
  if (const Status ok = checkOutputs({{"--ca", options.ca_file},
                                      {"--password-file", options.password_file},
                                      {"--standby", options.standby}},
                                     {{"--json", json.file}});
      !ok.ok())
    return fail(ok.error());

  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const auto result = runLoad(options, interrupted);
  if (!result.ok()) return fail(result.error());
  const std::string text = loadText(*result);
  if (json.wanted) {
    const std::string rows = loadJson(*result).dump(1) + "\n";
    if (json.file.empty()) {
      std::cout << rows;
      std::cerr << text;
    } else {
      if (const Status written = writeFileAtomically(json.file, viewOf(rows)); !written.ok())
        return fail(written.error());
      std::cout << text;
    }
  } else {
    std::cout << text;
  }
  bool flat = true;
  if (!out.empty()) {
    const auto findings = judgeLoad(*result);
    std::cout << tableText(findings, soakForm(options));
    if (const Status written = writeSoak(*result, findings, out); !written.ok()) return fail(written.error());
    flat = verdictOf(findings) != Verdict::kBad;
  }
  return result->good() && flat ? kExitDone : kExitFailed;
} catch (const std::exception& error) {
  std::fprintf(stderr, "needlelab-load: %s\n", error.what());
  return needlelab::kExitFailed;
}
