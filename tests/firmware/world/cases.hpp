// Cases that run in child processes: a child is a copy of this process with the world as it is at that moment, so a
// world is started once and continued in many ways.
#pragma once

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

  /// Waits for a free place, then runs the case in a child.
  void start(const std::string& name, const std::function<void(Outcome&)>& body);
  /// Waits for all children. The outcomes are in the order of start().
  std::vector<Outcome> finish();
  /// Outcomes are written to this folder, and a case whose good outcome is there is not run again. Empty: none.
  std::filesystem::path kept;
  bool only_kept = false;  ///< runs nothing
  /// All outcomes in `kept`, by name.
  std::vector<Outcome> all_kept() const;
  /// Prints each outcome that is not good as soon as it is known.
  bool talks = true;

 private:
  struct Child {
    int pid, pipe;
    std::size_t number;
    std::string text;
  };
  void wait_for(std::size_t most);
  void ended(Child& child);
  std::filesystem::path file_of(const std::string& name) const;
  bool known(const std::string& name);

  unsigned at_once_;
  std::vector<Child> running_;
  std::vector<Outcome> outcomes_;
};

/// Number of children at a time that this machine has processors for.
unsigned processors();

}  // namespace bms::world
