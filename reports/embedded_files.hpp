// Files that are part of the tool, put into it by cmake/embed.cmake.
#pragma once

#include <string_view>

namespace bms::reports::embedded {

extern const std::string_view dygraph_js, dygraph_css,
    synchronizer_js;  // dygraphs, MIT licence, from the system's package
extern const std::string_view page_html, page_css, drawing_js, replay_html, replay_js, study_html, study_js,
    diagnosis_html, diagnosis_js, proof_html, proof_js, live_html, live_css, live_js;  // host_sim/report/

}  // namespace bms::reports::embedded
