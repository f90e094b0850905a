#include "admin/session_export.h"

#include <unistd.h>

#include <functional>
#include <memory>

#include "admin/growing_file.h"
#include "admin/session_rows.h"
#include "base/machine.h"
#include "gesture/chunk.h"
#include "gesture/recording.h"
#include "gesture/sample_csv.h"
#include "gesture/session_hash.h"

namespace needlelab {
namespace {

/// Takes the chunks in order, then is finished once.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;
  virtual Status take(ByteView chunk) = 0;
  virtual Status finish() = 0;
};

/// CSV and JSON: text, sample by sample.
class TextSink : public Sink {
 public:
  TextSink(GrowingFile file, const Json* session) : file_(std::move(file)), json_(session != nullptr) {
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
      if (first_) first_time_ns_ = sample.time_ns;
      if (json_) {
        if (!first_) text_ += ",\n";
        appendSampleJson(text_, sample, first_time_ns_);
      } else {
        appendSampleCsvRow(text_, sample, first_time_ns_);
      }
      first_ = false;
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
  std::string text_;  ///< not yet written
  bool first_ = true;
  std::int64_t first_time_ns_ = 0;
};

class RecordingSink : public Sink {
 public:
  explicit RecordingSink(RecordingWriter writer) : writer_(std::move(writer)) {}
  Status take(ByteView chunk) override { return writer_.append(chunk); }
  Status finish() override { return writer_.finish(); }

 private:
  RecordingWriter writer_;
};

Result<std::unique_ptr<Sink>> openSink(const std::string& format, const std::filesystem::path& file,
                                       const Json& session) {
  if (format == "recording") {
    auto writer = RecordingWriter::create(file, session.dump(-1, ' ', false, Json::error_handler_t::replace));
    if (!writer) return writer.error();
    return std::unique_ptr<Sink>(std::make_unique<RecordingSink>(std::move(*writer)));
  }
  auto growing = GrowingFile::create(file);
  if (!growing) return growing.error();
  return std::unique_ptr<Sink>(
      std::make_unique<TextSink>(std::move(*growing), format == "json" ? &session : nullptr));
}

}  // namespace

Status exportSession(Backend& backend, Output& output, const Uuid& id, const std::string& format,
                     const std::filesystem::path& file) {
  const std::string bytes(id.begin(), id.end());
  pb::Request get;
  get.mutable_get_session()->set_session_id(bytes);
  const auto info = backend.call(get);
  if (!info) return info.error();
  const pb::SessionInfo& session = info->session();
  Json row = sessionRow(session);
  row["profile"] = Json::parse(session.description().profile_json(), nullptr, false);
  auto sink = openSink(format, file, row);
  if (!sink) return sink.error();

  // as many chunks as the session had when it was asked for; a live one goes on growing
  SessionHash hash;
  const bool progress = ::isatty(STDERR_FILENO) != 0;
  std::uint64_t next = 0;
  while (next < session.chunks()) {
    pb::Request read;
    read.mutable_read_chunks()->set_session_id(bytes);
    read.mutable_read_chunks()->set_from_seq(next);
    const auto reply = backend.call(read);
    if (!reply) return reply.error();
    if (reply->chunks().chunks_size() == 0) break;
    for (const pb::Chunk& chunk : reply->chunks().chunks()) {
      if (next == session.chunks()) break;
      if (chunk.seq() != next) {
        return Error{ErrorCode::kCorrupt, "chunk " + std::to_string(next) + " was asked for, " +
                                              std::to_string(chunk.seq()) + " came"};
      }
      if (auto done = (*sink)->take(viewOf(chunk.data())); !done) {
        return Error{done.error().code, "chunk " + std::to_string(next) + ": " + done.error().message};
      }
      hash.update(viewOf(chunk.data()));
      ++next;
    }
    if (progress) output.remark(std::to_string(next) + " of " + std::to_string(session.chunks()) + " chunks");
  }
  if (next != session.chunks()) {
    return Error{ErrorCode::kCorrupt, "the session has " + std::to_string(session.chunks()) +
                                          " chunks, only " + std::to_string(next) + " could be read"};
  }
  const Digest digest = hash.digest();
  if (!session.hash().empty() && textOf(digest) != session.hash()) {
    return Error{ErrorCode::kCorrupt, "the hash over what was read is " + hexOf(digest) +
                                          ", the session was closed with " + hexOfBytes(session.hash()) +
                                          ": nothing was written"};
  }
  if (auto done = (*sink)->finish(); !done) return done;
  if (session.state() == pb::SESSION_OPEN)
    output.remark("the session is still open: this is what has come so far");
  output.done("wrote " + std::to_string(session.samples()) + " samples to " + file.string());
  return {};
}

}  // namespace needlelab
