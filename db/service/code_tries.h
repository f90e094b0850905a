/// Where the wrong codes of trainees, and wrong old passwords, are counted: in memory, or for several servers
/// on one database there.
#pragma once

#include <string>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "db/service/code_guard.h"
#include "db/shared_logins.h"

namespace needlelab {

/// As CodeGuard. Errors: kUnavailable, where the database is away. Thread: any; may wait for the database.
class CodeTries {
 public:
  virtual ~CodeTries() = default;
  CodeTries() = default;
  CodeTries(const CodeTries&) = delete;
  CodeTries& operator=(const CodeTries&) = delete;

  virtual Result<CodeGuard::Try> begin(const std::string& name) = 0;
  virtual Status forget(const std::string& name) = 0;
  virtual Status giveBack(const std::string& name) = 0;
};

class CodesInMemory final : public CodeTries {
 public:
  explicit CodesInMemory(TimeSource& time) : guard_(time) {}
  Result<CodeGuard::Try> begin(const std::string& name) override { return guard_.begin(name); }
  Status forget(const std::string& name) override {
    guard_.forget(name);
    return {};
  }
  Status giveBack(const std::string& name) override {
    guard_.giveBack(name);
    return {};
  }

 private:
  CodeGuard guard_;
};

/// The wait of a person holds at each server, and all servers together let pass as many tries as one.
class CodesInStore final : public CodeTries {
 public:
  /// `shared` must outlive it.
  explicit CodesInStore(SharedLogins& shared) : shared_(shared) {}
  Result<CodeGuard::Try> begin(const std::string& name) override;
  Status forget(const std::string& name) override;
  Status giveBack(const std::string& name) override;

 private:
  SharedLogins& shared_;
};

}  // namespace needlelab
