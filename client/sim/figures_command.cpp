/// `needlelab-sim figures`: the paper's experiments again, as tables and pictures.
#include <cstdio>
#include <memory>
#include <system_error>

#include "base/atomic_file.h"
#include "base/exit_code.h"
#include "sim/command.h"
#include "sim/figures.h"
#include "sim/gnuplot.h"

namespace needlelab {
namespace {

int fail(const Error& error) {
  std::fprintf(stderr, "needlelab-sim figures: %s\n", error.message.c_str());
  return exitCodeOf(error);
}

// which run each figure shows, and how it is drawn
struct Experiment {
  Result<FigureRun> (*run)();
  std::vector<std::pair<const char*, Figure (*)(const FigureRun&, const std::filesystem::path&)>> figures;
};

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = {
      {runOneLayer, {{"fig07", figure07}}},
      {runSixLayers, {{"fig08", figure08}, {"fig09", figure09}}},
      {runClamping, {{"fig10", figure10}, {"fig11", figure11}}},
  };
  return all;
}

int figures(const std::filesystem::path& out) {
  std::error_code made;
  std::filesystem::create_directories(out, made);
  if (made)
    return fail(
        {ErrorCode::kInvalidInput, "--out " + out.string() + ": cannot make the folder: " + made.message()});

  const bool pictures = hasGnuplot();
  for (const Experiment& experiment : experiments()) {
    const auto run = experiment.run();
    if (!run.ok()) return fail(run.error());
    for (const auto& [name, make] : experiment.figures) {
      const auto csv = out / (std::string(name) + ".csv"), png = out / (std::string(name) + ".png");
      const Figure figure = make(*run, csv);
      if (const Status status = writeFileAtomically(csv, viewOf(figure.csv)); !status.ok())
        return fail(status.error());
      if (pictures)
        if (const Status status = plotPng(figure.script, png, figure.width_px, figure.height_px);
            !status.ok())
          return fail(status.error());
      std::printf("%s: %s%s\n", csv.c_str(), figure.title.c_str(),
                  pictures ? (", " + png.string()).c_str() : "");
    }
  }
  if (!pictures)
    std::fprintf(stderr,
                 "needlelab-sim figures: gnuplot is not on the PATH: tables only, no pictures (Debian: "
                 "gnuplot-nox)\n");
  return kExitDone;
}

}  // namespace

void addFiguresCommand(CLI::App& app, SimCommand& chosen) {
  auto out = std::make_shared<std::filesystem::path>();
  CLI::App* command = app.add_subcommand(
      "figures",
      "Runs the paper's experiments (Fig. 7 to 11) with a simulated hand, writes tables and pictures");
  command
      ->add_option("--out", *out, "folder for fig07.csv … fig11.csv and the PNGs; made when it is not there")
      ->required();
  command->callback([out, &chosen] { chosen = [out] { return figures(*out); }; });
}

}  // namespace needlelab
