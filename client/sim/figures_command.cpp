/// `needlelab-sim figures`: repeats the paper's experiments, as tables and pictures.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/sim/command.h"
#include "client/sim/figures.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

// Which run each figure shows, and how it is drawn.
struct Experiment {
  Result<FigureRun> (*run)();
  std::vector<Figure (*)(const FigureRun&)> figures;
};

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = {
      {runOneLayer, {figure07}},
      {runSixLayers, {figure08, figure09}},
      {runClamping, {figure10, figure11}},
  };
  return all;
}

// Names of the files written to `--out`.
std::vector<std::string> fileNames() {
  std::vector<std::string> names;
  for (const char* const figure : {"fig07", "fig08", "fig09", "fig10", "fig11"})
    for (const char* const kind : {".csv", ".png"}) names.push_back(std::string(figure) + kind);
  return names;
}

struct FiguresOptions {
  std::filesystem::path out;
  JsonOption json;
};

int figures(const FiguresOptions& options) {
  const std::filesystem::path& out = options.out;
  std::error_code made;
  std::filesystem::create_directories(out, made);
  if (made)
    return failed("figures", {ErrorCode::kInvalidInput,
                              "--out " + out.string() + ": cannot make the folder: " + made.message()});
  if (const Status status = checkFolderOutputs({}, {"--out", out}, fileNames(), options.json); !status.ok())
    return failed("figures", status.error());

  const bool pictures = hasGnuplot();
  auto rows = nlohmann::ordered_json::array();
  for (const Experiment& experiment : experiments()) {
    const auto run = experiment.run();
    if (!run.ok()) return failed("figures", run.error());
    for (const auto& make : experiment.figures) {
      Figure figure = make(*run);
      const auto csv = out / (figure.name + ".csv"), png = out / (figure.name + ".png");
      figure.variables.emplace_back("csv", csv.string());
      if (const Status status = writeFileAtomically(csv, viewOf(figure.csv)); !status.ok())
        return failed("figures", status.error());
      if (pictures)
        if (const Status status = drawPlot(figure.name, png, figure.variables); !status.ok())
          return failed("figures", status.error());
      rows.push_back(
          {{"figure", figure.name},
           {"title", figure.title},
           {"csv", csv.string()},
           {"png", pictures ? nlohmann::ordered_json(png.string()) : nlohmann::ordered_json(nullptr)}});
      if (options.json.wanted) continue;
      std::printf("%s: %s%s\n", csv.c_str(), figure.title.c_str(),
                  pictures ? (", " + png.string()).c_str() : "");
    }
  }
  if (!pictures)
    std::fprintf(stderr,
                 "needlelab-sim figures: gnuplot is not on the PATH: tables only, no pictures (Debian: "
                 "gnuplot-nox)\n");
  if (options.json.wanted)
    if (const Status status = writeJson(options.json, rows); !status.ok())
      return failed("figures", status.error());
  return kExitDone;
}

}  // namespace

void addFiguresCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<FiguresOptions>();
  CLI::App* command = app.add_subcommand(
      "figures",
      "Runs the paper's experiments (Fig. 7 to 11) with a simulated hand, writes tables and pictures");
  command
      ->add_option("--out", options->out, "folder for fig07.csv … fig11.csv and the PNGs; created if missing")
      ->required();
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return figures(*options); }; });
}

}  // namespace needlelab
