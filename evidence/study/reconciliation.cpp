#include "study/reconciliation.hpp"

#include <cmath>

#include <fmt/format.h>

namespace bms::study {

namespace {

/// Square root of the 99 % quantile of chi-squared over its degrees of freedom, for independent_figures.
constexpr std::array<double, 5> limits = {1.443, 1.443, 1.945, 2.146, 1.945};

double rms_of(const std::vector<double>& d, const std::vector<Figure>& published, std::size_t group) {
  double squares = 0, count = 0;
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (static_cast<std::size_t>(published[k].group) != group) continue;
    squares += d[k] * d[k];
    ++count;
  }
  return std::sqrt(squares / count) / expected_difference[group];
}

std::string title_of(const std::string& table) { return table == "A" ? "Appendix A" : "Table " + table; }

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (k > 0) text += k + 1 == names.size() ? " and " : ", ";
    text += names[k];
  }
  return text;
}

}  // namespace

const char* TableMisfit::verdict() const {
  if (contradicts()) return "contradicts this cell";
  return predicted() ? "agrees" : "agrees, but the other tables do not predict it";
}

std::vector<TableMisfit> table_misfits(const std::vector<Figure>& simulated,
                                       const std::vector<std::vector<Figure>>& left_out,
                                       const std::vector<Figure>& published) {
  const std::vector<double> d = differences(simulated, published);
  std::vector<TableMisfit> all;
  for (std::size_t g = 0; g < figure_group_names.size(); ++g) {
    TableMisfit m{title_of(figure_group_names[g]), rms_of(d, published, g), std::nullopt, limits[g], "", 0};
    if (g < left_out.size() && !left_out[g].empty())
      m.left_out = rms_of(differences(left_out[g], published), published, g);
    for (std::size_t k = 0; k < d.size(); ++k) {
      const double size = std::abs(d[k]) / expected_difference[g];
      if (static_cast<std::size_t>(published[k].group) != g || size <= m.worst) continue;
      m.worst = size;
      m.worst_figure = published[k].name;
    }
    all.push_back(m);
  }
  return all;
}

std::string reconciliation_text(const std::vector<TableMisfit>& misfits) {
  std::vector<std::string> contradicting, alone;
  for (const TableMisfit& m : misfits) {
    if (m.contradicts())
      contradicting.push_back(fmt::format("{} ({:.1f} times the expected difference)", m.table, m.used));
    else if (!m.predicted())
      alone.push_back(m.table);
  }
  std::string text = contradicting.empty() ? "No table contradicts this cell as a whole."
                                           : "It contradicts " + listed(contradicting) + ".";
  if (!alone.empty()) text += " The other tables do not predict " + listed(alone) + ".";
  return text;
}

}  // namespace bms::study
