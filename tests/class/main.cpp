// needlelab-class: fills a lab with some weeks of sessions by simulated trainees.
#include <fmt/core.h>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "client/station/run/loop/signals.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/usage/usage.h"
#include "common/wire/protocol.h"
#include "tests/class/class_run.h"

namespace needlelab {
namespace {

int classMain(int argc, char** argv, const sigset_t& stop_signals) {
  ClassOptions options;
  CLI::App app(
      "needlelab-class: simulated trainees practise at stations of their own, faster than real time, and "
      "everything goes through a running server. Skill decides about the hand alone: tremor, speed, aim, "
      "overshoot, smoothness; the scores are the server's. A check of the machinery, no evidence about "
      "people.");
  app.set_version_flag("--version", programText("class"));
  app.add_option("--server", options.server, "HOST:PORT of the server")->required();
  app.add_option("--ca", options.ca, "the server's tls/ca.crt")->required();
  app.add_option("--key", options.keys, "key file of a station; several work beside each other")->required();
  app.add_option("--trainee", options.trainees, "NAME=SKILL, from 0, a beginner, to 1, an expert; several")
      ->required();
  app.add_option("--exercise", options.exercises, "id; several, in the order in which they are practised")
      ->required();
  app.add_option("--attempts", options.timetable.attempts, "of everybody at each exercise, 1 to 50")
      ->capture_default_str();
  app.add_option("--weeks", options.timetable.weeks, "how long ago the first of them began")
      ->capture_default_str();
  app.add_option("--practice", options.timetable.practice,
                 "share of what is missing to skill 1 that an attempt takes away, 0 to 0.5")
      ->capture_default_str();
  app.add_option("--seed", options.timetable.seed, "of everything that is left to chance")
      ->capture_default_str();
  app.add_option("--spool", options.spool, "a folder for the stations' spools")->required();
  app.add_option("--out", options.out, "a table of all sessions, CSV")->type_name("FILE");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return endOfParsing(app, error, argc, argv);
  }
  const auto fail = [](const Error& error) {
    std::fprintf(stderr, "needlelab-class: %s\n", error.message.c_str());
    return exitCodeOf(error);
  };
  if (const Status ok = checkClass(options); !ok.ok()) return fail(ok.error());
  std::vector<ClassTrainee> trainees;
  for (const std::string& text : options.trainees) {
    const auto trainee = parseTrainee(text);
    if (!trainee.ok()) return fail(trainee.error());
    trainees.push_back(*trainee);
  }
  const auto sessions = runClass(options, trainees, stop_signals);
  if (!sessions.ok()) return fail(sessions.error());
  std::size_t stored = 0, locked = 0, left = 0;
  for (const ClassSession& session : *sessions) {
    stored += session.closed ? 1 : 0;
    locked += session.locked ? 1 : 0;
    left += !session.closed && !session.locked ? 1 : 0;
  }
  std::printf(
      "%s%zu sessions stored and verified by the server, %zu attempts not begun (locked, or none left)\n",
      classText(*sessions, trainees, options.exercises).c_str(), stored, locked);
  if (!options.out.empty())
    if (const Status wrote =
            writeFileAtomically(options.out, viewOf(classTable(*sessions, trainees, options.exercises)));
        !wrote.ok())
      return fail(wrote.error());
  if (left > 0)
    return fail({ErrorCode::kFailed, fmt::format("{} sessions are not stored; see {}", left,
                                                 options.out.empty() ? "--out" : options.out)});
  return kExitDone;
}

}  // namespace
}  // namespace needlelab

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  try {
    const sigset_t stop_signals = needlelab::blockStopSignals();
    return needlelab::classMain(argc, argv, stop_signals);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "needlelab-class: %s\n", error.what());
    return needlelab::kExitFailed;
  }
}
