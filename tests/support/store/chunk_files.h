/// Chunks of tests/data/gesture/*.tsv: a name, a tab, the bytes in hexadecimal digits (make_refused.py
/// there).
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/base/bytes.h"

namespace needlelab::test {

inline std::vector<std::pair<std::string, Bytes>> namedChunks(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<std::pair<std::string, Bytes>> chunks;
  for (std::string line; std::getline(in, line);) {
    const auto tab = line.find('\t');
    if (tab == std::string::npos) throw std::runtime_error(file.string() + ": a line without a tab");
    Bytes bytes;
    for (std::size_t at = tab + 1; at + 1 < line.size(); at += 2)
      bytes.push_back(static_cast<std::uint8_t>(std::stoi(line.substr(at, 2), nullptr, 16)));
    chunks.emplace_back(line.substr(0, tab), std::move(bytes));
  }
  if (chunks.empty()) throw std::runtime_error(file.string() + ": there is no chunk");
  return chunks;
}

}  // namespace needlelab::test
