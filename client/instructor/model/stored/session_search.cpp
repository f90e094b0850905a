#include "client/instructor/model/stored/session_search.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "client/instructor/model/live/session_scene.h"
#include "common/base/text/plain_words.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kRowsAtOnce = 200;

/// The start of the day, or of the following one, in this machine's time zone.
Result<std::int64_t> dayOf(const char* field, const std::string& text, int days_later) {
  int year = 0, month = 0, day = 0, used = 0;
  if (std::sscanf(text.c_str(), "%4d-%2d-%2d%n", &year, &month, &day, &used) == 3 &&
      static_cast<std::size_t>(used) == text.size()) {
    const std::chrono::year_month_day date{std::chrono::year(year),
                                           std::chrono::month(static_cast<unsigned>(month)),
                                           std::chrono::day(static_cast<unsigned>(day))};
    if (date.ok() && year >= 1970 && year <= 2200) return localMidnightNs(year, month, day + days_later);
  }
  return Error{ErrorCode::kInvalidInput,
               std::string(field) + ": '" + printable(text) + "' is not a date; write it as 2026-11-21"};
}

/// Rank of a row under kVerdict: failed first.
int verdictRank(const pb::SessionInfo& row) {
  return !row.has_passed() ? 1 : row.passed() ? 2 : 0;
}

}  // namespace

double figureOf(const pb::SessionInfo& row, std::string_view measure) {
  for (const pb::Figure& figure : row.figures())
    if (figure.measure() == measure && figure.has_value()) return figure.value();
  return std::numeric_limits<double>::quiet_NaN();
}

Result<pb::ListSessions> messageOf(const SessionQuery& query) {
  pb::ListSessions list;
  list.set_search(query.search);
  list.set_station(query.station);
  list.set_exercise_id(query.exercise_id);
  list.set_verdict(query.verdict);
  list.set_limit(kRowsAtOnce);
  if (!query.from.empty()) {
    ASSIGN_OR_RETURN(const auto day, dayOf("from", query.from, 0));
    list.set_from_unix_ns(day);
  }
  if (!query.to.empty()) {
    ASSIGN_OR_RETURN(const auto day, dayOf("to", query.to, 1));
    list.set_to_unix_ns(day);
    if (list.to_unix_ns() <= list.from_unix_ns())
      return Error{ErrorCode::kInvalidInput, "to: it is before the first day"};
  }
  return list;
}

SessionSearch::SessionSearch(SessionRequester ask) : ask_(std::move(ask)) {}

void SessionSearch::search(const SessionQuery& query) {
  query_ = query;
  asked_ = true;
  trouble_.clear();
  // a page token belongs to its own query
  next_page_.clear();
  ++*asking_;
  ask({});
}

void SessionSearch::more() {
  if (!waiting_ && !next_page_.empty()) ask(next_page_);
}

void SessionSearch::ask(const std::string& page) {
  auto list = messageOf(query_);
  if (!list.ok()) {
    fail(list.error().message, page.empty());
    return;
  }
  waiting_ = true;
  list->set_page(page);
  pb::Request request;
  *request.mutable_list_sessions() = *list;
  // a later search or the destruction of this object invalidates the answer
  ask_(request, [this, meant = *asking_, alive = std::weak_ptr(asking_),
                 first = page.empty()](Result<pb::Reply> reply) {
    const auto now = alive.lock();
    if (!now || *now != meant) return;
    if (!reply.ok()) {
      fail(plainWords(printable(reply.error().message)), first);
      return;
    }
    waiting_ = false;
    trouble_.clear();
    if (first) rows_.clear();
    const auto& sessions = reply->sessions().sessions();
    rows_.insert(rows_.end(), sessions.begin(), sessions.end());
    next_page_ = reply->sessions().next_page();
    sort();
  });
}

void SessionSearch::fail(std::string trouble, bool first_page) {
  waiting_ = false;
  trouble_ = std::move(trouble);
  // Rows of another query would look like the answer; after a failed "More" the earlier rows stay.
  if (first_page) rows_.clear();
}

std::string SessionSearch::countText() const {
  if (waiting_) return "looking …";
  if (rows_.empty() && !trouble_.empty()) return {};
  return fmt::format("{} session{}{}", rows_.size(), rows_.size() == 1 ? "" : "s",
                     hasMore() ? " so far" : "");
}

void SessionSearch::order(SessionOrder order) {
  order_ = order;
  sort();
}

void SessionSearch::sort() {
  const auto by = [&](auto before) { std::stable_sort(rows_.begin(), rows_.end(), before); };
  // newest first, also among equals
  by([](const auto& a, const auto& b) {
    return a.description().started_unix_ns() > b.description().started_unix_ns();
  });
  switch (order_) {
    case SessionOrder::kNewest:
      break;
    case SessionOrder::kTrainee:
      by([](const auto& a, const auto& b) {
        return traineeName(a.description()) < traineeName(b.description());
      });
      break;
    case SessionOrder::kExercise:
      by([](const auto& a, const auto& b) {
        return a.description().exercise_id() < b.description().exercise_id();
      });
      break;
    case SessionOrder::kPeakForce:
      by([force = measureOf(MeasureRole::kForce).name](const auto& a, const auto& b) {
        const double fa = figureOf(a, force), fb = figureOf(b, force);
        return fa == fa && (!(fb == fb) || fa > fb);
      });
      break;
    case SessionOrder::kVerdict:
      by([](const auto& a, const auto& b) { return verdictRank(a) < verdictRank(b); });
      break;
  }
}

}  // namespace needlelab
