// replay(), simulate() and the estimator step by step.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "measurement/recording_checks.hpp"
#include "python/bindings.hpp"
#include "replay/judgement.hpp"
#include "replay/replay.hpp"
#include "replay/simulation.hpp"
#include "replay/stepper.hpp"
#include "workflow/recording_start.hpp"

namespace bms::python {

namespace {

using replay::EstimateRow;

/// numbers, states: arrays of Python are views of them; made when the first is asked for.
struct Replayed : replay::ReplayResult {
  std::vector<EstimateRow> numbers;
  std::vector<double> states;
};
using Result = std::shared_ptr<Replayed>;

replay::ScalarKind scalar_of(const std::string& name) {
  for (const auto kind : {replay::ScalarKind::float32, replay::ScalarKind::fixed, replay::ScalarKind::float64}) {
    if (name == replay::name_of(kind)) return kind;
  }
  throw py::value_error("no such scalar '" + name + "', expected float, fixed or double");
}

std::optional<replay::SocPrior> prior_of(std::optional<double> initial_soc, double sigma) {
  if (!initial_soc) return std::nullopt;
  if (!(*initial_soc >= 0 && *initial_soc <= 1)) throw py::value_error("initial_soc is not between 0 and 1");
  if (!(sigma >= 1e-4 && sigma <= 1)) throw py::value_error("initial_soc_sigma is not between 1e-4 and 1");
  return replay::SocPrior{*initial_soc, sigma};
}

double start_shift(const files::CellFile& cell) { return replay::value_of(cell.mechanisms, model::InitialSoc::id, 0); }

/// As `bms replay`: impossible estimates are errors.
Result replay(const files::CellFile& cell, const measurement::Recording& recording, std::optional<double> initial_soc,
              double initial_soc_sigma, const std::string& scalar) {
  auto result = std::make_shared<Replayed>();
  result->scalar = scalar_of(scalar);
  result->prior = prior_of(initial_soc, initial_soc_sigma);
  const py::gil_scoped_release released;
  if (recording.voltage_v.empty())
    throw files::BadInput(recording.path, 1, "no voltage_v, expected one to estimate from");
  result->recording = recording;
  result->cell = cell;
  measurement::compare_with_cell(result->recording, cell.parameters);
  if (const std::string what = measurement::contradiction(result->recording); !what.empty())
    throw files::BadInput(recording.path, 1, what);
  result->track = replay::run_on_host(cell, measurement::SampleList(result->recording),
                                      replay::starting_point(result->prior, start_shift(cell)), result->scalar,
                                      replay::Timing::none);
  result->initial_soc = initial_soc.value_or(result->track.rows.front().soc);
  result->open_loop_soc = workflow::recording_start(recording, cell, initial_soc).start.soc;
  replay::Judgement judgement = replay::judge(*result);
  if (judgement.impossible)
    throw files::BadInput(recording.path, 1, *judgement.impossible + "; expected a recording of this cell");
  result->doubts = std::move(judgement.doubts);
  return result;
}

/// A column of the estimates: a strided view that keeps the result.
template <class T>
py::array view_of_rows(const Result& result, const T* first, std::size_t stride_bytes) {
  auto kept = std::make_unique<Result>(result);
  const py::capsule owner(kept.release(), [](void* shared) { delete static_cast<Result*>(shared); });
  py::array_t<T> array({static_cast<py::ssize_t>(result->track.rows.size())}, {static_cast<py::ssize_t>(stride_bytes)},
                       first, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

const EstimateRow* numbers_of(const Result& result) {
  const replay::Estimates& rows = result->track.rows;
  if (result->numbers.empty()) result->numbers.assign(rows.begin(), rows.end());
  return result->numbers.data();
}

py::dict states_of(const Result& result) {
  py::dict states;
  const auto& names = result->track.state_names;
  for (std::size_t k = result->states.size(); k < names.size() * result->track.rows.size(); ++k)
    result->states.push_back(result->track.state(k / names.size(), k % names.size()));
  for (std::size_t k = 0; k < names.size(); ++k)
    states[py::str(names[k])] = view_of_rows(result, result->states.data() + k, names.size() * sizeof(double));
  return states;
}

py::dict figures_of(const Result& result) {
  {
    const py::gil_scoped_release released;
    if (result->open_loop_v.empty()) replay::evaluate(*result);
  }
  py::dict figures;
  const replay::SocFigures& soc = result->soc;
  const replay::VoltageFigures& v = result->voltage;
  figures["soc_final"] = soc.final;
  figures["soc_final_sigma"] = soc.final_sigma;
  figures["soc_rmse"] = soc.rmse;
  figures["soc_max_error"] = soc.max_error;
  figures["within_2_sigma"] = soc.within_2_sigma;
  figures["prediction_rmse_v"] = v.prediction_rmse_v;
  figures["open_loop_rmse_v"] = v.open_loop_rmse_v;
  return figures;
}

void bind_replay_result(py::module_& module) {
  py::class_<Replayed, Result> c(module, "Replay", "The estimates of a replay, one row per row of the recording.");
  const auto column = [&](const char* name, double EstimateRow::*member, const char* help) {
    c.def_property_readonly(
        name, [member](const Result& r) { return view_of_rows(r, &(numbers_of(r)->*member), sizeof(EstimateRow)); },
        help);
  };
  c.def_property_readonly(
      "time_s", [](const Result& r) { return view_of(r->recording.time_s); }, "Time [s]: shape (n,).");
  column("soc", &EstimateRow::soc, "State of charge, 0 to 1: shape (n,), a read-only view.");
  column("soc_sigma", &EstimateRow::soc_sigma, "Its standard deviation: shape (n,).");
  column("v_rc_v", &EstimateRow::v_rc_v, "Voltage over the RC branch [V]: shape (n,).");
  column("voltage_predicted_v", &EstimateRow::voltage_predicted_v, "Voltage that the model expected [V]: shape (n,).");
  c.def_property_readonly(
      "flags", [](const Result& r) { return view_of_rows(r, &numbers_of(r)->flags, sizeof(EstimateRow)); },
      "Why an estimate is less accurate, greybox_bms.FLAGS or-ed: shape (n,), uint32.");
  c.def_property_readonly("states", &states_of, "{name: shape (n,)}: further states of an extended cell [V, K, A].");
  c.def_property_readonly(
      "figures", &figures_of,
      "Errors against soc_ref and of the voltage [V]; the charge is counted with the cell file's capacity.");
  c.def_property_readonly(
      "doubts", [](const Result& r) { return r->doubts; }, "Why the estimates are not reliable; empty if they are.");
  c.def_property_readonly(
      "warnings", [](const Result& r) { return pairs(r->recording.warnings); }, "[(id, text)] of the recording.");
  c.def(
      "trace_csv", [](const Result& r) { return replay::trace_csv(*r); }, "The columns of bms replay --trace.");
  c.def("__len__", [](const Result& r) { return r->track.rows.size(); });
}

struct Simulation {
  measurement::Recording recording;
  std::vector<replay::SimulatedRow> rows;
};
using Simulated = std::shared_ptr<Simulation>;

Simulated simulate(const files::CellFile& cell, const measurement::Recording& recording, double initial_soc) {
  if (!(initial_soc >= 0 && initial_soc <= 1)) throw py::value_error("initial_soc is not between 0 and 1");
  const py::gil_scoped_release released;
  auto result = std::make_shared<Simulation>();
  result->recording = recording;
  const auto prepared = model::prepare<double, model::max_intervals>(cell.parameters);
  result->rows = replay::simulate({.cell = prepared,
                                   .capacity_ah = cell.parameters.capacity_ah,
                                   .mechanisms = cell.mechanisms,
                                   .time_s = recording.time_s,
                                   .current_a = recording.current_a,
                                   .temperature_c = recording.temperature_c,
                                   .initial_soc = initial_soc});
  const auto outside = std::find_if(result->rows.begin(), result->rows.end(), [](const replay::SimulatedRow& row) {
    return !(row.soc > model::min_soc && row.soc < model::max_soc);  // the simulation holds it there
  });
  if (outside != result->rows.end()) {
    const auto k = static_cast<std::size_t>(outside - result->rows.begin());
    throw files::BadInput(recording.path, k + 1,
                          fmt::format("the state of charge leaves {:g} to {:g} % after {:g} s, expected a current that "
                                      "the cell can deliver from {:g} %",
                                      100 * model::min_soc, 100 * model::max_soc,
                                      recording.time_s[k] - recording.time_s.front(), 100 * initial_soc));
  }
  return result;
}

py::array simulated(const Simulated& result, double replay::SimulatedRow::*member) {
  auto kept = std::make_unique<Simulated>(result);
  const double* const first = &(result->rows.data()->*member);
  const py::capsule owner(kept.release(), [](void* shared) { delete static_cast<Simulated*>(shared); });
  return py::array_t<double>({static_cast<py::ssize_t>(result->rows.size())},
                             {static_cast<py::ssize_t>(sizeof(replay::SimulatedRow))}, first, owner);
}

/// The estimator, and the time of its first sample.
class Estimator {
 public:
  Estimator(const files::CellFile& cell, std::optional<double> initial_soc, double sigma)
      : stepper_(replay::make_stepper(cell, replay::starting_point(prior_of(initial_soc, sigma), start_shift(cell)))) {}

  EstimateRow step(double time_s, double current_a, double voltage_v, double temperature_c) {
    if (!std::isfinite(time_s)) throw py::value_error("time_s is not a number");
    if (!first_s_) first_s_ = time_s;
    if (time_s < *first_s_) throw py::value_error("time_s is before the first sample");
    return stepper_->step(measurement::sample_of(time_s - *first_s_, current_a, voltage_v, temperature_c));
  }

 private:
  std::unique_ptr<replay::Stepper> stepper_;
  std::optional<double> first_s_;
};

void bind_estimator(py::module_& module) {
  py::class_<EstimateRow>(module, "Estimate", "The estimate after one sample.")
      .def_readonly("soc", &EstimateRow::soc, "State of charge, 0 to 1.")
      .def_readonly("soc_sigma", &EstimateRow::soc_sigma, "Its standard deviation.")
      .def_readonly("v_rc_v", &EstimateRow::v_rc_v, "Voltage over the RC branch [V].")
      .def_readonly("voltage_predicted_v", &EstimateRow::voltage_predicted_v, "Voltage that the model expected [V].")
      .def_readonly("flags", &EstimateRow::flags, "Why it is less accurate, greybox_bms.FLAGS or-ed.")
      .def("__repr__", [](const EstimateRow& e) {
        return fmt::format("<greybox_bms.Estimate {:.4f} +- {:.4f}, flags {}>", e.soc, e.soc_sigma, e.flags);
      });
  constexpr double missing = std::numeric_limits<double>::quiet_NaN();
  py::class_<Estimator>(module, "Estimator",
                        "The estimator one sample at a time, in float as on a board. replay() has the same bits. One "
                        "estimator must not be used by two threads at a time.")
      .def(py::init<const files::CellFile&, std::optional<double>, double>(), py::arg("cell"), py::kw_only(),
           py::arg("initial_soc") = py::none(), py::arg("initial_soc_sigma") = 0.02,
           "initial_soc: 0 to 1; estimated from the first voltage if None. initial_soc_sigma: its standard deviation.")
      .def("step", &Estimator::step, py::arg("time_s"), py::arg("current_a"), py::arg("voltage_v") = missing,
           py::arg("temperature_c") = missing,
           "Processes one sample: time_s [s, increases], current_a [A, > 0 charges], voltage_v [V], temperature_c "
           "[degrees C]. NaN is a missing reading.");
}

}  // namespace

void bind_replay(py::module_& module) {
  bind_replay_result(module);
  bind_estimator(module);
  py::class_<Simulation, Simulated>(module, "Simulation", "An open-loop simulation, one row per row of the input.")
      .def_property_readonly(
          "time_s", [](const Simulated& s) { return view_of(s->recording.time_s); }, "Time [s]: shape (n,).")
      .def_property_readonly(
          "voltage_v", [](const Simulated& s) { return simulated(s, &replay::SimulatedRow::voltage_v); },
          "Voltage [V]: shape (n,), a view.")
      .def_property_readonly(
          "soc", [](const Simulated& s) { return simulated(s, &replay::SimulatedRow::soc); },
          "State of charge: shape (n,), a view.")
      .def("__len__", [](const Simulated& s) { return s->rows.size(); });
  module.def("replay", &replay, py::arg("cell"), py::arg("recording"), py::kw_only(),
             py::arg("initial_soc") = py::none(), py::arg("initial_soc_sigma") = 0.02, py::arg("scalar") = "float");
  module.def("simulate", &simulate, py::arg("cell"), py::arg("recording"), py::kw_only(), py::arg("initial_soc"));
}

}  // namespace bms::python
