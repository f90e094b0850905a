#include "db/free_parts.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>

namespace needlelab {
namespace {

/// Reads and writes pages of the database's file, past SQLite's cache (https://sqlite.org/fileformat2.html).
class PageFile {
 public:
  static Result<PageFile> open(sqlite3* database, const std::filesystem::path& path) {
    PageFile pages(path);
    if (sqlite3_file_control(database, "main", SQLITE_FCNTL_FILE_POINTER, &pages.file_) != SQLITE_OK ||
        pages.file_ == nullptr || pages.file_->pMethods == nullptr)
      return Error{ErrorCode::kFailed, pages.path_.string() + ": SQLite gives no handle of the file"};
    sqlite3_int64 bytes = 0;
    if (pages.file_->pMethods->xFileSize(pages.file_, &bytes) != SQLITE_OK)
      return Error{ErrorCode::kFailed, pages.path_.string() + ": cannot tell its size"};
    pages.page_.resize(100);
    if (const int rc = pages.file_->pMethods->xRead(pages.file_, pages.page_.data(), 100, 0); rc != SQLITE_OK)
      return pages.failed("read", 1, rc);
    const std::size_t size = pages.two(16) == 1 ? 65536 : pages.two(16);
    const std::size_t reserved = pages.page_[20];
    if (size < 512 || (size & (size - 1)) != 0 || size - reserved < 480) return pages.wrong(1);
    pages.size_ = size;
    pages.usable_ = size - reserved;
    pages.count_ = static_cast<std::uint64_t>(bytes) / size;
    pages.page_.resize(size);
    return pages;
  }

  [[nodiscard]] std::uint64_t count() const { return count_; }

  /// Reads a page of a tree and checks its head.
  Status read(std::uint32_t number) {
    if (number == 0 || number > count_) return wrong(number);
    number_ = number;
    if (const int rc = file_->pMethods->xRead(file_, page_.data(), static_cast<int>(size_), begin());
        rc != SQLITE_OK)
      return failed("read", number, rc);
    head_ = number == 1 ? 100 : 0;
    const std::uint8_t kind = page_[head_];
    is_leaf_ = kind == 10 || kind == 13;
    if (!is_leaf_ && kind != 2 && kind != 5) return wrong(number);
    cells_ = two(head_ + 3);
    cells_at_ = head_ + (is_leaf_ ? 8 : 12);
    content_ = two(head_ + 5) == 0 ? 65536 : two(head_ + 5);
    if (cells_at_ + 2 * cells_ > content_ || content_ > usable_) return wrong(number);
    for (std::size_t i = 0; i < cells_; ++i)
      if (cellAt(i) < content_ || cellAt(i) + 4 > usable_) return wrong(number);
    return {};
  }
  [[nodiscard]] bool isLeaf() const { return is_leaf_; }
  /// Pages below the one that was read, which is no leaf.
  [[nodiscard]] std::vector<std::uint32_t> children() const {
    std::vector<std::uint32_t> children;
    for (std::size_t i = 0; i < cells_; ++i) children.push_back(four(cellAt(i)));
    children.push_back(four(head_ + 8));
    return children;
  }

  /// Overwrites the free parts of the page that was read.
  Status clear() {
    std::vector<std::size_t> cells;
    for (std::size_t i = 0; i < cells_; ++i) cells.push_back(cellAt(i));
    std::sort(cells.begin(), cells.end());
    struct Part {
      std::size_t begin, end;
    };
    std::vector<Part> parts = {{cells_at_ + 2 * cells_, content_}};
    for (std::size_t at = two(head_ + 1), least = content_; at != 0; at = two(at)) {
      if (at < least || at + 4 > usable_) return wrong(number_);
      const std::size_t end = at + two(at + 2);
      const auto cell = std::lower_bound(cells.begin(), cells.end(), at);
      if (end < at + 4 || end > usable_ || (cell != cells.end() && *cell < end)) return wrong(number_);
      parts.push_back({at + 4, end});
      least = end;
    }
    for (const Part& part : parts) RETURN_IF_ERROR(overwrite(part.begin, part.end));
    return {};
  }

  [[nodiscard]] bool wrote() const { return wrote_; }
  Status sync() {
    if (const int rc = file_->pMethods->xSync(file_, SQLITE_SYNC_NORMAL); rc != SQLITE_OK)
      return Error{ErrorCode::kFailed, fmt::format("{}: cannot sync it (SQLite {})", path_.string(), rc)};
    return {};
  }
  [[nodiscard]] Error wrong(std::uint32_t number) const {
    return {ErrorCode::kCorrupt,
            fmt::format("{}: page {} is not what its table says: run needlelab-admin check", path_.string(),
                        number)};
  }

 private:
  explicit PageFile(std::filesystem::path path) : path_(std::move(path)) {}
  [[nodiscard]] sqlite3_int64 begin() const {
    return (static_cast<sqlite3_int64>(number_) - 1) * static_cast<sqlite3_int64>(size_);
  }
  [[nodiscard]] std::size_t two(std::size_t at) const {
    return static_cast<std::size_t>(page_[at]) << 8 | page_[at + 1];
  }
  [[nodiscard]] std::uint32_t four(std::size_t at) const {
    return static_cast<std::uint32_t>(two(at) << 16 | two(at + 2));
  }
  [[nodiscard]] std::size_t cellAt(std::size_t i) const { return two(cells_at_ + 2 * i); }
  [[nodiscard]] Error failed(std::string_view what, std::uint32_t number, int rc) const {
    return {ErrorCode::kFailed,
            fmt::format("{}: cannot {} page {} (SQLite {})", path_.string(), what, number, rc)};
  }
  Status overwrite(std::size_t from, std::size_t to) {
    while (from < to && page_[from] == 0) ++from;
    while (from < to && page_[to - 1] == 0) --to;
    if (from == to) return {};
    const std::vector<std::uint8_t> zeros(to - from);
    const int rc = file_->pMethods->xWrite(file_, zeros.data(), static_cast<int>(zeros.size()),
                                           begin() + static_cast<sqlite3_int64>(from));
    if (rc != SQLITE_OK) return failed("write", number_, rc);
    wrote_ = true;
    return {};
  }

  std::filesystem::path path_;
  sqlite3_file* file_ = nullptr;
  std::size_t size_ = 0, usable_ = 0;
  std::uint64_t count_ = 0;
  std::vector<std::uint8_t> page_;
  std::uint32_t number_ = 0;
  std::size_t head_ = 0, cells_ = 0, cells_at_ = 0, content_ = 0;
  bool is_leaf_ = false, wrote_ = false;
};

/// One call's way through the trees.
class Walk {
 public:
  Walk(PageFile& pages, std::vector<bool>& cleared, std::size_t most)
      : pages_(pages), cleared_(cleared), left_(most) {}

  /// False: `most` pages are cleared, and there are others.
  Result<bool> tree(std::uint32_t root) {
    // all leaves of a tree are equally deep: how deep, the way along the first children tells
    std::size_t levels = 0;
    for (std::uint32_t page = root;; ++levels) {
      RETURN_IF_ERROR(pages_.read(page));
      if (pages_.isLeaf()) break;
      if (levels == kMostLevels) return pages_.wrong(page);
      page = pages_.children().front();
    }
    return below(root, levels);
  }

 private:
  static constexpr std::size_t kMostLevels = 20;  // as SQLite's

  Result<bool> below(std::uint32_t page, std::size_t levels) {
    if (levels == 0) {
      if (page < cleared_.size() && cleared_[page]) return true;
      if (left_ == 0) return false;
      RETURN_IF_ERROR(pages_.read(page));
      if (!pages_.isLeaf()) return pages_.wrong(page);
      RETURN_IF_ERROR(pages_.clear());
      if (page >= cleared_.size()) cleared_.resize(page + 1, false);
      cleared_[page] = true;
      --left_;
      return true;
    }
    // a damaged tree must not lead in circles
    if (++read_ > pages_.count()) return pages_.wrong(page);
    RETURN_IF_ERROR(pages_.read(page));
    if (pages_.isLeaf()) return pages_.wrong(page);
    RETURN_IF_ERROR(pages_.clear());
    const std::vector<std::uint32_t> children = pages_.children();
    for (const std::uint32_t child : children) {
      ASSIGN_OR_RETURN(const bool done, below(child, levels - 1));
      if (!done) return false;
    }
    return true;
  }

  PageFile& pages_;
  std::vector<bool>& cleared_;
  std::size_t left_;
  std::uint64_t read_ = 0;
};

/// The first pages of the tables and indexes that may name somebody.
Result<std::vector<std::uint32_t>> rootsOf(sqlite3* database, const std::filesystem::path& path) {
  sqlite3_stmt* rows = nullptr;
  int rc = sqlite3_prepare_v2(database,
                              "SELECT rootpage FROM sqlite_schema WHERE rootpage > 0 AND tbl_name NOT IN"
                              " ('chunks', 'derived_chunks', 'quarantined_chunks', 'session_progress',"
                              " 'audit_chain') ORDER BY rootpage",
                              -1, &rows, nullptr);
  std::vector<std::uint32_t> roots;
  while (rc == SQLITE_OK && (rc = sqlite3_step(rows)) == SQLITE_ROW) {
    roots.push_back(static_cast<std::uint32_t>(sqlite3_column_int64(rows, 0)));
    rc = SQLITE_OK;
  }
  sqlite3_finalize(rows);
  if (rc == SQLITE_DONE) return roots;
  return Error{ErrorCode::kFailed, fmt::format("{}: cannot read its tables: {} (SQLite {})", path.string(),
                                               sqlite3_errstr(rc), rc)};
}

/// Clears up to `most` pages of the file that are not `cleared`, and syncs it. True: all are cleared.
Result<bool> clearPages(sqlite3* database, const std::filesystem::path& path, std::vector<bool>& cleared,
                        std::size_t most, bool& wrote) {
  ASSIGN_OR_RETURN(const auto roots, rootsOf(database, path));
  ASSIGN_OR_RETURN(auto pages, PageFile::open(database, path));
  Walk walk(pages, cleared, most);
  bool all = true;
  Status status;
  for (const std::uint32_t root : roots) {
    const auto done = walk.tree(root);
    if (!done) status = done.error();
    all = done && *done;
    if (!all) break;
  }
  wrote = pages.wrote();
  if (wrote) RETURN_IF_ERROR(pages.sync());
  RETURN_IF_ERROR(status);
  return all;
}

}  // namespace

Status clearFreePartsOfCopy(sqlite3* copy, const std::filesystem::path& path) {
  std::vector<bool> cleared;
  bool wrote = false;
  const auto all = clearPages(copy, path, cleared, SIZE_MAX, wrote);
  return all ? Status() : Status(all.error());
}

Result<bool> FreeParts::clearSome(Connection& writer, std::size_t most_pages) {
  if (writer.sqlite() == nullptr) return true;  // PostgreSQL's pages are its own (deploy/OPERATIONS.md)
  bool all = true, wrote = false;
  {
    // nobody else writes meanwhile: what the file has is the database
    ASSIGN_OR_RETURN(const auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
    if (writer.walBytes() != 0) return false;
    ASSIGN_OR_RETURN(all, clearPages(writer.handle(), writer.path(), cleared_, most_pages, wrote));
  }
  // else the writer could write a page again as it was
  if (wrote && sqlite3_file_control(writer.handle(), "main", SQLITE_FCNTL_RESET_CACHE, nullptr) != SQLITE_OK)
    return Error{ErrorCode::kFailed, writer.path().string() + ": SQLite keeps its cache of pages"};
  return all;
}

}  // namespace needlelab
