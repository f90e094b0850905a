/// Where exported chunks go: a file of one of three formats.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "client/admin/output.h"
#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

/// What is kept of the samples of a chunk. Times are ns since the recording's first sample.
struct SampleWindow {
  std::optional<std::int64_t> first_time_ns;  ///< of the recording; nothing: of the first sample that comes
  std::int64_t from_ns = INT64_MIN;
  std::int64_t to_ns = INT64_MAX;
};

/// Takes chunks in order, then is finished once; without that nothing is left of it. Thread: one.
class SampleSink {
 public:
  SampleSink() = default;
  SampleSink(const SampleSink&) = delete;
  SampleSink& operator=(const SampleSink&) = delete;
  virtual ~SampleSink() = default;
  /// kCorrupt: the chunk cannot be decoded; nothing of it was written.
  virtual Status take(ByteView chunk) = 0;
  virtual Status finish() = 0;
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  /// A sample at or behind the window's end was seen.
  [[nodiscard]] bool past() const { return past_; }

 protected:
  std::uint64_t samples_ = 0;
  bool past_ = false;
};

/// `format`: csv, json or recording; `session`: what stands beside the samples.
Result<std::unique_ptr<SampleSink>> openSampleSink(const std::string& format,
                                                   const std::filesystem::path& file, const Json& session,
                                                   const SampleWindow& window);

}  // namespace needlelab
