// The parts of the study. Each adds its tables and charts to a result.
#pragma once

#include <cstdint>
#include <vector>

#include "study/observations.hpp"
#include "study/study.hpp"

namespace bms::study {

/// Tables 4 to 6 with the polynomials of Eq. 17, 21 and 22, figures 5 to 8: every model with every optimiser,
/// identified from one data set and validated with another. with_paper: with the numbers of the paper next to them.
void compare_models(Fitter& fitter, const StudyData& estimation, const StudyData& validation, bool with_paper,
                    Observations& observed, StudyResult& result);

/// Tables 7 and 8: the grey box identified from each data set and validated with all. with_paper: the data sets are the
/// paper's seven experiments, in the order of its tables.
void cross_validate(Fitter& fitter, const std::vector<StudyData>& parts, bool with_paper, Observations& observed,
                    StudyResult& result);

/// Effect of filters on the current on the parameters (section 3.1): the same data set, whose current has an offset,
/// with several filters.
void compare_filters(Fitter& fitter, const StudyData& part, StudyResult& result);

/// Table 9, figures 12 to 14: grey box and OCV pieces at ten states of charge. seed: of the noise, incremented for each
/// run.
void identify_over_soc(Fitter& fitter, const Bench& bench, std::uint64_t& seed, StudyResult& result);

/// Section 2: Table 1, figures 2 to 4, and the three representations of the OCV.
void show_ocv_test(const Bench& bench, std::uint64_t seed, StudyResult& result);

/// Appendix A and figure A1, from the OCV test.
void show_appendix_a(const StudyData& test, StudyResult& result);

/// Initial states (3.2.4 and 4.2), next to the paper's.
void show_initial_states(const Fitter& fitter, const StudyData& from_test, const StudyData& from_bursts,
                         Observations& observed, StudyResult& result);

/// Errata of the paper, with their reasons.
void show_errata(StudyResult& result);

/// Where every part of the paper is, and the test that checks it (paper/audit.csv).
void show_audit(StudyResult& result);

/// Adds a verdict on every statement in the run that the tables show.
void judge_all(const Observations& observed, StudyResult& result);

}  // namespace bms::study
