/// The list of stored sessions: the query and its results, page by page.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/instructor/model/live/lab_connection.h"

namespace needlelab {

/// A query; empty fields do not filter.
struct SessionQuery {
  std::string search;  ///< part of the trainee's user name or full name
  std::string station, exercise_id;
  std::string from, to;  ///< local days, "2026-11-21"; `to` is included
  pb::ListSessions::Verdict verdict = pb::ListSessions::ANY;
  friend bool operator==(const SessionQuery&, const SessionQuery&) = default;
};
/// Errors: kInvalidInput, naming the invalid day or a `to` before `from`.
Result<pb::ListSessions> messageOf(const SessionQuery& query);

/// The order of the rows; the server sends the newest first.
enum class SessionOrder : std::uint8_t { kNewest, kTrainee, kExercise, kPeakForce, kVerdict };

/// Sends a request; the answer comes later, on the same thread. LabConnection::ask, or a test.
using SessionRequester = std::function<void(pb::Request, LabConnection::Answer)>;

/// Thread: the one that polls the connection behind `ask`. Ignores answers after its destruction.
class SessionSearch {
 public:
  explicit SessionSearch(SessionRequester ask);

  /// Sends the query; keeps the old rows until the answer arrives. A failed search has no rows.
  void search(const SessionQuery& query);
  void again() { search(query_); }
  /// Requests the next page, if any, and appends it to the rows.
  void more();
  void order(SessionOrder order);

  [[nodiscard]] const SessionQuery& query() const { return query_; }
  [[nodiscard]] const std::vector<pb::SessionInfo>& rows() const { return rows_; }
  [[nodiscard]] bool waiting() const { return waiting_; }
  [[nodiscard]] bool hasMore() const { return !next_page_.empty(); }
  [[nodiscard]] bool asked() const { return asked_; }
  /// The server found no sessions for this query.
  [[nodiscard]] bool nothingMatches() const {
    return asked_ && !waiting_ && rows_.empty() && trouble_.empty();
  }
  /// "looking …", "1 session", "200 sessions so far"; empty after a failed search.
  [[nodiscard]] std::string countText() const;
  [[nodiscard]] const std::string& trouble() const {
    return trouble_;
  }  ///< error of the last search; empty: none

 private:
  void ask(const std::string& page);
  void fail(std::string trouble, bool first_page);
  void sort();
  SessionRequester ask_;
  SessionQuery query_;
  SessionOrder order_ = SessionOrder::kNewest;
  std::vector<pb::SessionInfo> rows_;
  std::string next_page_, trouble_;
  bool waiting_ = false, asked_ = false;
  std::shared_ptr<std::uint64_t> asking_ = std::make_shared<std::uint64_t>(0);  // the current search
};

/// Returns the measure's figure in a row; NaN if it has none.
double figureOf(const pb::SessionInfo& row, std::string_view measure);

}  // namespace needlelab
