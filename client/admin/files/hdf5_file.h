/// A session's samples as one self-describing HDF5 file; README.md has the layout.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// Memory does not depend on the number of samples. One at a time in a process. Thread: one.
class Hdf5File {
 public:
  /// Begins to write `file`. `name`: for messages. `session`: its description; `profile` and `score` in it
  /// become data sets of their own.
  Hdf5File(std::filesystem::path name, const std::string& file, nlohmann::ordered_json session);
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;
  ~Hdf5File();
  /// Samples of a chunk, and its resolution. `first_time_ns`: the time of the recording's first sample.
  /// Errors, here and of close(): kFailed, with the name and the reason, for all calls until then.
  Status add(std::span<const GestureSample> samples, std::int64_t first_time_ns,
             const Resolution& resolution);
  Status close();

 private:
  /// A data set, the type of its values in memory, and rows that are not in the file yet. The library's ids.
  struct Column {
    std::int64_t set, type;
    std::string rows;
  };
  void makeColumns(const Resolution& resolution);
  void write();
  [[nodiscard]] Status checked() const;

  std::filesystem::path name_;
  std::string reason_;  ///< of the first failed call
  std::int64_t file_ = -1;
  std::uint64_t written_ = 0, waiting_ = 0;  ///< rows
  std::vector<Column> columns_;
};

}  // namespace needlelab
