// The deciding experiment for a diagnosis by "a fault is a change": a healthy recording and the one to be diagnosed
// have one likelihood, in which every mechanism has a strength that both share, and a hypothesis changes one strength
// in the last recording alone. To first order around the calibrated cell, so evidence is in closed form. Each set is
// judged as it is, with three faults put in, and healthy blocks are judged next to those before them.
//
// Exit code: 0 done; 2 bad usage or a file that cannot be read; 3 internal error
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>

#include "diagnosis/prepare.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/signatures.hpp"
#include "diagnosis/testability.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"
#include "files/toml_table.hpp"
#include "proof/real_cell.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace {

using bms::diagnosis::Columns;
using bms::diagnosis::LikelihoodModel;
using bms::diagnosis::NoiseModel;
using bms::diagnosis::PreparedRecording;
using bms::files::CellFile;
using bms::measurement::Recording;
using Eigen::Index;

struct Options {
  std::string data = "../shared/data", list = "evidence/proof/semi_real.toml", only = "second half";
  double strength = 1;              ///< standard deviation of a shared strength, in what is common of it
  double wander = 0.02;             ///< by which a recording's own strength differs from it, as a share of it
  double resistance_tolerance = 0;  ///< of the cell file; 0: as identified
  std::size_t blocks = 5;           ///< of the healthy recording
};

/// A strength that may differ from recording to recording.
struct Strength {
  std::size_t mechanism = 0;
  double size = 1;          ///< that is common, in its unit
  std::size_t columns = 1;  ///< of its mechanism: they share its prior
  bool shared = true;       ///< false: 0 but for a change
};

struct Change {
  std::size_t mechanism = 0;
  double evidence = 0;  ///< 2 ln Bayes factor against no change
  double value = 0, deviation = 0;
};

double common_size(std::size_t mechanism, std::size_t parameter, double capacity_ah) {
  constexpr double share_of_bounds = 0.1;
  const bms::model::Parameter& p = bms::model::catalogue[mechanism].parameter[parameter];
  if (p.common(capacity_ah) > 0) return p.common(capacity_ah);
  if (p.spread > 0) return p.spread;
  return share_of_bounds * std::max(std::abs(p.lower(capacity_ah)), std::abs(p.upper(capacity_ah)));
}

/// Columns that are not white: residual, base parameters, strengths in common sizes.
struct RawColumns {
  Columns residual, base, strengths;
  std::vector<Strength> of;
  std::vector<Index> first_row;  ///< of each recording, and the end
};

/// A noise model that leaves columns as they are but for the factor 1 / white_v.
NoiseModel none_but_white() {
  NoiseModel noise;
  noise.white_v = 1e3;
  noise.fast_v = noise.slow_v = 1e-12;
  noise.edge = 1e-9;
  return noise;
}

constexpr double contact_ohm = 0.01;

/// A contact of contact_ohm during all of a recording.
Columns contact_column(const LikelihoodModel& likelihood) {
  Columns column = Columns::Zero(static_cast<Index>(likelihood.samples()), 1);
  Index row = 0;
  for (const PreparedRecording& r : likelihood.records()) {
    for (const double a : r.current_a) column(row++, 0) = std::isfinite(a) ? contact_ohm * a : 0;
  }
  return column;
}

void add_strengths(const LikelihoodModel& likelihood, const bms::diagnosis::HypothesisFit& fit, RawColumns& raw) {
  std::vector<std::size_t> over;
  for (std::size_t m = 0; m < bms::model::mechanism_count; ++m) {
    // a contact that changes after the healthy recording is a change, not a shared strength
    const bool shared = bms::diagnosis::knowledge_of(m).signature == bms::diagnosis::Signature::derivatives;
    if (shared && !not_testable(likelihood, fit.hypothesis, m)) over.push_back(m);
  }
  const bms::diagnosis::SignatureSet set = signatures(likelihood, fit, over);
  std::vector<Columns> columns;
  std::map<std::size_t, std::size_t> count;
  for (const bms::diagnosis::Probe& p : set.probes) {
    for (std::size_t k = 0; k < p.parameters.size(); ++k) {
      const double size = common_size(p.setting.index, p.parameters[k], likelihood.cell().capacity_ah);
      columns.push_back(set.blocks[p.block].col(p.first + static_cast<Index>(k)) * (size * likelihood.noise().white_v));
      raw.of.push_back({p.setting.index, size, 1, true});
      ++count[p.setting.index];
    }
  }
  columns.push_back(contact_column(likelihood));
  raw.of.push_back({bms::model::mechanism_index_of<bms::model::ContactStep>, contact_ohm, 1, false});
  count[raw.of.back().mechanism] = 1;
  raw.strengths.resize(static_cast<Index>(likelihood.samples()), static_cast<Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    raw.strengths.col(static_cast<Index>(k)) = columns[k];
    raw.of[k].columns = count[raw.of[k].mechanism];
  }
}

/// The last recording is the one to be judged.
RawColumns raw_columns(LikelihoodModel& likelihood) {
  bms::diagnosis::HypothesisFit fit;  // the cell file as it is: a fit has already absorbed a part of the fault
  fit.hypothesis = likelihood.base();
  fit.calibration = likelihood.unchanged();
  const NoiseModel nominal = likelihood.noise();
  likelihood.set_noise(none_but_white());
  RawColumns raw;
  raw.residual = likelihood.raw_residual(fit.hypothesis, fit.calibration);
  raw.base = likelihood.raw_calibration_derivatives(fit.hypothesis, fit.calibration);
  add_strengths(likelihood, fit, raw);
  raw.first_row = {0};
  for (std::size_t r = 0; r < likelihood.records().size(); ++r) {
    for (std::size_t k = 0; k < likelihood.records()[r].size(); ++k) {
      if (likelihood.usable(r)[k] != 0) continue;
      raw.base.row(raw.first_row.back() + static_cast<Index>(k)).setZero();
      raw.strengths.row(raw.first_row.back() + static_cast<Index>(k)).setZero();
    }
    raw.first_row.push_back(raw.first_row.back() + static_cast<Index>(likelihood.records()[r].size()));
  }
  likelihood.set_noise(nominal);
  return raw;
}

/// The posterior of base parameters and of all recordings' strengths, without a change.
struct Joint {
  Eigen::MatrixXd gram;  ///< without priors
  Eigen::VectorXd toward, mean;
  Eigen::LLT<Eigen::MatrixXd> precision;
  Index bases = 0, strengths = 0;

  Index at(std::size_t record) const { return bases + static_cast<Index>(record) * strengths; }
};

Joint joint_of(const LikelihoodModel& likelihood, const RawColumns& raw, const Options& o) {
  Columns base = raw.base, strengths = raw.strengths, residual = raw.residual;
  for (Columns* c : {&base, &strengths, &residual}) likelihood.whiten(*c);
  const std::size_t records = raw.first_row.size() - 1;
  Joint j;
  j.bases = base.cols();
  j.strengths = strengths.cols();
  j.gram = Eigen::MatrixXd::Zero(j.at(records), j.at(records));
  j.toward = Eigen::VectorXd::Zero(j.at(records));
  j.gram.topLeftCorner(j.bases, j.bases) = base.transpose() * base;
  j.toward.head(j.bases) = base.transpose() * residual.col(0);
  for (std::size_t r = 0; r < records; ++r) {
    const Index first = raw.first_row[r], rows = raw.first_row[r + 1] - first, n = j.strengths;
    const auto own = strengths.middleRows(first, rows);
    j.gram.block(j.at(r), j.at(r), n, n) = own.transpose() * own;
    j.gram.block(0, j.at(r), j.bases, n) = base.middleRows(first, rows).transpose() * own;
    j.gram.block(j.at(r), 0, n, j.bases) = j.gram.block(0, j.at(r), j.bases, n).transpose();
    j.toward.segment(j.at(r), n) = own.transpose() * residual.middleRows(first, rows).col(0);
  }
  Eigen::MatrixXd precision = j.gram;
  precision.topLeftCorner(j.bases, j.bases).diagonal().array() += 1;
  // prior covariance of one strength over the recordings: variance (1 1' + wander^2 I)
  constexpr double fixed = 1e-9;  // variance of a strength that is 0
  const double w2 = o.wander * o.wander, n = static_cast<double>(records);
  for (Index k = 0; k < j.strengths; ++k) {
    const Strength& s = raw.of[static_cast<std::size_t>(k)];
    const double variance = s.shared ? o.strength * o.strength / static_cast<double>(s.columns) : fixed;
    for (std::size_t a = 0; a < records; ++a) {
      for (std::size_t b = 0; b < records; ++b)
        precision(j.at(a) + k, j.at(b) + k) += ((a == b ? 1 : 0) - 1 / (n + w2)) / (variance * w2);
    }
  }
  j.precision.compute(precision);
  j.mean = j.precision.solve(j.toward);
  return j;
}

/// What the posterior mean leaves [V].
Columns left_by(const Joint& j, const RawColumns& raw) {
  Columns left = raw.residual - raw.base * j.mean.head(j.bases);
  for (std::size_t r = 0; r + 1 < raw.first_row.size(); ++r) {
    const Index first = raw.first_row[r], rows = raw.first_row[r + 1] - first;
    left.middleRows(first, rows) -= raw.strengths.middleRows(first, rows) * j.mean.segment(j.at(r), j.strengths);
  }
  return left;
}

/// Evidence of a change whose projected square is gram: the mean over sizes from a third to thirty times the common.
double evidence_of(double gram, double toward) {
  constexpr std::array sizes = {0.3, 1.0, 3.0, 10.0, 30.0};
  constexpr double most = 600;
  double mean = 0;
  for (const double s : sizes) {
    const double log_factor = (toward * toward / (gram + 1 / (s * s)) - std::log1p(s * s * gram)) / 2;
    mean += std::exp(std::min(most, log_factor)) / sizes.size();
  }
  return 2 * std::log(mean);
}

/// The strongest change of each mechanism in the last recording, the most evident first.
std::vector<Change> changes(const Joint& j, const RawColumns& raw) {
  constexpr double least_gram = 1e-6;
  const Index first = j.at(raw.first_row.size() - 2);
  const Eigen::MatrixXd columns = j.gram.middleCols(first, j.strengths), solved = j.precision.solve(columns);
  std::map<std::size_t, Change> best;
  for (Index k = 0; k < j.strengths; ++k) {
    const double gram = columns(first + k, k) - columns.col(k).dot(solved.col(k)),
                 toward = j.toward[first + k] - columns.col(k).dot(j.mean);
    if (!(gram > least_gram)) continue;
    const Strength& s = raw.of[static_cast<std::size_t>(k)];
    const double evidence = evidence_of(gram, toward) - 2 * std::log(static_cast<double>(s.columns));
    const auto [known, is_new] = best.try_emplace(s.mechanism);
    if (is_new || evidence > known->second.evidence)
      known->second = {s.mechanism, evidence, toward / gram * s.size, s.size / std::sqrt(gram)};
  }
  std::vector<Change> list;
  for (const auto& [m, change] : best) list.push_back(change);
  std::sort(list.begin(), list.end(), [](const Change& a, const Change& b) { return a.evidence > b.evidence; });
  return list;
}

void judge(const std::string& name, const CellFile& cell, std::vector<PreparedRecording> records, const Options& o) {
  constexpr int noise_rounds = 2;
  constexpr std::size_t shown = 3;
  for (PreparedRecording& r : records) check_recording(r, cell.parameters);
  LikelihoodModel likelihood = likelihood_model_of(cell.parameters, cell.mechanisms, std::move(records));
  const NoiseModel nominal = likelihood.noise();
  const RawColumns raw = raw_columns(likelihood);
  Joint joint = joint_of(likelihood, raw, o);
  for (int round = 0; round < noise_rounds; ++round) {
    double cost = 0;
    likelihood.set_noise(likelihood.likeliest_noise(left_by(joint, raw), nominal, cost));
    joint = joint_of(likelihood, raw, o);
  }
  fmt::print("| {} ", name);
  const std::vector<Change> found = changes(joint, raw);
  for (std::size_t k = 0; k < std::min(shown, found.size()); ++k)
    fmt::print("| {} {:.3g} ± {:.2g}: {:.0f} ", bms::model::catalogue[found[k].mechanism].id, found[k].value,
               found[k].deviation, found[k].evidence);
  fmt::print("|\n");
  std::fflush(stdout);
}

Recording part_of(const Recording& r, std::size_t first, std::size_t end) {
  Recording part = r;
  for (auto column : {&Recording::time_s, &Recording::current_a, &Recording::voltage_v, &Recording::temperature_c,
                      &Recording::soc_ref}) {
    if (!(r.*column).empty()) part.*column = (r.*column).part(first, end - first);
  }
  return part;
}

struct Fault {
  const char* name;
  std::function<void(Recording&)> put;
};

std::vector<Fault> faults_for(double capacity_ah) {
  constexpr double ohm_ah = 0.0092;  // 4 mOhm of a cell with 2.3 Ah
  const auto contact = [=](Recording& r) {
    for (std::size_t k = 0; k < r.rows(); ++k) r.voltage_v.edit()[k] += ohm_ah / capacity_ah * r.current_a[k];
  };
  const auto gain = [](Recording& r) {
    for (double& a : r.current_a.edit()) a *= 1.06;
  };
  const auto offset = [](Recording& r) {
    for (double& v : r.voltage_v.edit()) v += 0.015;
  };
  return {{"as it is", [](Recording&) {}}, {"current +6 %", gain}, {"contact, 4 mOhm", contact}, {"15 mV", offset}};
}

void run_set(const bms::proof::RealSet& set, const Options& o) {
  bms::proof::Prepared p = prepare(o.data, set, false);
  if (o.resistance_tolerance > 0) {
    p.cell.parameters.tolerance.resistance_fraction = o.resistance_tolerance;
    p.cell.parameters.rc.r0_std_ohm = p.cell.parameters.rc.r1_std_ohm = p.cell.parameters.rc.c1_std_f = {};
  }
  const auto prepared = [&](const Recording& r) {
    return bms::workflow::prepared(r, set.name, p.cell, bms::workflow::start_of(r, p.cell)).record;
  };
  const Recording whole = bms::workflow::read_for_diagnosis(o.data + "/" + set.calibration.front(), {}, p.cell);
  const std::size_t rows = set.test.empty() ? whole.rows() / 2 : whole.rows();
  const PreparedRecording healthy = prepared(part_of(whole, 0, rows));
  for (const Fault& fault : faults_for(p.cell.parameters.capacity_ah)) {
    Recording test = p.test;
    fault.put(test);
    judge(set.name + ": " + fault.name, p.cell, {healthy, prepared(test)}, o);
  }
  for (std::size_t b = 1; b < o.blocks; ++b) {
    const std::size_t first = b * rows / o.blocks, end = (b + 1) * rows / o.blocks;
    judge(fmt::format("{}: healthy block {}", set.name, b + 1), p.cell,
          {prepared(part_of(whole, 0, first)), prepared(part_of(whole, first, end))}, o);
  }
}

void run(const Options& o) {
  bms::files::TomlTable list = bms::files::TomlTable::parse(bms::files::read_file(o.list), o.list, "a list of sets");
  bms::proof::Present present(o.data);
  fmt::print("| case | change, 2 ln of its evidence | second | third |\n|---|---|---|---|\n");
  for (const bms::proof::RealSet& set : bms::proof::read_sets(list)) {
    if (set.name.find(o.only) != std::string::npos && present.has(set.name, files_of(set))) run_set(set, o);
  }
  list.finish();
  fmt::print(stderr, "{}", present.skipped_text("sets"));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Judge changes of mechanisms whose strengths a healthy recording and the next one share"};
  app.name("shared_strengths");
  app.footer("Example: shared_strengths --data ../shared/data --only 'A123 udds, second half'");
  Options o;
  app.add_option("--data", o.data, "folder with the recordings")->capture_default_str()->type_name("FOLDER");
  app.add_option("--list", o.list, "sets of recordings")->capture_default_str()->type_name("FILE");
  app.add_option("--only", o.only, "run only sets whose name contains TEXT")->capture_default_str()->type_name("TEXT");
  app.add_option("--strength", o.strength, "standard deviation of a shared strength, in its common size")
      ->capture_default_str();
  app.add_option("--wander", o.wander, "by which a recording's own strength differs from it")->capture_default_str();
  app.add_option("--resistance-tolerance", o.resistance_tolerance, "of the cell file; 0: as identified")
      ->capture_default_str();
  app.add_option("--blocks", o.blocks, "of the healthy recording")->capture_default_str();
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
