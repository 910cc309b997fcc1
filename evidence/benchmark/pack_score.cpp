#include "benchmark/pack_score.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::benchmark {

namespace dp = diagnosis::pack;

namespace {

bool same_cell(const dp::PackFinding& f, const truth::PackFault& fault) { return f.cell == fault.cell; }

bool is_about(const dp::PackFinding& f, const truth::PackFault& fault) {
  return dp::id_of(f) == fault.id && same_cell(f, fault);
}

/// Cells that a fault shows in its voltages.
bool touches(const truth::PackFault& fault, const dp::PackFinding& f) {
  if (!fault.cell || !f.cell || f.cause == dp::Cause::thermistor || fault.id == "temperature_sensor") return false;
  if (fault.id == "sense_wire" && *f.cell == *fault.cell + 1) return true;
  if (f.cause == dp::Cause::sense_wire && *f.cell + 1 == *fault.cell) return true;
  return *f.cell == *fault.cell;
}

/// The answer is AMBIGUOUS, and the fault is among what else it could be.
bool lists(const dp::PackFinding& f, const truth::PackFault& fault) {
  return std::any_of(f.rivals.begin(), f.rivals.end(), [&](const dp::Rival& r) {
    return dp::text_of(r.cause).id == fault.id && fault.cell == r.cell && r.probability > dp::limits.ambiguous_from;
  });
}

/// Returns true if the matrix says that the recording does not separate this finding's cause from the fault.
bool cannot_be_separated(const dp::PackFinding& f, const truth::PackFault& fault, const dp::Isolability& matrix) {
  const auto place_of = [&](std::string_view id) {
    const auto found = std::find_if(matrix.causes.begin(), matrix.causes.end(),
                                    [&](dp::Cause cause) { return dp::text_of(cause).id == id; });
    return static_cast<std::size_t>(found - matrix.causes.begin());
  };
  const std::size_t a = place_of(dp::id_of(f)), b = place_of(fault.id);
  if (a >= matrix.separable.size() || b >= matrix.separable.size()) return false;
  return !matrix.separable[a][b] || !matrix.separable[b][a];
}

/// What the diagnosis says it would name of this cause, in a typical cell.
double limit_for(const truth::PackFault& fault, const dp::PackDiagnosis& d) {
  for (const dp::PackLimit& l : d.detection_limits) {
    if (dp::text_of(l.cause).id == fault.id) return l.value;
  }
  return 0;
}

PlantedOutcome outcome_of(const truth::PackFault& fault, const dp::PackDiagnosis& d) {
  PlantedOutcome o;
  o.fault = fault;
  o.limit = limit_for(fault, d);
  for (const dp::PackFinding& f : d.findings) {
    if (is_about(f, fault)) {
      o.named = o.cell_right = true;
      o.found = f.value;
      o.pull = f.sigma > 0 ? (f.value - fault.size) / f.sigma : 0;
      o.after_s = f.after_s.value_or(0);
    } else if (lists(f, fault)) {
      o.listed = true;
      o.foretold = cannot_be_separated(f, fault, d.isolability);
    }
    if (!touches(fault, f)) continue;
    o.cell_right = true;
    if (!is_about(f, fault)) o.instead += dp::sentence_of(f) + " " + dp::rivals_text(f);
  }
  o.listed = o.listed && !o.named;
  o.foretold = o.foretold && o.listed;
  o.below = !o.named && !o.listed && std::abs(fault.size) < o.limit;
  return o;
}

struct Count {
  std::size_t planted = 0, named = 0, listed = 0, foretold = 0, another = 0, missed = 0, below = 0, sized = 0;
  std::vector<double> after_s;
  std::vector<double> ratios;  ///< found over planted
};

std::string row_of(const std::string& name, const Count& c) {
  const std::string time = c.after_s.empty() ? "" : fmt::format("{:.0f} min", measurement::median(c.after_s) / 60),
                    ratio = c.ratios.empty() ? "" : fmt::format("{:.2f}", measurement::median(c.ratios));
  return fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", name, c.planted, c.named, c.listed,
                     c.foretold, c.another, c.missed, c.below, c.sized, ratio, time);
}

}  // namespace

PackOutcome score_pack(const truth::PackCase& c, const dp::PackDiagnosis& d) {
  PackOutcome o;
  o.name = c.name;
  o.hours = c.hours;
  o.cells = c.recording.cell_v.size();
  o.verdict = diagnosis::name_of(d.verdict);
  o.statement = d.statement;
  o.healthy = std::none_of(c.faults.begin(), c.faults.end(),
                           [](const truth::PackFault& f) { return f.id != "channels_staggered"; });
  for (const truth::PackFault& fault : c.faults) o.planted.push_back(outcome_of(fault, d));
  for (const dp::PackFinding& f : d.findings) {
    const bool known = std::any_of(c.faults.begin(), c.faults.end(), [&](const truth::PackFault& fault) {
      return is_about(f, fault) || lists(f, fault);
    });
    if (!known) o.wrong.push_back(dp::sentence_of(f) + " " + dp::rivals_text(f));
  }
  for (const dp::UnexplainedCell& u : d.unexplained) {
    const bool known = std::any_of(c.faults.begin(), c.faults.end(),
                                   [&](const truth::PackFault& fault) { return fault.cell == u.cell; });
    if (!known) o.wrong.push_back(fmt::format("cell {} unknown", u.cell + 1));
  }
  return o;
}

std::string pack_table(const std::vector<PackOutcome>& outcomes) {
  std::map<std::string, Count> by_cause;
  Count all, data;
  std::size_t healthy = 0, in_peace = 0, faulty = 0, with_wrong = 0, whole = 0;
  double wall_s = 0;
  for (const PackOutcome& o : outcomes) {
    wall_s = std::max(wall_s, o.wall_s);
    (o.healthy ? healthy : faulty) += 1;
    if (o.healthy && o.wrong.empty()) ++in_peace;
    if (!o.healthy && !o.wrong.empty()) ++with_wrong;
    bool complete = o.wrong.empty();
    for (const PlantedOutcome& p : o.planted) {
      complete = complete && (p.named || p.listed);
      for (Count* c : {&by_cause[p.fault.id], p.fault.of_data ? &data : &all}) {
        ++c->planted;
        c->named += p.named ? 1 : 0;
        c->listed += p.listed ? 1 : 0;
        c->foretold += p.foretold ? 1 : 0;
        const bool found = p.named || p.listed;
        c->another += !found && p.cell_right ? 1 : 0;
        c->missed += !found && !p.cell_right ? 1 : 0;
        c->below += p.below ? 1 : 0;
        c->sized += p.named && std::abs(p.pull) <= 2 ? 1 : 0;
        if (p.named && p.fault.size != 0) c->ratios.push_back(p.found / p.fault.size);
        if (p.named && p.after_s > 0) c->after_s.push_back(p.after_s);
      }
    }
    if (!o.healthy && complete) ++whole;
  }
  std::string text =
      "| planted | cases | cell and cause right | AMBIGUOUS, right one listed | of these, not separable by the matrix "
      "| another cause for this cell | missed | of these two, below the stated limit | right, size within 2 sigma "
      "| the same, found over planted, median | median time to name |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [id, count] : by_cause) text += row_of("`" + id + "`", count);
  text += row_of("**physics and sensors**", all) + row_of("**faults of the data**", data);
  text += fmt::format(
      "\n{} packs with faults: all of a pack right or listed and nothing else named in {}; something else named in "
      "{}. {} healthy packs: nothing named in {}. Slowest pack: {:.0f} s.\n",
      faulty, whole, with_wrong, healthy, in_peace, wall_s);
  return text;
}

std::string pack_json(const std::vector<PackOutcome>& outcomes) {
  using Json = nlohmann::ordered_json;
  Json list = Json::array();
  for (const PackOutcome& o : outcomes) {
    Json planted = Json::array();
    for (const PlantedOutcome& p : o.planted)
      planted.push_back({{"id", p.fault.id},
                         {"cell", p.fault.cell ? Json(*p.fault.cell + 1) : Json(nullptr)},
                         {"size", p.fault.size},
                         {"named", p.named},
                         {"listed", p.listed},
                         {"foretold", p.foretold},
                         {"cell_right", p.cell_right},
                         {"limit", p.limit},
                         {"below", p.below},
                         {"found", p.found},
                         {"pull", p.pull},
                         {"instead", p.instead},
                         {"after_s", p.after_s}});
    list.push_back({{"name", o.name},
                    {"healthy", o.healthy},
                    {"cells", o.cells},
                    {"hours", o.hours},
                    {"verdict", o.verdict},
                    {"statement", o.statement},
                    {"planted", std::move(planted)},
                    {"wrong", o.wrong},
                    {"wall_s", o.wall_s}});
  }
  return list.dump(1) + "\n";
}

}  // namespace bms::benchmark
