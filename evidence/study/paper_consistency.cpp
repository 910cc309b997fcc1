#include "study/paper_consistency.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "study/paper_tables.hpp"

namespace bms::study {

namespace {

constexpr std::size_t designs_with_rests = 3, output_column = 3;

double own_fit(std::size_t k) { return paper_table(7).at(k, k); }

/// A model fitted by least squares to data follows them at least as well as any other model of its structure does.
void add_diagonal(std::vector<Inconsistency>& all) {
  for (std::size_t column = 0; column < paper_experiments; ++column) {
    std::size_t best = column;
    for (std::size_t row = 0; row < paper_experiments; ++row) {
      if (paper_table(7).at(row, column) > paper_table(7).at(best, column)) best = row;
    }
    if (best == column) continue;
    all.push_back({fmt::format("Table 7, column {}", experiment_names[column]),
                   fmt::format("own model {:.2f} %, model of {} {:.2f} %", own_fit(column), experiment_names[best],
                               paper_table(7).at(best, column)),
                   "A least-squares fit cannot follow its own data worse than another model of the same structure: its "
                   "search did not end in the minimum, or the initial states were treated differently."});
  }
}

/// R0 std times the voltage's own size is constant: the deviations follow the current, not the residuals.
void add_deviations(std::vector<Inconsistency>& all) {
  const auto sd = published_voltage_sd_v();
  std::string products, ratios;
  for (std::size_t k = 0; k < designs_with_rests; ++k) {
    const double r0 = paper_table(8).at(k, 0);
    products += fmt::format("{}{:.3f}", k > 0 ? ", " : "", 1e3 * r0 * sd[k]);
    ratios += fmt::format("{}{:.2f}", k > 0 ? ", " : "", r0 / paper_table(8).at(k, output_column));
  }
  all.push_back({"Table 8, R0 of the designs with rests",
                 fmt::format("deviation times size of the voltage: {} (x 1e-3); deviation over output: {} per A",
                             products, ratios),
                 "The deviations follow the size of the signal and not the residuals of the fit: they are those for a "
                 "noise of fixed size (about 1 V), so they do not measure how well a parameter is known."});
}

void add_ocv_size(std::vector<Inconsistency>& all) {
  const auto sd = published_voltage_sd_v();
  const double largest_pulse = *std::max_element(sd.begin(), sd.begin() + ocv_experiment);
  all.push_back({"Table 7 and Table 8, OCV test",
                 fmt::format("the voltage has a standard deviation of {:.0f} mV, that of the pulses at most {:.0f} mV",
                             1e3 * sd[ocv_experiment], 1e3 * largest_pulse),
                 "Pulses of 6 A with an hour of rest around 40 % move the voltage by about 40 mV: the data of the OCV "
                 "test reach further than 40 % of SOC, which is not what the table says."});
}

void add_circuits(std::vector<Inconsistency>& all) {
  constexpr std::size_t at_40 = 3;
  const double six_s = paper_table(6).at(grey_box_model, 1) * paper_table(6).at(grey_box_model, 2),
               nine_s = paper_table(9).at(at_40, 1) * paper_table(9).at(at_40, 2);
  all.push_back({"Table 6, Table 9 and Appendix A",
                 fmt::format("R0 {:.4f} and {:.4f} ohm; time constants {:.0f}, {:.0f} and {:.0f} s",
                             paper_table(6).at(grey_box_model, 0), paper_table(9).at(at_40, 0), six_s, nine_s,
                             paper_start.r1_ohm * paper_start.c1_f),
                 "One RC branch has one time constant. The cell of the paper has several, so what a fit finds depends "
                 "on the experiment."});
}

}  // namespace

std::array<double, paper_experiments> published_voltage_sd_v() {
  std::array<double, paper_experiments> sd{};
  for (std::size_t k = 0; k < paper_experiments; ++k)
    sd[k] = paper_table(8).at(k, output_column) / (1 - own_fit(k) / 100);
  return sd;
}

std::vector<Inconsistency> inconsistencies() {
  std::vector<Inconsistency> all;
  add_diagonal(all);
  add_deviations(all);
  add_ocv_size(all);
  add_circuits(all);
  return all;
}

}  // namespace bms::study
