// What a diagnosis says about its causes.
#include "diagnosis/texts.hpp"

#include <gmock/gmock.h>

namespace bms::diagnosis {
namespace {

template <class... M>
Diagnosis with_causes() {
  Diagnosis d;
  d.verdict = Verdict::causes;
  d.explained_share = 0.98;
  for (const std::size_t m : {model::mechanism_index_of<M>...}) {
    Finding& f = d.findings.emplace_back();
    f.setting.index = m;
  }
  return d;
}

TEST(Texts, ManyChangesOfACellAreAlsoWhatAnotherCellsFileLooksLike) {
  const auto asks_for_the_file = ::testing::HasSubstr("the file of another cell");
  EXPECT_THAT(statement(with_causes<model::ResistanceGrowth, model::PolarisationGrowth, model::OcvHysteresis>(), {}),
              asks_for_the_file);
  EXPECT_THAT(statement(with_causes<model::ResistanceGrowth, model::CurrentOffset, model::InitialSoc>(), {}),
              ::testing::Not(asks_for_the_file))
      << "an instrument and a start";
}

}  // namespace
}  // namespace bms::diagnosis
