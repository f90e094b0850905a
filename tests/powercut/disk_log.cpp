#include "tests/powercut/disk_log.h"

#include <algorithm>
#include <fstream>
#include <stdexcept>

namespace needlelab::test {
namespace {

using Kind = DiskEvent::Kind;

void putText(std::ostream& out, const std::string& text) {
  const std::uint64_t size = text.size();
  out.write(reinterpret_cast<const char*>(&size), sizeof size);
  out.write(text.data(), static_cast<std::streamsize>(size));
}

std::string getText(std::istream& in) {
  std::uint64_t size = 0;
  in.read(reinterpret_cast<char*>(&size), sizeof size);
  if (!in || size > (std::uint64_t{1} << 32)) throw std::runtime_error("the log of a disk ends early");
  std::string text(size, '\0');
  in.read(text.data(), static_cast<std::streamsize>(size));
  return text;
}

void put(std::string& bytes, std::uint64_t offset, std::string_view data) {
  if (bytes.size() < offset + data.size()) bytes.resize(offset + data.size(), '\0');
  std::copy(data.begin(), data.end(), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
}

}  // namespace

void DiskLog::add(DiskEvent event) {
  const std::scoped_lock lock(mutex_);
  events_.push_back(std::move(event));
}

void DiskLog::mark(std::string name, std::uint64_t number, std::string data) {
  DiskEvent event;
  event.name = std::move(name);
  event.offset = number;
  event.data = std::move(data);
  add(std::move(event));
}

std::size_t DiskLog::begin() const {
  std::size_t at = 0;
  while (at < events_.size() && (events_[at].kind == Kind::kFile || events_[at].kind == Kind::kFolder)) ++at;
  return at;
}

void DiskLog::save(const std::filesystem::path& path) const {
  std::ofstream out(path, std::ios::binary);
  for (const DiskEvent& e : events_) {
    const std::uint64_t numbers[] = {static_cast<std::uint64_t>(e.kind), e.node, e.folder, e.to_folder,
                                     e.offset};
    out.write(reinterpret_cast<const char*>(numbers), sizeof numbers);
    for (const std::string* text : {&e.name, &e.to_name, &e.data}) putText(out, *text);
  }
}

DiskLog DiskLog::load(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  DiskLog log;
  std::uint64_t numbers[5];
  while (in.read(reinterpret_cast<char*>(numbers), sizeof numbers)) {
    DiskEvent e;
    e.kind = static_cast<Kind>(numbers[0]);
    e.node = static_cast<std::uint32_t>(numbers[1]);
    e.folder = static_cast<std::uint32_t>(numbers[2]);
    e.to_folder = static_cast<std::uint32_t>(numbers[3]);
    e.offset = numbers[4];
    for (std::string* text : {&e.name, &e.to_name, &e.data}) *text = getText(in);
    log.events_.push_back(std::move(e));
  }
  if (log.events_.empty()) throw std::runtime_error("no log of a disk in " + path.string());
  return log;
}

const char* nameOf(CutOutcome outcome) {
  switch (outcome) {
    case CutOutcome::kNothing:
      return "nothing unsynced survives";
    case CutOutcome::kEverything:
      return "everything survives";
    case CutOutcome::kInOrder:
      return "what came first survives";
    case CutOutcome::kPerFile:
      return "some files survive whole";
    case CutOutcome::kSectors:
      return "any sectors survive";
  }
  return "?";
}

/// The choices of one power cut for the whole disk.
struct DiskReplay::Choice {
  CutOutcome outcome = CutOutcome::kNothing;
  std::uint64_t sector = 512;
  double survives = 0.5;     ///< probability for each sector, or each file
  std::size_t in_order = 0;  ///< events before this one survive, this one torn
  double size_survives = 0;  ///< probability that a file grew without its bytes
  bool garbage = false;      ///< such bytes are garbage instead of zeros
};

void DiskReplay::advanceTo(std::size_t instant) {
  for (const std::size_t end = std::min(instant, log_.events().size()); at_ < end; ++at_) play(at_);
}

void DiskReplay::play(std::size_t number) {
  const DiskEvent& e = log_.events()[number];
  const Change change{number, false, false};
  switch (e.kind) {
    case Kind::kFile:
      files_[e.node] = {e.data, {}, e.name};
      folders_[e.folder].synced[e.name] = e.node;
      break;
    case Kind::kFolder:
      folders_[e.node];
      folders_[e.folder].synced[e.name] = e.node;
      break;
    case Kind::kCreate:
      files_[e.node].name = e.name;
      folders_[e.folder].since.push_back(number);
      break;
    case Kind::kMkdir:
      folders_[e.node];
      folders_[e.folder].since.push_back(number);
      break;
    case Kind::kWrite:
    case Kind::kTruncate:
      files_[e.node].since.push_back(change);
      break;
    case Kind::kSync:
      if (folders_.contains(e.node))
        syncFolder(e.node);
      else
        syncFile(files_[e.node]);
      break;
    case Kind::kSyncFailed:
      if (const auto file = files_.find(e.node); file != files_.end())
        for (Change& one : file->second.since) one.doomed = !one.sure;
      break;
    case Kind::kRename:
      if (const auto file = files_.find(e.node); file != files_.end()) file->second.name = e.to_name;
      folders_[e.folder].since.push_back(number);
      if (e.to_folder != e.folder) folders_[e.to_folder].since.push_back(number);
      break;
    case Kind::kLink:
      folders_[e.to_folder].since.push_back(number);
      break;
    case Kind::kRemove:
      folders_[e.folder].since.push_back(number);
      break;
    case Kind::kMark:
      break;
  }
}

void DiskReplay::syncFile(File& file) {
  // data of a failed sync stay uncertain, below the data that are certain now
  if (std::any_of(file.since.begin(), file.since.end(), [](const Change& c) { return c.doomed; })) {
    for (Change& change : file.since) change.sure = !change.doomed;
    return;
  }
  for (const Change& change : file.since) {
    const DiskEvent& e = log_.events()[change.event];
    if (e.kind == Kind::kTruncate)
      file.synced.resize(e.offset);
    else
      put(file.synced, e.offset, e.data);
  }
  file.since.clear();
}

void DiskReplay::apply(const DiskEvent& e, std::uint32_t folder,
                       std::map<std::string, std::uint32_t>& entries) const {
  switch (e.kind) {
    case Kind::kCreate:
    case Kind::kMkdir:
      entries[e.name] = e.node;
      break;
    case Kind::kRemove:
      entries.erase(e.name);
      break;
    case Kind::kLink:
      entries[e.to_name] = e.node;
      break;
    case Kind::kRename:
      if (e.folder == folder) entries.erase(e.name);
      if (e.to_folder == folder) entries[e.to_name] = e.node;
      break;
    default:
      break;
  }
}

void DiskReplay::syncFolder(std::uint32_t node) {
  Folder& folder = folders_[node];
  for (const std::size_t number : folder.since) apply(log_.events()[number], node, folder.synced);
  folder.since.clear();
}

bool DiskReplay::hasUnsynced(std::string_view name_end) const {
  return std::any_of(files_.begin(), files_.end(), [&](const auto& entry) {
    const File& file = entry.second;
    return file.name.ends_with(name_end) && std::any_of(file.since.begin(), file.since.end(),
                                                        [](const Change& c) { return !c.sure && !c.doomed; });
  });
}

std::string DiskReplay::contentAfter(const File& file, const Choice& choice, Random& random) const {
  std::string bytes = file.synced;
  const bool whole_file = choice.outcome == CutOutcome::kPerFile && random.chance(choice.survives);
  for (const Change& change : file.since) {
    const DiskEvent& e = log_.events()[change.event];
    // 1 survives, 0 does not, between them: sector by sector
    double chance = 0;
    switch (choice.outcome) {
      case CutOutcome::kNothing:
        break;
      case CutOutcome::kEverything:
        chance = change.doomed ? 0 : 1;
        break;
      case CutOutcome::kInOrder:
        chance = change.event < choice.in_order ? 1 : change.event == choice.in_order ? 0.5 : 0;
        break;
      case CutOutcome::kPerFile:
        chance = whole_file ? 1 : 0;
        break;
      case CutOutcome::kSectors:
        chance = choice.survives;
        break;
    }
    if (change.sure) chance = 1;
    if (e.kind == Kind::kTruncate) {
      if (random.chance(chance)) bytes.resize(e.offset, '\0');
      continue;
    }
    for (std::uint64_t at = 0; at < e.data.size();) {
      const std::uint64_t sector_end = ((e.offset + at) / choice.sector + 1) * choice.sector - e.offset;
      const std::uint64_t end = std::min<std::uint64_t>(sector_end, e.data.size());
      if (random.chance(chance)) {
        put(bytes, e.offset + at, std::string_view(e.data).substr(at, end - at));
      } else if (e.offset + end > bytes.size() && random.chance(choice.size_survives)) {
        const std::size_t before = bytes.size();
        bytes.resize(e.offset + end, '\0');
        if (choice.garbage)
          for (std::size_t i = before; i < bytes.size(); ++i) bytes[i] = static_cast<char>(random.bits());
      }
      at = end;
    }
  }
  return bytes;
}

void DiskReplay::write(std::uint32_t node, const Choice& choice, Random& random,
                       const std::filesystem::path& path) const {
  if (const auto file = files_.find(node); file != files_.end()) {
    std::ofstream(path, std::ios::binary) << contentAfter(file->second, choice, random);
    std::filesystem::permissions(path,
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    return;
  }
  std::filesystem::create_directory(path);
  const Folder& folder = folders_.at(node);
  auto entries = folder.synced;
  const bool all_entries = choice.outcome == CutOutcome::kPerFile && random.chance(choice.survives);
  for (const std::size_t number : folder.since) {
    bool survives = false;
    switch (choice.outcome) {
      case CutOutcome::kNothing:
        break;
      case CutOutcome::kEverything:
        survives = true;
        break;
      case CutOutcome::kInOrder:
        survives = number < choice.in_order;
        break;
      case CutOutcome::kPerFile:
        survives = all_entries;
        break;
      case CutOutcome::kSectors:
        survives = random.chance(choice.survives);
        break;
    }
    if (survives) apply(log_.events()[number], node, entries);
  }
  for (const auto& [name, entry] : entries) write(entry, choice, random, path / name);
}

void DiskReplay::cut(CutOutcome outcome, Random& random, const std::filesystem::path& folder) const {
  Choice choice;
  choice.outcome = outcome;
  choice.sector = random.chance(0.5) ? 512 : 4096;
  constexpr double kChances[] = {0.1, 0.5, 0.9};
  choice.survives = kChances[random.below(3)];
  choice.size_survives = outcome == CutOutcome::kSectors ? 0.3 : 0;
  choice.garbage = random.chance(0.3);
  // some instant since the oldest event that is still unsynced
  std::size_t first = at_;
  for (const auto& [node, file] : files_)
    if (!file.since.empty()) first = std::min(first, file.since.front().event);
  for (const auto& [node, one] : folders_)
    if (!one.since.empty()) first = std::min(first, one.since.front());
  choice.in_order = first + random.below(at_ - first + 1);
  write(kRootNode, choice, random, folder);
}

}  // namespace needlelab::test
