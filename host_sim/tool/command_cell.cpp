// bms cell: checks, shows, scales and plots a cell file, and writes it as a header for firmware.
#include <algorithm>
#include <cctype>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/cell_header.hpp"
#include "reports/cell_charts.hpp"
#include "reports/json_cell.hpp"
#include "reports/report_page.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "workflow/cell_size.hpp"

namespace bms::tool {

namespace {

double ocv_at(const model::OcvTable<double>& ocv, std::size_t edge) {
  const std::size_t k = std::min(edge, ocv.b0_v.size - 1);
  return ocv.b0_v[k] + ocv.b1_v[k] * ocv.soc[edge];
}

/// What is accepted but unusual, each with a likely cause.
std::vector<std::string> doubts_of(const files::CellFile& cell) {
  const model::CellParameters<>& p = cell.parameters;
  std::vector<std::string> doubts;
  const double most_a = std::max(p.limits.charge_current_max_a, p.limits.discharge_current_max_a);
  if (most_a < 0.2 * p.capacity_ah || most_a > 30 * p.capacity_ah) {
    doubts.push_back(fmt::format("the limits allow {:g} A, the cell has {:g} Ah: they look like those of another cell",
                                 most_a, p.capacity_ah));
  }
  const double empty_v = ocv_at(p.ocv, 0), full_v = ocv_at(p.ocv, p.ocv.soc.size - 1);
  if (full_v > p.limits.voltage_max_v + 0.05 || empty_v < p.limits.voltage_min_v - 0.05) {
    doubts.push_back(fmt::format("the OCV is {:.3f} to {:.3f} V, the limits are {:g} to {:g} V", empty_v, full_v,
                                 p.limits.voltage_min_v, p.limits.voltage_max_v));
  }
  for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
    const double drop_v = p.capacity_ah * (p.rc.r0_ohm[k] + p.rc.r1_ohm[k]);
    if (drop_v > 1 || drop_v < 1e-3) {
      doubts.push_back(
          fmt::format("at {:.0f} % the 1C current drops {:.3g} V over R0 and R1: the resistances look like "
                      "those of a cell of another size",
                      100 * p.rc.soc[k], drop_v));
      break;
    }
  }
  for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
    if (p.rc.c1_f[k] < model::accepted::capacitance_f.high) continue;
    doubts.push_back(fmt::format("at {:.0f} % C1 is at the largest value that a cell file accepts, {:g} F",
                                 100 * p.rc.soc[k], model::accepted::capacitance_f.high));
    break;
  }
  return doubts;
}

/// "0.149 +- 0.014", with the unit.
std::string value_of(const model::MechanismSetting& m, std::size_t k) {
  const std::string_view unit = model::catalogue[m.index].parameter[k].unit;
  return fmt::format("{:.4g}{}{}", m.value[k], m.deviation[k] > 0 ? fmt::format(" +- {:.2g}", m.deviation[k]) : "",
                     unit == "1" ? "" : fmt::format(" {}", unit));
}

std::string values_of(const model::MechanismSetting& m) {
  const model::MechanismInfo& info = model::catalogue[m.index];
  std::string text;
  for (std::size_t k = 0; k < info.parameters; ++k)
    text += fmt::format("{}{} {}", k == 0 ? "" : ", ", info.parameter[k].name, value_of(m, k));
  return text;
}

/// ", with the findings below 5.10 Ah"; empty if no finding changes the capacity.
std::string capacity_text(const files::CellFile& cell) {
  for (const model::MechanismSetting& m : cell.mechanisms) {
    if (std::string_view(model::catalogue[m.index].id) == model::CapacityChange::id)
      return fmt::format(", with the findings below {:.3g} Ah", cell.parameters.capacity_ah * (1 - m.value[0]));
  }
  return "";
}

/// One line, or nothing if the file states none.
std::string pulses_text(const model::PulseRatings& p) {
  std::string text;
  const auto add = [&](double a, const char* what) {
    if (a != 0) text += fmt::format("{}{:g} A {}", text.empty() ? "" : ", ", a, what);
  };
  add(p.charge.for_10s_a, "charging for 10 s");
  add(p.charge.for_30s_a, "charging for 30 s");
  add(p.discharge.for_10s_a, "discharging for 10 s");
  add(p.discharge.for_30s_a, "discharging for 30 s");
  return text.empty() ? "" : fmt::format("  pulses  {}, from {:g} degrees C on\n", text, p.temperature_min_c);
}

std::string shown(const files::CellFile& cell) {
  const model::CellParameters<>& p = cell.parameters;
  std::string text = fmt::format("{}: {}, {:.5g} Ah{} at {:g} degrees C. {}\n", cell.name, cell.chemistry,
                                 p.capacity_ah, capacity_text(cell), p.reference_temperature_c, cell.source);
  const model::Limits& l = p.limits;
  text += fmt::format("  limits  {:g} to {:g} V, {:g} A charging, {:g} A discharging, {:g} to {:g} degrees C\n",
                      l.voltage_min_v, l.voltage_max_v, l.charge_current_max_a, l.discharge_current_max_a,
                      l.temperature_min_c, l.temperature_max_c);
  text += pulses_text(cell.pulses);
  text += fmt::format("  OCV     {:.3f} V empty, {:.3f} V full, {} straight pieces{}\n", ocv_at(p.ocv, 0),
                      ocv_at(p.ocv, p.ocv.soc.size - 1), p.ocv.b0_v.size,
                      p.ocv.half_gap_v.size > 0 ? ", with the gap between charge and discharge" : "");
  text += "  soc     R0, mOhm   R1, mOhm      C1, F   R1 C1, s\n";
  for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
    text += fmt::format("  {:3.0f} % {:10.4g} {:10.4g} {:10.4g} {:10.3g}\n", 100 * p.rc.soc[k], 1e3 * p.rc.r0_ohm[k],
                        1e3 * p.rc.r1_ohm[k], p.rc.c1_f[k], p.rc.r1_ohm[k] * p.rc.c1_f[k]);
  }
  for (const model::MechanismSetting& m : cell.mechanisms)
    text += fmt::format("  {}: {}.\n    {}\n", files::table_of(model::catalogue[m.index]),
                        diagnosis::capitalised(diagnosis::claim(m)), values_of(m));
  text.pop_back();
  return text;
}

files::PageContent plotted(const files::CellFile& cell) {
  files::PageContent page{
      "Cell " + cell.name,
      fmt::format("{}, {:.5g} Ah{}. {}", cell.chemistry, cell.parameters.capacity_ah, capacity_text(cell), cell.source),
      {},
      {},
      reports::cell_charts(cell)};
  files::PageTable found{"mechanisms", "Mechanisms and errors of instruments", {"table", "meaning", "values"}, {}, ""};
  for (const model::MechanismSetting& m : cell.mechanisms)
    found.rows.push_back({files::text_cell(files::table_of(model::catalogue[m.index])),
                          files::text_cell(diagnosis::capitalised(diagnosis::claim(m))),
                          files::text_cell(values_of(m))});
  if (!found.rows.empty()) page.tables.push_back(std::move(found));
  return page;
}

/// Accepts the argument of an #include: a path in brackets or in quotes.
CLI::Validator quoted() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        const auto path = [](char c) {
          return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.' || c == '/';
        };
        const bool marks = text.size() > 2 &&
                           ((text.front() == '<' && text.back() == '>') || (text.front() == '"' && text.back() == '"'));
        if (marks && std::all_of(text.begin() + 1, text.end() - 1, path)) return "";
        return "no argument of an #include, expected <FILE> or \"FILE\"";
      },
      "<FILE>", "include");
}

class CellCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c =
        *app.add_subcommand("cell", "Check, show, scale or plot a cell file, or write its header for firmware");
    c.footer("Example: bms cell scale table9 --capacity-ah 100 --out my_cell.toml");
    c.add_option("action", action_,
                 "check: what is unusual in it; show: its values; scale: to another capacity; plot; header: its "
                 "constants for the estimator in firmware of your own")
        ->required()
        ->check(CLI::IsMember({"check", "show", "scale", "plot", "header"}));
    c.add_option("file", cell_, cell_help())->required();
    c.add_option("--capacity-ah", capacity_ah_, "scale: capacity in Ah of the new cell")->check(Within(0.01, 1000.0));
    c.add_option("--out,-o", out_, "scale: cell file to write; header: C++ header to write")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_flag("--fixed", fixed_, "header: for a core without an FPU; refuses what needs one");
    c.add_option("--include", include_,
                 "header: what it includes instead of <greybox/model.hpp>, for example '\"greybox_single.hpp\"'")
        ->check(quoted());
    add_output(c, output_);
    return &c;
  }

  int run() override {
    output_.set_own(out_);
    output_.protect({cell_});
    files::CellFile cell = files::read_cell(cell_);
    if (action_ == "scale") return scale(cell);
    if (action_ == "header") return header(cell);
    if (action_ == "plot" && output_.report.empty())
      throw files::BadInput("bms cell plot", 1, "no page, expected --report FILE.html");
    if (!output_.report.empty()) write_output(output_.report, reports::page_of(plotted(cell)));
    const std::vector<std::string> doubts = doubts_of(cell);
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(cell, doubts));
    if (action_ == "show") print_summary(output_, shown(cell));
    if (action_ == "plot") print_summary(output_, "Page: " + output_.report);
    if (action_ != "check") return 0;
    std::string text = fmt::format("{}: {} doubt{}", cell_, doubts.size(), doubts.size() == 1 ? "" : "s");
    for (const std::string& doubt : doubts) text += "\n  " + doubt;
    print_summary(output_, text);
    return doubts.empty() ? 0 : 1;
  }

 private:
  int scale(files::CellFile& cell) const {
    if (capacity_ah_ <= 0 || out_.empty())
      throw files::BadInput("bms cell scale", 1, "no size or no file, expected --capacity-ah and --out");
    const double before_ah = cell.parameters.capacity_ah;
    for (const std::string& key : workflow::scale_to(capacity_ah_, cell)) {
      if (!key.empty()) warn(key + ": a scaled value is beyond what a cell file accepts; the bound is used");
    }
    cell.source = fmt::format("{} of {:g} Ah, scaled to {:g} Ah: {}", cell.name, before_ah, capacity_ah_, cell.source);
    const std::string text = files::cell_text(cell);
    files::parse_cell(text, out_);  // throws if it is not valid
    write_output(out_, text);
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(cell, doubts_of(cell)));
    print_summary(output_, "Cell file: " + out_);
    return 0;
  }

  int header(const files::CellFile& cell) const {
    if (out_.empty()) throw files::BadInput("bms cell header", 1, "no file, expected --out FILE.hpp");
    if (fixed_) files::reject_if_fpu_needed(cell);
    write_output(out_, files::cell_header(cell, include_));
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(cell, doubts_of(cell)));
    if (out_ != "-") print_summary(output_, "Header: " + out_);
    return 0;
  }

  std::string action_, cell_, out_, include_ = files::installed_model;
  bool fixed_ = false;
  double capacity_ah_ = 0;
  Output output_;
};

}  // namespace

std::unique_ptr<Command> cell_command() { return std::make_unique<CellCommand>(); }

}  // namespace bms::tool
