#include "db/sessions/acknowledged.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include "common/base/files/files.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

constexpr std::string_view kLabLine = "lab = ", kNumberLine = "\nnumber = ";

std::optional<std::uint64_t> numberIn(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number > INT64_MAX - 1) return std::nullopt;
  return number;
}

/// The number in the folder's file for this lab; 0: none.
Result<std::uint64_t> numberInFile(const std::filesystem::path& path, std::string_view lab) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::uint64_t{0};
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(path, 1000));
  const std::string_view all = text;
  const std::size_t second = all.find(kNumberLine);
  std::optional<std::uint64_t> number;
  if (all.starts_with(kLabLine) && second != std::string_view::npos && all.ends_with('\n')) {
    const std::size_t at = second + kNumberLine.size();
    number = numberIn(all.substr(at, std::max(all.size() - 1, at) - at));
  }
  if (!number)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format(
            "{}: is not as needlelab-server writes it (the lines lab = ID and number = N), so it is unknown "
            "whether the database has everything that was acknowledged: put the right one back, or remove it",
            path.string())};
  const bool of_this_lab = all.substr(kLabLine.size(), second - kLabLine.size()) == lab;
  return of_this_lab ? *number : std::uint64_t{0};
}

/// `known`: where the greater number was found.
std::string lackText(std::uint64_t stored, const std::string& known) {
  return fmt::format(
      "--store: this database does not have all that was acknowledged (it has come to number {}, and {}): a "
      "standby that lagged was promoted, or an older backup restored. Stations send again what their spools "
      "have; sessions that no station has any more cannot be named. If a server of PostgreSQL that has all "
      "is "
      "left, end needlelab-server and go back to it",
      stored, known);
}

Result<std::uint64_t> numberInMeta(Connection& connection, std::string_view key) {
  ASSIGN_OR_RETURN(const auto text, MetaStore(connection).get(key));
  return numberIn(text.value_or("0")).value_or(0);
}

}  // namespace

bool isAcknowledgedKey(std::string_view key) {
  return key == kAcknowledgedKey || key.starts_with(std::string(kAcknowledgedKey) + " ");
}

Result<AcknowledgedMark> AcknowledgedMark::atStart(Connection& writer) {
  const auto folder = writer.path().parent_path();
  ASSIGN_OR_RETURN(const std::string server, serverNameOf(folder));
  const std::string key =
      std::string(kAcknowledgedKey) + (server == kFirstServer ? std::string() : " " + server);
  ASSIGN_OR_RETURN(const auto lab, MetaStore(writer).get(kLabKey));
  ASSIGN_OR_RETURN(const std::uint64_t stored, numberInMeta(writer, key));
  const auto file = folder / kAcknowledgedFile;
  ASSIGN_OR_RETURN(const std::uint64_t known, numberInFile(file, lab.value_or("")));
  AcknowledgedMark mark(file, key, lab.value_or(""), std::max(stored, known));
  if (stored < known) mark.lack_ = lackText(stored, fmt::format("{} says {}", file.string(), known));
  return mark;
}

void AcknowledgedMark::post(DbWriter& writer) {
  if (under_way_->waits) return;
  const std::uint64_t items = writer.counters().items;
  // a refused item covers nothing
  const bool again = under_way_->refused.exchange(false);
  if (items == covered_ && !again) return;
  under_way_->waits = true;
  const std::uint64_t number = ++number_;
  const auto under_way = under_way_;
  const Status posted = writer.post(
      [number, under_way, key = key_, &writer](Connection& connection) -> Status {
        // the engine searches for its last transaction, whose number another server's may have reused
        ASSIGN_OR_RETURN(const std::uint64_t stored, numberInMeta(connection, key));
        if (const std::uint64_t committed = under_way->committed; stored < committed)
          writer.reportMissing(lackText(stored, fmt::format("{} was acknowledged", committed)));
        return MetaStore(connection).set(key, std::to_string(number));
      },
      [number, under_way](const Status& stored) {
        if (stored.ok()) under_way->committed = number;
        under_way->refused = !stored.ok();
        under_way->waits = false;
      });
  if (!posted) {
    under_way->refused = true;
    under_way->waits = false;
  }
  covered_ = items + 1;  // its own item needs no further number
}

Status AcknowledgedMark::keep() {
  const std::uint64_t committed = under_way_->committed;
  if (committed <= kept_) return {};
  // fixed length: overwritten in place, so that a program scanning the folder does not see it change
  // constantly
  const std::string text = fmt::format("{}{}{}{:020}\n", kLabLine, lab_, kNumberLine, committed);
  if (!in_place_) {
    RETURN_IF_ERROR(writeFileAtomically(file_, viewOf(text), 0600));
    in_place_ = std::make_shared<OpenFile>(::open(file_.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC));
    if (!in_place_->isOpen()) {
      const Error error = systemError(file_, "open");
      in_place_.reset();
      return error;
    }
  } else if (::pwrite(in_place_->fd(), text.data(), text.size(), 0) != static_cast<ssize_t>(text.size()) ||
             ::fdatasync(in_place_->fd()) != 0) {
    const Error error = systemError(file_, "write");
    in_place_.reset();
    return error;
  }
  kept_ = committed;
  return {};
}

}  // namespace needlelab
