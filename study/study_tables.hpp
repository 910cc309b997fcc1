// The parts of the study. Each adds its tables, claims and charts to a result.
#pragma once

#include <cstdint>
#include <vector>

#include "study/fitter.hpp"
#include "study/study.hpp"
#include "study/study_data.hpp"

namespace bms::study {

/// Tables 4 to 6, figures 5 to 8: every model with every optimiser, identified from one data set and validated with
/// another. with_paper: with the numbers of the paper next to them.
void compare_models(Fitter& fitter, const StudyData& estimation, const StudyData& validation, bool with_paper,
                    StudyResult& result);

/// Tables 7 and 8: the grey box identified from each data set and validated with all. with_paper: the data sets are the
/// paper's seven experiments, in the order of its tables.
void cross_validate(Fitter& fitter, const std::vector<StudyData>& parts, bool with_paper, StudyResult& result);

/// Effect of filters on the current on the parameters (section 3.1): the same data set with several filters.
void compare_filters(Fitter& fitter, const StudyData& part, StudyResult& result);

/// Table 9, figures 12 to 14: the grey box at ten states of charge, on the plant. seed: of the noise, incremented for
/// each run.
void identify_over_soc(Fitter& fitter, std::uint64_t& seed, StudyResult& result);

}  // namespace bms::study
