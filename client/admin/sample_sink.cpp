#include "client/admin/sample_sink.h"

#include <utility>

#include "common/base/files.h"
#include "common/base/program.h"
#include "common/gesture/chunk.h"
#include "common/gesture/recording.h"
#include "common/gesture/sample_csv.h"

namespace needlelab {
namespace {

/// CSV and JSON: text, sample by sample.
class TextSink : public SampleSink {
 public:
  TextSink(GrowingFile file, const Json* session, const SampleWindow& window)
      : file_(std::move(file)), json_(session != nullptr), window_(window) {
    if (!json_) {
      appendSampleCsvHeader(text_);
      return;
    }
    const Json head = {{"version", NEEDLELAB_VERSION}, {"machine", machineText()}, {"session", *session}};
    text_ = head.dump(-1, ' ', false, Json::error_handler_t::replace);
    text_.back() = ',';  // in place of the closing brace
    text_ += "\"rows\":[\n";
  }

  Status take(ByteView chunk) override {
    const auto samples = decodeChunk(chunk);
    if (!samples) return samples.error();
    for (const GestureSample& sample : *samples) {
      if (!window_.first_time_ns) window_.first_time_ns = sample.time_ns;
      const std::int64_t time_ns = sample.time_ns - *window_.first_time_ns;
      if (time_ns >= window_.to_ns) past_ = true;
      if (time_ns < window_.from_ns || time_ns >= window_.to_ns) continue;
      if (json_) {
        if (samples_ != 0) text_ += ",\n";
        appendSampleJson(text_, sample, *window_.first_time_ns);
      } else {
        appendSampleCsvRow(text_, sample, *window_.first_time_ns);
      }
      ++samples_;
    }
    auto done = file_.append(viewOf(text_));
    text_.clear();
    return done;
  }

  Status finish() override {
    if (json_) text_ += "\n]}\n";
    if (auto done = file_.append(viewOf(text_)); !done) return done;
    return file_.finish();
  }

 private:
  GrowingFile file_;
  const bool json_;
  SampleWindow window_;
  std::string text_;  ///< not yet written
};

/// Whole chunks, byte for byte.
class RecordingSink : public SampleSink {
 public:
  RecordingSink(RecordingWriter writer, const SampleWindow& window)
      : writer_(std::move(writer)), window_(window) {}

  Status take(ByteView chunk) override {
    const auto info = inspectChunk(chunk);
    if (!info) return info.error();
    if (!window_.first_time_ns) window_.first_time_ns = info->first_time_ns;
    if (info->first_time_ns - *window_.first_time_ns >= window_.to_ns) {
      past_ = true;
      return {};
    }
    if (auto done = writer_.append(chunk); !done) return done;
    samples_ += info->count;
    return {};
  }

  Status finish() override { return writer_.finish(); }

 private:
  RecordingWriter writer_;
  SampleWindow window_;
};

}  // namespace

Result<std::unique_ptr<SampleSink>> openSampleSink(const std::string& format,
                                                   const std::filesystem::path& file, const Json& session,
                                                   const SampleWindow& window) {
  if (format == "recording") {
    auto writer = RecordingWriter::create(file, session.dump(-1, ' ', false, Json::error_handler_t::replace));
    if (!writer) return writer.error();
    return std::unique_ptr<SampleSink>(std::make_unique<RecordingSink>(std::move(*writer), window));
  }
  auto growing = GrowingFile::create(file);
  if (!growing) return growing.error();
  return std::unique_ptr<SampleSink>(
      std::make_unique<TextSink>(std::move(*growing), format == "json" ? &session : nullptr, window));
}

}  // namespace needlelab
