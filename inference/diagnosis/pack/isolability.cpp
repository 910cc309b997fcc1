#include "diagnosis/pack/isolability.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <Eigen/Cholesky>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "model/catalogue.hpp"

namespace bms::diagnosis::pack {

namespace {

/// Two neighbours and the wire between them: parameters of the first, of the second, the wire's offset.
constexpr Eigen::Index pair_width = 2 * width + 1;

/// Which parameters another instrument would see as this channel does: its own offset, gain and delay are not those of
/// the channel.
struct Sensor {
  const char* name;
  bool cell, joint;  ///< sees the cell; sees the connection
};
constexpr std::array added_sensors = {
    Sensor{"a second voltmeter on the cell, with wires of its own, that includes the connection", true, true},
    Sensor{"a voltmeter on the poles of the cell itself, without the connection", true, false},
    Sensor{"a voltmeter over the connection alone", false, true},
};

struct Data {
  Eigen::MatrixXd information;
  Eigen::VectorXd healthy;
  double unseen_share = 0;  ///< as in Track
};

/// Two cells with the channels that they have, and with another instrument on the first one.
Data data_of(const Matrix& information, const Vector& healthy, double unseen_share, const Sensor* added) {
  Data d{Eigen::MatrixXd::Zero(pair_width, pair_width), Eigen::VectorXd::Zero(pair_width), unseen_share};
  for (Eigen::Index cell = 0; cell < 2; ++cell) {
    Eigen::MatrixXd into = Eigen::MatrixXd::Zero(width, pair_width);
    into.middleCols(cell * width, width).setIdentity();
    into(offset, 2 * width) = cell == 0 ? 1 : -1;
    d.information += into.transpose() * information * into;
    d.healthy.segment(cell * width, width) = healthy;
  }
  if (added != nullptr) {
    Eigen::MatrixXd into = Eigen::MatrixXd::Zero(width, pair_width);
    for (const Eigen::Index p :
         std::array<Eigen::Index, 14>{charge, capacity, leak, resistance, polarisation, time_constant, tilt, slope,
                                      temperature, heating, shape_1, shape_2, shape_3, shape_4})
      into(p, p) = added->cell ? 1 : 0;
    into(joint, joint) = added->joint ? 1 : 0;
    d.information += into.transpose() * information * into;
  }
  return d;
}

Eigen::Index place_of(Cause cause) {
  return cause == Cause::sense_wire ? 2 * width : static_cast<Eigen::Index>(parameter_of(cause));
}

/// Gaussian prior of two cells, of which the first has this cause.
Eigen::VectorXd prior_for(const Data& d, Cause cause, double r0_ohm) {
  Eigen::VectorXd prior = d.healthy;
  if (cause == Cause::sense_wire)
    prior[place_of(cause)] = std::hypot(prior[place_of(cause)], limits.spread[offset].fault);
  else
    widen_for(cause, d.healthy.head(width), r0_ohm, d.unseen_share, prior.head(width));
  return prior;
}

double marginal_for(const Data& d, const Eigen::VectorXd& with_data, Cause cause, double r0_ohm) {
  return log_marginal(d.information, with_data, prior_for(d, cause, r0_ohm));
}

double example_of(Cause cause, double r0_ohm) {
  const Parameter p = parameter_of(cause);
  return limits.spread[p].example * (p == joint ? r0_ohm : 1);
}

/// Size that is as many times its standard deviation as a verdict asks for (PackLikelihood::is_possible).
double significant_size(const Data& d, Cause cause, double r0_ohm) {
  Eigen::MatrixXd normal = d.information;
  normal.diagonal() += prior_for(d, cause, r0_ohm).array().square().inverse().matrix();
  const Eigen::Index p = place_of(cause);
  const double variance = normal.ldlt().solve(Eigen::VectorXd::Unit(normal.rows(), p))[p];
  const double own = cause == Cause::sense_wire ? 0 : d.healthy[p];
  const double scale = limits.spread[parameter_of(cause)].scale, sigmas = limits.least_sigmas;
  return sigmas * std::sqrt((variance + own * own) / (1 - sigmas * sigmas * scale * scale));
}

std::vector<std::vector<bool>> separable(const Data& d, double r0_ohm) {
  std::vector<std::vector<bool>> table;
  for (const Cause present : cell_causes) {
    const Eigen::VectorXd with_data = d.information.col(place_of(present)) * example_of(present, r0_ohm);
    const double right = marginal_for(d, with_data, present, r0_ohm),
                 nothing = log_marginal(d.information, with_data, d.healthy);
    std::vector<bool> row;
    for (const Cause other : cell_causes) {
      const double against = other == present ? nothing : marginal_for(d, with_data, other, r0_ohm);
      row.push_back(right - against > limits.separable_odds);
    }
    table.push_back(std::move(row));
  }
  return table;
}

std::size_t pairs_in(const std::vector<std::vector<bool>>& table) {
  std::size_t count = 0;
  for (std::size_t a = 0; a < table.size(); ++a) {
    for (std::size_t b = a + 1; b < table.size(); ++b) count += table[a][b] && table[b][a] ? 1 : 0;
  }
  return count;
}

/// The largest size that a cause can have: all of the charge, or the bound of the same parameter in the catalogue.
double largest_size(Cause cause, double r0_ohm) {
  const auto bound = [](std::string_view id) {
    return model::catalogue[model::mechanism_index(id)].parameter[0].upper(1);  // of 1 Ah
  };
  switch (cause) {
    case Cause::leakage:
      return limits.hours_per_day * bound("leakage");
    case Cause::resistance:
      return bound("resistance_growth");
    case Cause::joint:
      return bound("resistance_growth") * r0_ohm;
    case Cause::offset:
    case Cause::sense_wire:
      return bound("voltage_offset");
    case Cause::gain:
      return bound("voltage_gain");
    case Cause::late:
      return bound("channel_skew");
    default:
      return 1;
  }
}

}  // namespace

Isolability isolability_of(const Matrix& information, const Vector& healthy, double r0_ohm, double unseen_share) {
  Isolability result;
  result.causes.assign(cell_causes.begin(), cell_causes.end());
  result.separable = separable(data_of(information, healthy, unseen_share, nullptr), r0_ohm);
  const std::size_t now = pairs_in(result.separable);
  for (const Sensor& sensor : added_sensors) {
    const std::size_t then = pairs_in(separable(data_of(information, healthy, unseen_share, &sensor), r0_ohm));
    result.added.push_back({sensor.name, then > now ? then - now : 0});
  }
  std::stable_sort(result.added.begin(), result.added.end(),
                   [](const auto& a, const auto& b) { return a.pairs > b.pairs; });
  return result;
}

std::vector<PackLimit> detection_limits_of(const Matrix& information, const Vector& healthy, double r0_ohm,
                                           const PackLikelihood& likelihood) {
  const Data d = data_of(information, healthy, likelihood.unseen_share(), nullptr);
  std::vector<PackLimit> list;
  for (const Cause cause : cell_causes) {
    const double least = likelihood.least()[static_cast<Eigen::Index>(parameter_of(cause))];
    // the gain is a square of the size minus a constant
    const auto gain_at = [&](double size) {
      const Eigen::VectorXd with_data = d.information.col(place_of(cause)) * size;
      return marginal_for(d, with_data, cause, r0_ohm) - log_marginal(d.information, with_data, d.healthy);
    };
    const double constant = gain_at(0), of_example = gain_at(example_of(cause, r0_ohm)) - constant;
    if (!(of_example > 0)) continue;
    const double size = example_of(cause, r0_ohm) * std::sqrt((likelihood.least_gain() - constant) / of_example);
    const double sampling = cause == Cause::late ? least : 0;
    const double limit = std::max({least, size, sampling + significant_size(d, cause, r0_ohm)});
    if (limit <= largest_size(cause, r0_ohm)) list.push_back({cause, limit});
  }
  return list;
}

std::vector<Cause> without_limit(const std::vector<PackLimit>& stated) {
  std::vector<Cause> causes;
  for (const Cause cause : cell_causes) {
    if (std::none_of(stated.begin(), stated.end(), [&](const PackLimit& l) { return l.cause == cause; }))
      causes.push_back(cause);
  }
  return causes;
}

}  // namespace bms::diagnosis::pack
