// Cases that run in child processes: a child is a copy of this process with the world as it is at that moment, so a
// world is started once and continued in many ways.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace bms::world {

/// What a case reports. Values and texts are by name, for the tables.
struct Outcome {
  std::string name;
  bool good = true;
  std::string why;  ///< what was wrong
  std::map<std::string, double> values;
  std::map<std::string, std::string> texts;

  void fail(const std::string& what);
  double value(const std::string& name, double otherwise) const;
  std::string text(const std::string& name) const;
};

/// Starts children, `at_once` at a time. A child that ends without a report, or with an exception, has failed.
class Cases {
 public:
  explicit Cases(unsigned at_once) : at_once_(at_once) {}
  ~Cases();
  Cases(const Cases&) = delete;
  Cases& operator=(const Cases&) = delete;

  /// Waits for a free place, then runs the case in a child, unless its outcome is known or it belongs to another part.
  void start(const std::string& name, const std::function<void(Outcome&)>& body);
  /// Waits for all children. The outcomes are in the order of start().
  std::vector<Outcome> finish();
  /// Outcomes are written to this folder, and a case whose good outcome is there is not run again. Empty: none.
  std::filesystem::path kept;
  bool only_kept = false;   ///< runs nothing
  std::size_t first = 0;    ///< so many cases are left to other parts
  std::size_t largest = 0;  ///< runs at most so many cases; 0: any number
  double most_minutes = 0;  ///< starts no case later; 0: at any time
  /// No further case will be run.
  bool over() const;
  /// The next cases belong to other parts.
  bool elsewhere(std::size_t next) const { return seen_ + next <= first; }
  /// Counts cases that are not started at all.
  void leave_out(std::size_t next) { seen_ += next; }
  /// All outcomes in `kept`, by name.
  std::vector<Outcome> all_kept() const;
  /// Prints each outcome that is not good as soon as it is known.
  bool talks = true;

 private:
  struct Child {
    int pid, pipe;
    std::size_t number;
    std::string text;
    std::filesystem::path kept;  ///< file of the outcome; empty: none
  };
  void wait_for(std::size_t most);
  void ended(Child& child);
  std::filesystem::path file_of(const std::string& name) const;
  bool known(const std::string& name);

  unsigned at_once_;
  std::size_t seen_ = 0, run_ = 0;
  std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  std::vector<Child> running_;
  std::vector<Outcome> outcomes_;
};

/// Number of children at a time that this machine has processors for.
unsigned processors();

}  // namespace bms::world
