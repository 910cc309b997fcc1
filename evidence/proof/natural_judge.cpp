#include "proof/natural_judge.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

namespace bms::proof {

namespace {

/// A limit this much smaller than what is there says that it would have been named.
constexpr double plainly_above = 2;

bool contains(const std::vector<std::string>& list, const std::string& id) {
  return std::find(list.begin(), list.end(), id) != list.end();
}

/// Returns true if one of those alike is this truth.
bool includes(const std::vector<Possible>& cause, const Truth& truth) {
  return std::any_of(cause.begin(), cause.end(), [&](const Possible& p) { return contains(truth.ids, p.id); });
}

Judgement judge_data_fault(const Answer& answer, const std::vector<Truth>& truths) {
  for (const std::string& fault : answer.data_faults) {
    if (std::any_of(truths.begin(), truths.end(), [&](const Truth& t) { return contains(t.ids, fault); }))
      return {.outcome = Outcome::right, .why = "", .sizes = ""};
  }
  return {.outcome = Outcome::wrong, .why = "the recording is blamed", .sizes = ""};
}

std::string size_text(const Possible& p, const Truth& truth) {
  if (!p.size.contains(truth.what)) return p.id;
  const double sigma = p.sigma.contains(truth.what) ? p.sigma.at(truth.what) : 0;
  return fmt::format("{} {:.4g} +- {:.2g} {}", p.id, p.size.at(truth.what), sigma, truth.unit);
}

void lower_to(Judgement& j, Outcome outcome, const std::string& why) {
  if (outcome < j.outcome) j.outcome = outcome;
  j.why += (j.why.empty() ? "" : "; ") + why;
}

/// Nothing that is named is this truth.
void judge_not_named(const Answer& answer, const Truth& truth, Judgement& j) {
  const bool blames_nothing = answer.verdict == "NO_MISMATCH" || answer.verdict == "NOT_TESTABLE";
  if (contains(truth.ids, answer.verdict)) return;
  const auto limit = answer.limits.find(truth.what);
  const double visible_from = truth.visible ? plainly_above : 1;
  if (answer.verdict == "NO_MISMATCH" && limit != answer.limits.end() &&
      std::abs(truth.value) > visible_from * limit->second)
    return lower_to(j, Outcome::wrong, fmt::format("says that {:.2g} would have shown", limit->second));
  if (!truth.visible && blames_nothing) {
    j.not_visible = true;
    return;
  }
  if (truth.visible || answer.verdict == "UNKNOWN") lower_to(j, Outcome::undecided, truth.what + " not named");
}

/// first: what is named of those alike.
void judge_size(const Possible& first, const Truth& truth, Judgement& j) {
  j.sizes += (j.sizes.empty() ? "" : ", ") + size_text(first, truth);
  if (!(truth.within > 0)) return;
  const auto size = first.size.find(truth.what);
  if (size == first.size.end()) {
    lower_to(j, Outcome::undecided, truth.what + " is one of several");
  } else if (!(std::abs(size->second - truth.value) <= truth.within)) {
    lower_to(j, truth.visible ? Outcome::size_off : Outcome::wrong, truth.what + " of another size");
  }
}

}  // namespace

const char* name_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::wrong:
      return "WRONG";
    case Outcome::undecided:
      return "undecided";
    case Outcome::size_off:
      return "SIZE OFF";
    case Outcome::right:
      return "right";
  }
  return "";
}

Judgement judge(const Answer& answer, const std::vector<Truth>& truths, const std::vector<std::string>& also) {
  if (answer.verdict == "DATA_FAULT") return judge_data_fault(answer, truths);
  Judgement j{.outcome = Outcome::right, .why = "", .sizes = ""};
  if (truths.empty() && answer.verdict == "UNKNOWN") lower_to(j, Outcome::undecided, "nothing is there");
  for (const std::vector<Possible>& cause : answer.causes) {
    const bool there = std::any_of(truths.begin(), truths.end(), [&](const Truth& t) { return includes(cause, t); }) ||
                       std::any_of(cause.begin(), cause.end(), [&](const Possible& p) { return contains(also, p.id); });
    if (!there) lower_to(j, Outcome::wrong, "names " + cause.front().id);
  }
  for (const Truth& truth : truths) {
    const auto named =
        std::find_if(answer.causes.begin(), answer.causes.end(), [&](const std::vector<Possible>& cause) {
          // one of several alike does not say that it is seen
          return truth.visible ? includes(cause, truth) : contains(truth.ids, cause.front().id);
        });
    if (named == answer.causes.end()) {
      judge_not_named(answer, truth, j);
      continue;
    }
    judge_size(named->front(), truth, j);
  }
  return j;
}

}  // namespace bms::proof
