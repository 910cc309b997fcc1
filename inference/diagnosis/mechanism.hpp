// What the diagnosis knows of a mechanism beyond its law: how its signature is taken, when a recording cannot test it,
// from where its fit begins, how it is carried over to a later recording, and what a technician reads about it.
//
// It stands in one file per mechanism, inference/diagnosis/mechanisms/ID.hpp, next to model/mechanisms/ID.hpp in name:
// a specialisation of Knowledge that derives from DefaultKnowledge and replaces what differs. A mechanism without such
// a file has the defaults, and is diagnosed by them. mechanisms/all.hpp includes the files.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/numerics.hpp"
#include "diagnosis/quantity_text.hpp"
#include "diagnosis/recording_facts.hpp"
#include "diagnosis/simulation_setup.hpp"
#include "diagnosis/thresholds.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

using model::mechanism_index;
using model::MechanismSetting;

/// What a technician reads. Each is a part of a sentence unless it ends with a full stop.
struct MechanismText {
  std::string_view id;
  std::string_view name;     ///< with its article: "a hysteresis of the OCV"
  std::string_view brief;    ///< the claim without a number
  std::string_view mark;     ///< how it shows, after its name: "follows the direction of ..."
  std::string_view meaning;  ///< what happens. A sentence
  std::string_view action;   ///< what to do next. A sentence
};

/// How a signature is taken, and with it what kind of mechanism it is.
enum class Signature {
  derivatives,     ///< derivatives of the voltage by its strengths
  contact_change,  ///< a resistance (parameter 0) from a moment on (parameter 1), which is searched
  contact_bursts,  ///< a resistance (parameter 0) in bursts for a share of the time (parameter 1), which are searched:
                   ///< it is free to come and go, so it is tried after all others and must explain more
};
inline constexpr std::size_t contact_resistance = 0, contact_onset = 1, burst_share = 1;

/// Facts of a recording that help to distinguish mechanisms. They can be combined.
enum class Fact : unsigned { none = 0, reversals = 1, rests = 2, temperature = 4, rates = 8, soc_span = 16 };
constexpr Fact operator|(Fact a, Fact b) {
  return static_cast<Fact>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}
constexpr bool includes(Fact all, Fact one) { return (static_cast<unsigned>(all) & static_cast<unsigned>(one)) != 0; }

/// What decides whether recordings can test a mechanism.
struct TestConditions {
  const RecordingFacts& facts;
  bool follows_temperature = false;  ///< something that is there already follows the temperature
  double temperature_sigma = 0;      ///< standard deviation of the cell file's temperature dependence, over its value

  bool current_below(double c) const { return facts.largest_a < c * facts.capacity_ah; }
};

/// A signature's probe and the strengths that fit best, to first order.
struct SignatureFit {
  const MechanismSetting& probe;
  const std::vector<std::size_t>& parameters;  ///< those that the signature varies
  const Eigen::VectorXd& found;                ///< change of each of them
  double capacity_ah;
};

/// Bounds of a parameter in a fit.
struct Bounds {
  double low, high;
};

/// What is known of a parameter before any voltage is looked at; spread 0: nothing.
struct Usual {
  double typical = 0, spread = 0;
};

inline constexpr std::size_t no_mechanism = model::mechanism_count;

/// The first strength of a mechanism; 0 if it is not among them.
inline double first_strength(const std::vector<MechanismSetting>& all, std::size_t mechanism) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const auto& s) { return s.index == mechanism; });
  return found == all.end() ? 0 : found->value[0];
}

/// What holds for a mechanism of which nothing special is known; and what there is to say of one.
template <class M>
struct DefaultKnowledge {
  static constexpr MechanismText text = {
      .id = M::id,
      .name = M::id,
      .brief = M::id,
      .mark = "has a signature of its own",
      .meaning = "The cell or an instrument has this effect, which the cell file does not contain.",
      .action = "Use the extended cell file."};
  static constexpr Signature signature = Signature::derivatives;
  static constexpr bool probes_places = false;        ///< the signature varies the parameters with Role::place as well
  static constexpr bool follows_temperature = false;  ///< the voltage depends on the measured temperature through it
  static constexpr bool outside_cell = false;  ///< acts between the cell's terminals and the voltage that is read
  static constexpr bool report_limit = false;  ///< a technician can judge its detection limit
  static constexpr Fact facts = Fact::none;    ///< that help to distinguish it
  static constexpr std::size_t same_recording_as = no_mechanism;  ///< its recordings cannot be distinguished from those
                                                                  ///< of this one, whatever the current
  static constexpr bool needs_first_strength = false;  ///< its other strengths mean nothing without the first
  static constexpr bool only_a_term = false;           ///< learned for an unknown cause (law_term.hpp), never searched
  static constexpr double searched_unknowns = 0;       ///< searched in addition to the parameters

  /// What a finding says, with its number, as the beginning of a sentence.
  static std::string claim(const MechanismSetting& s) {
    return std::string(M::id) + " acts, with " + std::string(M::parameters[0].name) + " = " +
           parameter_text(M::parameters[0], s.value[0], s.deviation[0]);
  }
  /// Values of its shape at which signatures are taken, each for every parameter with Role::shape. Empty: the default.
  static std::vector<double> probing_shapes(double /*capacity_ah*/) { return {}; }
  static constexpr std::size_t forms = 1;  ///< of its law, which parameters with Role::given choose; each is fitted
  static void choose_form(MechanismSetting& /*s*/, std::size_t /*form*/, const model::CellParameters<>& /*cell*/) {}
  /// What the cell file knows of a parameter; nothing: what is known of most cells holds.
  static std::optional<Usual> known(std::size_t /*parameter*/, const MechanismSetting& /*s*/,
                                    const model::CellParameters<>& /*cell*/) {
    return std::nullopt;
  }
  /// Changes a probe whose shapes and strengths are set.
  static void adjust_probe(MechanismSetting& /*probe*/, const RecordingFacts& /*facts*/) {}
  /// Where a fit begins.
  static MechanismSetting start(const SignatureFit& s) {
    MechanismSetting start = s.probe;
    for (std::size_t k = 0; k < s.parameters.size(); ++k) {
      const model::Parameter& p = M::parameters[s.parameters[k]];
      const double low = p.lower(s.capacity_ah), high = p.upper(s.capacity_ah),
                   share = thresholds.screening.start_share;
      start.value[s.parameters[k]] =
          std::clamp(s.found[static_cast<Eigen::Index>(k)], std::max(low, -share * std::abs(low)), share * high);
    }
    return start;
  }
  /// Why these recordings cannot test it; nothing if they can.
  static std::optional<std::string> not_testable(const TestConditions& /*c*/) { return std::nullopt; }
  /// Other values of its first parameters from which a fit begins, where the signature, which is linear, may mislead.
  static std::vector<std::vector<double>> far_starts(const MechanismSetting& /*s*/, const RecordingFacts& /*facts*/) {
    return {};
  }
  /// Changes a hypothesis, whose last setting is this mechanism's, to a start that takes over a part of what another of
  /// its mechanisms explains: where both must move at once, neither gains alone. Returns false without such a start.
  static bool joint_start(std::vector<MechanismSetting>& /*all*/, const model::CellParameters<>& /*cell*/) {
    return false;
  }
  /// Bounds of a parameter in a fit. rc_s: time constant of the cell file's RC branch.
  static Bounds bounds(std::size_t /*parameter*/, Bounds file, double /*rc_s*/) { return file; }
  /// Returns true if the cell file and the temperature alone make it certain: it is then fitted first.
  static bool expected(const model::CellParameters<>& /*cell*/, const RecordingFacts& /*facts*/) { return false; }
  /// Gain that it has before any voltage is looked at.
  static double prior_gain(const RecordingFacts& /*facts*/) { return 0; }
  /// Returns true if no cell or instrument is so. all: the mechanisms of the hypothesis.
  static bool is_implausible(const MechanismSetting& /*s*/, const std::vector<MechanismSetting>& /*all*/,
                             const RecordingFacts& /*facts*/) {
    return false;
  }
  /// Changes a setting to what holds in a later recording of the same cell and instruments. Returns false if nothing
  /// of it holds there.
  static bool carry_over(MechanismSetting& /*s*/) { return true; }
  /// Changes a setting to what holds after a full charge.
  static void after_full_charge(MechanismSetting& /*s*/) {}
  /// Share of the cell file's capacity that is left.
  static double capacity_share(const MechanismSetting& /*s*/) { return 1; }
  /// Adds its law, or what takes the law's place, to the simulation of one recording.
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& value) {
    setup.template choose<M>(value);
  }
  /// Standard deviation of its dependence on the temperature, over its value. 0: it has none, or states none.
  static double temperature_sigma(const MechanismSetting& /*s*/) { return 0; }
  /// Voltage between the cell's terminals and where its voltage is read, at a check of the instrument.
  template <class S>
  static S between_terminals(const model::MechanismValues<S>& /*value*/, const Check& /*check*/,
                             std::size_t /*record*/) {
    return S(0);
  }
};

/// Specialised in inference/diagnosis/mechanisms/ID.hpp.
template <class M>
struct Knowledge : DefaultKnowledge<M> {};

/// The same without the type. Members as in DefaultKnowledge.
struct MechanismKnowledge {
  MechanismText text;
  Signature signature;
  bool probes_places, follows_temperature, outside_cell, report_limit;
  Fact facts;
  std::size_t same_recording_as;
  bool needs_first_strength, only_a_term;
  double searched_unknowns;
  std::string (*claim)(const MechanismSetting&);
  double (*temperature_sigma)(const MechanismSetting&);
  std::vector<double> (*probing_shapes)(double);
  std::size_t forms;
  void (*choose_form)(MechanismSetting&, std::size_t, const model::CellParameters<>&);
  std::optional<Usual> (*known)(std::size_t, const MechanismSetting&, const model::CellParameters<>&);
  void (*adjust_probe)(MechanismSetting&, const RecordingFacts&);
  MechanismSetting (*start)(const SignatureFit&);
  std::optional<std::string> (*not_testable)(const TestConditions&);
  std::vector<std::vector<double>> (*far_starts)(const MechanismSetting&, const RecordingFacts&);
  bool (*joint_start)(std::vector<MechanismSetting>&, const model::CellParameters<>&);
  Bounds (*bounds)(std::size_t, Bounds, double);
  bool (*expected)(const model::CellParameters<>&, const RecordingFacts&);
  double (*prior_gain)(const RecordingFacts&);
  bool (*is_implausible)(const MechanismSetting&, const std::vector<MechanismSetting>&, const RecordingFacts&);
  bool (*carry_over)(MechanismSetting&);
  void (*after_full_charge)(MechanismSetting&);
  double (*capacity_share)(const MechanismSetting&);
};

/// mechanism: index in the catalogue.
const MechanismKnowledge& knowledge_of(std::size_t mechanism);

/// The first mechanism of the catalogue with this kind of signature; no_mechanism if no mechanism has it.
std::size_t first_with(Signature signature);

}  // namespace bms::diagnosis
