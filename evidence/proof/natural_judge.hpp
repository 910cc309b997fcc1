// Is an answer about a fault that nobody put in right? What is truly there comes from a measurement that the diagnosis
// did not get.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace bms::proof {

/// One thing that is truly there.
struct Truth {
  std::string what;              ///< "contact"
  std::vector<std::string> ids;  ///< causes of which each is right; may contain UNKNOWN
  std::string unit;
  double value = 0;     ///< in `unit`; the size of a cause is compared with it
  double within = 0;    ///< by which the size may differ; 0: it is not compared
  bool visible = true;  ///< the diagnosis got what shows it. If not, to state that nothing is seen is right
  std::string how;      ///< how the value was measured
};

/// A cause that is named, or another one that the recordings cannot distinguish from it.
struct Possible {
  std::string id;
  std::map<std::string, double> size;   ///< by Truth::what
  std::map<std::string, double> sigma;  ///< standard deviation of it
};

/// What a diagnosis says.
struct Answer {
  std::string verdict;
  std::vector<std::vector<Possible>> causes;  ///< each with those alike; the first of each is the one that is named
  std::vector<std::string> data_faults;
  std::map<std::string, double> limits;  ///< by Truth::what: smallest size that would have been named
};

/// In ascending order of worth.
enum class Outcome { wrong, undecided, size_off, right };
const char* name_of(Outcome outcome);

struct Judgement {
  Outcome outcome = Outcome::wrong;
  std::string why;           ///< of an outcome that is not right
  bool not_visible = false;  ///< right, because what is there cannot be seen without the reference, and is not named
  std::string sizes;         ///< "contact 0.462 +- 0.004 ohm"
};

/// also: causes that are there as well and may be named or not.
Judgement judge(const Answer& answer, const std::vector<Truth>& truths, const std::vector<std::string>& also);

/// Returns true if an answer to more data is worth less than one to fewer.
inline bool made_worse(const Judgement& with_fewer, const Judgement& with_more) {
  return with_more.outcome < (with_fewer.not_visible ? Outcome::undecided : with_fewer.outcome);
}

}  // namespace bms::proof
