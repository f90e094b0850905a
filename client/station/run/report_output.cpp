#include "client/station/run/report_output.h"

#include <iostream>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {

std::size_t columnsOf(std::string_view text) {
  std::size_t columns = 0;
  // continuation bytes of a character do not count
  for (const char c : text) columns += (static_cast<unsigned char>(c) & 0xC0u) != 0x80u ? 1 : 0;
  return columns;
}

std::string padded(std::string_view text, std::size_t columns) {
  std::string result(text);
  if (const std::size_t is = columnsOf(text); is < columns) result.append(columns - is, ' ');
  return result;
}

std::string wrapped(std::string_view text, std::size_t indent, std::size_t width) {
  std::string lines, line;
  const auto endLine = [&] {
    if (!line.empty()) lines += std::string(indent, ' ') + line + "\n";
    line.clear();
  };
  while (!text.empty()) {
    const std::size_t blank = text.find(' ');
    const std::string_view word = text.substr(0, blank);
    text.remove_prefix(blank == std::string_view::npos ? text.size() : blank + 1);
    if (!line.empty() && indent + columnsOf(line) + 1 + columnsOf(word) > width) endLine();
    if (!line.empty()) line += ' ';
    line += word;
  }
  endLine();
  return lines;
}

std::string reportJson(const nlohmann::ordered_json& rows) {
  const nlohmann::ordered_json report = {
      {"version", NEEDLELAB_VERSION}, {"machine", machineText()}, {"rows", rows}};
  // device text that is not UTF-8 must not end the program
  return report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int refused(const Error& error) {
  std::cerr << "needlelab-station: " << error.message << "\n";
  return exitCodeOf(error);
}

int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code) {
  const bool json_on_stdout = options.json && options.json_file.empty();
  (json_on_stdout ? std::cerr : std::cout) << text << std::flush;
  if (json_on_stdout) std::cout << json << std::flush;
  if (!std::cout) {
    std::cerr << "needlelab-station: cannot write to standard output\n";
    return kExitFailed;
  }
  if (options.json && !json_on_stdout)
    if (const Status status = writeFileAtomically(options.json_file, viewOf(json)); !status.ok()) {
      std::cerr << "needlelab-station: " << status.error().message << "\n";
      return kExitFailed;
    }
  return code;
}

}  // namespace needlelab
