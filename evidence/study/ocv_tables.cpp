// Section 2 and Appendix A: OCV from the test with ten minutes of rest, Table 1, and the circuit read from a rest.
#include <cmath>

#include "identification/rest_reading.hpp"
#include "model/ocv_voltage.hpp"
#include "study/study_tables.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

constexpr int fine_steps = 40;
constexpr double appendix_soc = 0.8;

/// OCV of pieces at a SOC; from below at an edge.
double piece_v(double b0_v, double b1_v, double soc) { return b0_v + b1_v * soc; }

void add_table1(const std::vector<id::RestedVoltage>& rests, StudyResult& result) {
  const auto down = id::even_pieces(points_of(rests, id::OcvDirection::discharge)),
             up = id::even_pieces(points_of(rests, id::OcvDirection::charge));
  files::PageTable table{"table1",
                         "OCV pieces from the test with ten minutes of rest, and the two tables of the paper",
                         {"soc", "b0, discharge [V]", "b1, discharge [V]", "b0, charge [V]", "b1, charge [V]",
                          "Table 9: b0 [V]", "Table 9: b1 [V]", "Table 1 minus Table 9 at this soc"},
                         {},
                         ""};
  double squares = 0, middle_squares = 0;
  int middle = 0;
  for (std::size_t k = 0; k < paper_table(1).rows(); ++k) {
    const double soc = 0.1 * static_cast<double>(k + 1);
    const double b0_1 = paper_table(1).at(k, 0), b1_1 = paper_table(1).at(k, 1);
    const double b0_9 = paper_table(9).at(k, 3), b1_9 = paper_table(9).at(k, 4);
    const double difference_v = piece_v(b0_1, b1_1, soc) - piece_v(b0_9, b1_9, soc);
    squares += difference_v * difference_v;
    if (k >= 2 && k < 9) {
      middle_squares += difference_v * difference_v;
      ++middle;
    }
    table.rows.push_back({label(fmt::format("{:.0f} %", 100 * soc)), number_cell(down.b0_v[k], b0_1),
                          number_cell(down.b1_v[k], b1_1), number_cell(up.b0_v[k]), number_cell(up.b1_v[k]),
                          number_cell(b0_9), number_cell(b1_9), millivolt_cell(difference_v)});
  }
  table.note = fmt::format(
      "The paper has two OCV curves for one cell. Table 1 comes from rests of ten minutes, Table 9 from bursts without "
      "a "
      "rest. At the tenths they differ by {:.1f} mV RMS, between 30 and 90 % by {:.1f} mV. Rests after discharge lie "
      "below "
      "the OCV by the half gap of the hysteresis and by what has not relaxed; the equations of the paper have no place "
      "for either. This simulated cell has neither, so its branches agree.",
      1e3 * std::sqrt(squares / static_cast<double>(paper_table(1).rows())), 1e3 * std::sqrt(middle_squares / middle));
  result.tables.push_back(std::move(table));
}

void add_representations(const std::vector<id::RestedVoltage>& rests, StudyResult& result) {
  const id::OcvPoints all = points_of(rests, id::OcvDirection::middle);
  const auto pieces = id::even_pieces(all);
  const auto coefficients = id::polynomial(all);
  files::PageTable table{
      "ocv_representations",
      "Three representations of the OCV (section 2), against the true OCV of the simulated cell",
      {"representation", "numbers stored", "RMS error", "largest error", "RMS error, 20 to 90 %"},
      {},
      "The look-up table has a value for each of the 41 rests. The polynomial of order seven is fitted "
      "to them; the pieces are ten straight lines through every fourth."};
  const auto add = [&](const std::string& name, std::size_t numbers, const auto& ocv_v) {
    double squares = 0, largest = 0, inner = 0;
    constexpr int points = 1'000;
    int inner_points = 0;
    for (int k = 0; k < points; ++k) {
      const double soc = (k + 0.5) / points, error_v = std::abs(ocv_v(soc) - true_ocv_v(soc));
      squares += error_v * error_v / points;
      largest = std::max(largest, error_v);
      if (soc < 0.2 || soc > 0.9) continue;
      inner += error_v * error_v;
      ++inner_points;
    }
    table.rows.push_back({label(name), label(fmt::format("{}", numbers)), millivolt_cell(std::sqrt(squares)),
                          millivolt_cell(largest), millivolt_cell(std::sqrt(inner / inner_points))});
  };
  add("look-up table", all.soc.size(), [&](double soc) { return all.at(soc); });
  add("polynomial of order 7", coefficients.size(), [&](double soc) { return id::polynomial_at(coefficients, soc); });
  add("ten pieces", 2 * pieces.b0_v.size, [&](double soc) { return model::ocv_voltage(pieces, soc); });
  result.tables.push_back(std::move(table));

  files::PageChart curve{"OCV over state of charge (Fig. 2): rested voltages, ten pieces, polynomial",
                         {"after discharge, V", "after charge, V", "ten pieces, V", "polynomial, V"},
                         {},
                         {{}, {}, {}, {}}};
  curve.x_title = "state of charge, %";
  const id::OcvPoints down = points_of(rests, id::OcvDirection::discharge),
                      up = points_of(rests, id::OcvDirection::charge);
  for (const double soc : down.soc) {
    curve.time_s.push_back(100 * soc);
    curve.columns[0].push_back(down.at(soc));
    curve.columns[1].push_back(up.at(soc));
    curve.columns[2].push_back(model::ocv_voltage(pieces, soc));
    curve.columns[3].push_back(id::polynomial_at(coefficients, soc));
  }
  result.charts.push_back(std::move(curve));
}

/// Fig. 3: the same test on a cell with hysteresis.
void add_hysteresis_chart(Bench bench, std::uint64_t seed, StudyResult& result) {
  constexpr double half_gap_v = 0.012;
  bench.left_out.half_gap_v = half_gap_v;
  const auto rests = id::rested_voltages(run_ocv_test(fine_steps, bench, seed, true).data, 1);
  const id::OcvPoints down = points_of(rests, id::OcvDirection::discharge),
                      up = points_of(rests, id::OcvDirection::charge);
  files::PageChart chart{"Hysteresis of a cell with a half gap of 12 mV (Fig. 3)",
                         {"after discharge, V", "after charge, V"},
                         {},
                         {{}, {}}};
  chart.x_title = "state of charge, %";
  for (const double soc : down.soc) {
    chart.time_s.push_back(100 * soc);
    chart.columns[0].push_back(down.at(soc));
    chart.columns[1].push_back(up.at(soc));
  }
  result.charts.push_back(std::move(chart));
}

}  // namespace

void show_ocv_test(const Bench& bench, std::uint64_t seed, StudyResult& result) {
  const StudyData test = run_ocv_test(fine_steps, bench, seed, true);
  const std::vector<id::RestedVoltage> rests = id::rested_voltages(test.data, 1);
  add_table1(rests, result);
  add_representations(rests, result);
  add_hysteresis_chart(bench, seed, result);
  files::PageChart whole{"Complete OCV test: current and voltage (Fig. 4)",
                         {"voltage, V", "current, A"},
                         test.data.time_s.copy(),
                         {test.data.voltage_v.copy(), test.data.current_a.copy()}};
  whole.right = {"current, A"};
  result.charts.push_back(std::move(whole));
}

void show_appendix_a(const StudyData& test, StudyResult& result) {
  files::PageTable table{"appendix_a",
                         "R0, R1, C1 from the rest at 80 % (Appendix A)",
                         {"read from", "R0 [ohm]", "R1 [ohm]", "C1 [F]"},
                         {},
                         "The points are the samples next to the step, as printed; the fit is an exponential over the "
                         "whole rest, carried back to the step. The paper's points give a time constant of 160 s where "
                         "its Table 9 has 12 s: the rest contains a relaxation that Table 9 does not have."};
  double soc = test.soc_from;
  std::size_t k = 0;
  const id::RestReadings readings = id::read_rests(test.data);
  for (const id::RestReading& rest : readings.rests) {
    for (; k + 1 < test.data.size() && test.data.time_s[k + 1] <= rest.time_s; ++k)
      soc += test.data.current_a[k + 1] * (test.data.time_s[k + 1] - test.data.time_s[k]) /
             (3'600 * test.data.capacity_ah);
    if (rest.load_a > 0 || std::abs(soc - appendix_soc) > 0.02) continue;
    const id::PointReading& p = rest.points;
    table.rows.push_back({label("points a, b, c, d"), number_cell(p.r0_ohm, paper_start.r0_ohm),
                          number_cell(p.r1_ohm, paper_start.r1_ohm), number_cell(p.c1_f, paper_start.c1_f)});
    table.rows.push_back({label("exponential"), uncertain_cell(rest.r0_ohm, rest.r0_std_ohm),
                          uncertain_cell(rest.r1_ohm, rest.r1_std_ohm), uncertain_cell(rest.c1_f, rest.c1_std_f)});
    table.rows.push_back({label("Table 9 at 80 %"), number_cell(paper_table(9).at(7, 0)),
                          number_cell(paper_table(9).at(7, 1)), number_cell(paper_table(9).at(7, 2))});
    constexpr double before_s = 30, after_s = 120;
    files::PageChart chart{fmt::format("Points of Appendix A at 80 % (Fig. A1): a {:.4f}, b {:.4f}, d {:.4f} V after "
                                       "{:.1f} s, c {:.4f} V at the end of the rest",
                                       p.a_v, p.b_v, p.d_v, p.time_constant_s, p.c_v),
                           {"voltage, V", "d, V"},
                           {},
                           {{}, {}}};
    for (std::size_t row = 0; row < test.data.size(); ++row) {
      const double t = test.data.time_s[row] - rest.time_s;
      if (t < -before_s || t > after_s) continue;
      chart.time_s.push_back(t);
      chart.columns[0].push_back(test.data.voltage_v[row]);
      chart.columns[1].push_back(p.d_v);
    }
    result.charts.push_back(std::move(chart));
    break;
  }
  result.tables.push_back(std::move(table));
}

}  // namespace bms::study
