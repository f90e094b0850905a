/// Keeps an import from bringing back who was erased after the records were made. Private to this folder.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/erasure_list.h"
#include "db/pseudonyms.h"
#include "db/service/name_index.h"
#include "db/service/record_tables.h"

namespace needlelab {

/// State of one import; records must come in import order, people first. Thread: the writer's.
class ImportErasures {
 public:
  /// Reads the erasures from the database and the file beside it. kCorrupt: there are erasures, but the key
  /// that identifies the people is missing.
  static Result<ImportErasures> open(Connection& writer);

  enum class Verdict {
    kTake,     ///< perhaps with pseudonyms in place of names
    kLeftOut,  ///< belongs to an erased person
  };
  /// For every record of the import, before the first look; it may have any shape. Tells which sessions an
  /// erasure left on purpose, because they waited under the name and may be another person's, and which names
  /// the texts are searched for. kInvalidInput: too many of them for a search.
  Status foresee(const RecordJson& record);
  /// `record` has its table's types. May replace names in it by pseudonyms.
  Result<Verdict> look(const RecordTable& table, RecordJson& record);
  /// True when `there` differs from `record` only through a later erasure.
  [[nodiscard]] bool isErasuresWork(const RecordTable& table, const RecordJson& there,
                                    const RecordJson& record) const;

  struct Work {
    std::size_t people = 0;    ///< erased ones that were met in the records
    std::size_t replaced = 0;  ///< how often one person's names were replaced in one text
  };
  /// What grew with the records.
  [[nodiscard]] Work work() const { return {met_.size(), replaced_}; }

 private:
  explicit ImportErasures(Connection& writer) : writer_(writer) {}
  /// Whose names count for a record: everybody's, or only those of accounts. A name that was erased while
  /// nobody had it is no account's, and nobody did something under it.
  enum class Whose { kAnybodys, kAccounts };
  /// The erasure of the person with this name at the time of the record; null: that person was not erased
  /// since.
  const ErasureLine* erasureOf(const std::string& name, std::int64_t made_unix_ns,
                               Whose whose = Whose::kAnybodys) const;
  Result<bool> isOfErased(const RecordTable& table, const RecordJson& record);
  Result<bool> isOfErasedSession(const std::string& id_digits);
  /// True when the erasure left this session, which waits: the erasure was before the export, or the name was
  /// an account's. A name that nobody had was erased with its sessions.
  [[nodiscard]] bool wasLeft(const std::string& id_digits, const std::string& name,
                             const std::string& pseudonym) const;
  /// In a record of a session of an unknown trainee: the name that the station gave.
  Status replaceGiven(RecordJson& record);
  void replaceDoer(RecordJson& record, const char* doer, const char* when) const;
  [[nodiscard]] bool wasErased(const std::string& name) const;
  /// Notes a word by which the texts may name the person.
  Status expect(const std::string& word, const std::string& person);
  void meet(const std::string& name, const ErasureLine& erasure);
  /// Calls `replace` for each person met who is in the text, in the order in which they were met, with those
  /// names that are in it.
  template <typename Replace>
  Status eachNamedIn(const RecordTable& table, const std::string& text, const Replace& replace);

  Connection& writer_;
  std::optional<PseudonymKey> key_;
  std::vector<ErasureLine> lines_;
  std::map<PseudonymKey::Hash, std::vector<std::size_t>> lines_of_;  ///< of a name, in their order
  std::set<std::string> waiting_;   ///< ids in digits of the import's sessions that wait
  std::set<std::string> exported_;  ///< pseudonyms of the import's erasures
  std::set<std::string> accounts_;  ///< erased names that people of the import have
  struct Person {
    std::size_t number = 0;  ///< in the order in which they were met
    std::string pseudonym;
    bool typed = false;  ///< nobody had the name
    std::set<std::string> full_names;
    std::set<std::string> given;  ///< in small letters
  };
  std::map<std::string, Person> met_;  ///< found in this import, by name
  NameIndex index_;                    ///< of all who may be met
  std::size_t index_bytes_ = 0, replaced_ = 0;
  /// By kind of the records, each when the first of them needs it: the names of one person at a time, with
  /// the others of all. Who came with records of the kinds before is among these.
  std::map<std::string_view, ErasedNames> names_;
  std::map<std::string, bool> sessions_;       ///< by id in digits: true when it belongs to an erased person
  std::map<std::string, std::string> owners_;  ///< by id in digits: the erased person whose session it is
  std::map<std::string, std::string> perhaps_owners_;  ///< the same before any record is looked at
  std::set<std::string> session_texts_;                ///< ids of those that do, in the audit log's form
};

}  // namespace needlelab
