// Files made piece by piece: a person's records, a course's results, scores.
#include <memory>
#include <utility>

#include "common/base/text/csv.h"
#include "server/web/routes.h"

namespace needlelab {
namespace {

/// An empty page does not end the stream unless it is the last one.
WebPiece pieceOf(std::string text, bool ended) {
  return text.empty() && !ended ? WebPiece() : WebPiece(std::move(text));
}

/// Streams all of a person's records as one document, page by page from ExportPerson.
class PersonRecords {
 public:
  PersonRecords(Service& service, WebCall call) : service_(service), call_(std::move(call)) {}

  Result<WebPiece> next() {
    if (ended_) return WebPiece(std::string());
    pb::Request request;
    request.mutable_export_person()->set_name(call_.parts[0]);
    request.mutable_export_person()->set_page(page_);
    ASSIGN_OR_RETURN(const auto reply, replyOf(service_, call_, request));
    std::string text = page_.empty() ? "{\"items\": [" : "";
    for (const std::string& record : reply.records().records()) {
      text += (first_ ? "\n" : ",\n") + record;
      first_ = false;
    }
    page_ = reply.records().next_page();
    ended_ = page_.empty();
    if (ended_) text += "\n]}\n";
    return pieceOf(std::move(text), ended_);
  }

 private:
  Service& service_;
  const WebCall call_;
  std::string page_;
  bool first_ = true, ended_ = false;
};

/// A course's results as a file, page by page from GetResults. A page of many exercises and groups
/// becomes longer as text, so it is split into several pieces.
class ResultRows {
 public:
  ResultRows(Service& service, WebCall call, std::unique_ptr<ResultWriter> writer)
      : service_(service), call_(std::move(call)), writer_(std::move(writer)) {}

  Result<WebPiece> next() {
    std::string text;
    if (row_ == page_.rows_size()) {
      if (ended_) return WebPiece(std::string());
      RETURN_IF_ERROR(readPage(text));
    }
    while (row_ < page_.rows_size() && text.size() < kFullPieceBytes) {
      const pb::ResultRow& person = page_.rows(row_);
      if (cell_ < person.cells_size()) {
        RETURN_IF_ERROR(writer_->add(text, person, person.cells(cell_++)));
        continue;
      }
      ++row_;
      cell_ = 0;
    }
    const bool has_all = ended_ && row_ == page_.rows_size();
    if (has_all) writer_->end(text);
    return pieceOf(std::move(text), has_all);
  }

 private:
  static constexpr std::size_t kFullPieceBytes = 1u << 20;

  Status readPage(std::string& text) {
    pb::Request request;
    auto& ask = *request.mutable_get_results();
    ask.set_course_id(call_.parts[0]);
    ask.set_group_id(call_.query("group"));
    ask.set_with_measures(true);
    ask.set_page(page_.next_page());
    const bool is_first = page_.next_page().empty();
    ASSIGN_OR_RETURN(auto reply, replyOf(service_, call_, request));
    page_ = std::move(*reply.mutable_results());
    if (is_first) writer_->begin(text, page_);
    ended_ = page_.next_page().empty();
    row_ = 0;
    return {};
  }

  Service& service_;
  const WebCall call_;
  std::unique_ptr<ResultWriter> writer_;
  pb::Results page_;  ///< the page being written
  int row_ = 0, cell_ = 0;
  bool ended_ = false;
};

/// Scores as a file, page by page from ListScores.
class ScoreLines {
 public:
  ScoreLines(Service& service, WebCall call, std::unique_ptr<ScoreWriter> writer)
      : service_(service), call_(std::move(call)), writer_(std::move(writer)) {}

  Result<WebPiece> next() {
    if (ended_) return WebPiece(std::string());
    pb::Request request;
    auto& list = *request.mutable_list_scores();
    list.set_course_id(call_.query("course"));
    list.set_group_id(call_.query("group"));
    list.set_page(page_);
    ASSIGN_OR_RETURN(const auto reply, replyOf(service_, call_, request));
    std::string text;
    if (page_.empty()) writer_->begin(text);
    for (const pb::ScoreRow& row : reply.scores().scores()) RETURN_IF_ERROR(writer_->add(text, row));
    page_ = reply.scores().next_page();
    ended_ = page_.empty();
    if (ended_) writer_->end(text);
    return pieceOf(std::move(text), ended_);
  }

 private:
  Service& service_;
  const WebCall call_;
  std::unique_ptr<ScoreWriter> writer_;
  std::string page_;
  bool ended_ = false;
};

}  // namespace

Result<WebStream> personRecords(Service& service, const WebRoute&, const WebCall& call) {
  auto records = std::make_shared<PersonRecords>(service, call);
  return streamFromFirst("application/json", call.parts[0] + ".json", [records] { return records->next(); });
}

Result<WebStream> resultStream(Service& service, const WebRoute& route, const WebCall& call) {
  const std::string separator = call.query("separator");
  ASSIGN_OR_RETURN(const auto style, csvStyleOf(separator.empty() ? kCsvSeparators[0] : separator));
  auto rows = std::make_shared<ResultRows>(service, call, route.format->results(style));
  return streamFromFirst(*route.format, call.parts[0] + "-results", [rows] { return rows->next(); });
}

Result<WebStream> scoreStream(Service& service, const WebRoute& route, const WebCall& call) {
  auto lines = std::make_shared<ScoreLines>(service, call, route.format->scores());
  return streamFromFirst(*route.format, "scores", [lines] { return lines->next(); });
}

}  // namespace needlelab
