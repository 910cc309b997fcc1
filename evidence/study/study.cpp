#include "study/study.hpp"

#include <array>
#include <chrono>
#include <filesystem>
#include <tuple>

#include <fmt/format.h>

#include "experiments/experiment.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "identification/identify.hpp"
#include "measurement/recording_checks.hpp"
#include "study/best_experiment.hpp"
#include "study/statistics.hpp"
#include "study/study_tables.hpp"
#include "workflow/identification_data.hpp"

namespace bms::study {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double pulse_start_soc = 0.41;
constexpr int ocv_steps = 10;
constexpr std::size_t model_fits = 2 * models * methods.size(), filter_fits = 6;

/// Figures 9 to 11.
void add_profile_charts(StudyResult& result) {
  for (const auto& [name, title] : {std::pair{"forklift_shift", "The forklift's current (Fig. 9), A"},
                                    std::pair{"rest_30s", "Short pulses with rests (Fig. 10), A"},
                                    std::pair{"high_1m_low_30s", "Long bursts without (Fig. 11), A"}}) {
    files::PageChart chart{title, {"A"}, {}, {{}}};
    const auto profile = experiments::experiment(name).value();
    for (const experiments::ProfileRow& row : profile) {
      chart.time_s.push_back(row.time_s);
      chart.columns[0].push_back(row.current_a);
    }
    result.charts.push_back(std::move(chart));
  }
}

void finish(const Fitter& fitter, Clock::time_point begin, StudyResult& result) {
  result.fits += fitter.done();
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Throws BadInput or std::invalid_argument if nothing can be identified from the recording.
StudyData part_of(const std::string& path, const model::CellParameters<>& cell, StudyResult& result) {
  measurement::Recording r = files::read_recording(path);
  measurement::compare_with_cell(r, cell);
  const workflow::IdentificationData d = workflow::identification_data(r, {{std::nullopt, false}, {}, cell});
  identification::reject_without_excitation(d.record);
  for (const measurement::Warning& w : r.warnings) result.warnings.push_back({w.id, path + ": " + w.text});
  return {std::filesystem::path(path).stem().string(), d.record.data, d.record.initial_soc, d.soc_min, d.soc_max};
}

}  // namespace

StudyResult study_plant(const model::CellParameters<>& cell, const StudyOptions& options,
                        const StudyProgress& progress) {
  const auto begin = Clock::now();
  StudyResult result;
  result.source = "the plant (Table 9 made smooth), samples every second with 1 mV and 10 mA of noise";
  Fitter fitter(cell, model_fits + paper_experiments + filter_fits + 1, progress);
  std::uint64_t seed = options.seed;
  const Bench bench;
  show_ocv_test(bench, seed, result);
  add_profile_charts(result);

  Observations observed;
  const StudyData ocv = run_ocv_test(ocv_steps, bench, seed, true);
  const StudyData estimation = window(ocv, "OCV test with 10 min rest, 80 to 50 %", 0.8, 0.5);
  compare_models(fitter, estimation, window(ocv, "OCV test with 10 min rest, 50 to 20 %", 0.5, 0.2), true, observed,
                 result);
  show_appendix_a(ocv, result);

  std::vector<StudyData> parts;
  for (std::size_t k = 0; k < ocv_experiment; ++k)
    parts.push_back(run_on_bench(experiment_names[k], pulse_start_soc, bench, ++seed));
  parts.push_back(window(run_on_bench("ocv_1h_rest", 1, bench, ++seed, 0.29), "ocv_1h_rest, 50 to 30 %", 0.5, 0.3));
  cross_validate(fitter, parts, true, observed, result);
  show_initial_states(fitter, estimation, parts[burst_experiment], observed, result);
  compare_filters(fitter, parts[burst_experiment], result);
  identify_over_soc(fitter, bench, seed, result);
  show_errata(result);
  observed.not_run = "this run has no numbers for it; the table of shares has";
  judge_all(observed, result);
  if (options.seeds > 0) {
    add_statistics(cell, options.seeds, options.seed, {}, result);
    add_success_maps(cell, options.seed, result);
    add_best_experiment(result);
  }
  show_audit(result);
  finish(fitter, begin, result);
  return result;
}

StudyResult study_recordings(const model::CellParameters<>& cell, const std::vector<std::string>& paths,
                             const StudyOptions& options, const StudyProgress& progress) {
  const auto begin = Clock::now();
  StudyResult result;
  std::vector<StudyData> parts;
  std::string skipped;
  for (const std::string& path : paths) {
    try {
      parts.push_back(part_of(path, cell, result));
    } catch (const std::exception& refused) {
      skipped += fmt::format("{}{}", skipped.empty() ? "" : "; ", refused.what());
      result.warnings.push_back({"skipped", fmt::format("{} is not used: {}", path, refused.what())});
    }
  }
  if (parts.size() < 2)
    throw files::BadInput(
        "--recordings", 1,
        fmt::format("fewer than two recordings that can be used, expected one to identify from and one "
                    "to validate with{}",
                    skipped.empty() ? "" : "; not used: " + skipped));
  result.source = fmt::format("{} recordings", parts.size());
  if (parts.size() < paths.size()) result.source += fmt::format(", {} are not used", paths.size() - parts.size());
  Fitter fitter(cell, model_fits + parts.size(), progress);
  Observations observed;
  observed.not_run = "the recordings are not the experiments of the paper";
  compare_models(fitter, parts[0], parts[1], false, observed, result);
  cross_validate(fitter, parts, false, observed, result);
  judge_all(observed, result);
  if (options.seeds > 0) add_statistics(cell, options.seeds, options.seed, parts, result);
  finish(fitter, begin, result);
  return result;
}

}  // namespace bms::study
