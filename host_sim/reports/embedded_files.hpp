// Files that cmake/embed.cmake puts into the tool.
#pragma once

#include <string_view>

namespace bms::reports::embedded {

extern const std::string_view dygraph_js, dygraph_css,
    synchronizer_js;  // dygraphs, MIT licence, from the system's package
extern const std::string_view page_html, page_css, drawing_js, replay_html, replay_js, study_html, study_js,
    diagnosis_html, diagnosis_js, diagnosis_strip_js, diagnosis_regimes_js, diagnosis_law_js, diagnosis_isolability_js,
    proof_html, proof_js, fleet_html, fleet_js, live_html, live_css, live_js;  // host_sim/reports/page/

}  // namespace bms::reports::embedded
