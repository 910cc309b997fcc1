// Covariance of the state as P = U D U', U unit upper triangular, D diagonal: symmetric by construction. P is positive
// while every entry of D is, and both operations below compute D from sums and quotients of positive numbers only. The
// factors need half the digits of P itself, so that float and fixed point are enough.
//
//   propagate   P <- F P F' + diag(q), F upper triangular. Column by column: that of F U and that of the noise become
//               one, with the weight d q / (d f^2 + q) left for the columns before it, which are updated by this rank
//               one (Agee and Turner 1972). Gram-Schmidt, which keeps both columns to the end, takes half as long again
//               for seven states
//   observe     one scalar measurement z = h x + noise(r)      Bierman 1977
//
// G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation" (1977), chapters III and V.
// With more than two states, couplings are stored in steps of 1e-13. Where no voltage corrects the states for hours,
// couplings decay until they or their products are subnormal numbers, and most processors take a hundred times as long
// for those: with the file of another cell a step took seven times as long. The variances are at least 1e-12 (in units
// of V2 and 1), to which half a step adds less than 1e-26.
// The last entry of D is the variance of the last state, without arithmetic; this is the SOC's place if no state acts
// on it. Memory: N (N + 1) / 2 numbers. Cost: estimator/README.md.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

/// For propagate(): every state may depend on every later one.
struct EveryState {
  static constexpr bool of(std::size_t, std::size_t) { return true; }
};

template <class S, std::size_t N>
class UdCovariance {
  using Variance = arithmetic::Variance<S>;
  using Coupling = arithmetic::Coupling<S>;
  using State = arithmetic::Voltage<S>;  // also SOC: the same range in every scalar

 public:
  using Matrix = std::array<std::array<Coupling, N>, N>;
  using Row = std::array<arithmetic::VoltagePerSoc<S>, N>;
  using Variances = std::array<Variance, N>;

  constexpr void set_diagonal(const Variances& variances) {
    d_ = variances;
    u_ = {};
  }

  /// D: the variance of each state given the later ones; for the last state its whole variance.
  constexpr const Variances& variances() const { return d_; }

  /// Resets state K: sets its variance and removes its correlation with all other states.
  template <std::size_t K>
  constexpr void reset(const Variance& variance) {
    d_[K] = variance;
    for (std::size_t i = 0; i < K; ++i) u(i, K) = Coupling{};
    if constexpr (K + 1 < N) {
      for (std::size_t j = K + 1; j < N; ++j) u(K, j) = Coupling{};
    }
  }

  /// Adds process noise to the last state alone.
  constexpr void add_noise_to_last(const Variance& by) { d_[N - 1] = Variance(d_[N - 1] + by); }

  /// Whole variance of state K.
  template <std::size_t K>
  constexpr Variance variance() const {
    Variance sum = d_[K];
    if constexpr (K + 1 < N) {
      for (std::size_t j = K + 1; j < N; ++j)
        sum = Variance(sum + arithmetic::product<Variance>(arithmetic::product<Variance>(d_[j], u(K, j)), u(K, j)));
    }
    return sum;
  }

  /// Couples: whether f[i][k], i < k, may be other than 0.
  template <class Couples = EveryState>
  constexpr void propagate(const Matrix& f, const Variances& q) {
#pragma GCC unroll 8
    for (std::size_t k = 0; k < N; ++k) {
      std::array<Coupling, N> rest;  // column k of F U above the diagonal; then what is left next to the new column
#pragma GCC unroll 8
      for (std::size_t i = 0; i < k; ++i) {
        Coupling sum = Couples::of(i, k) ? f[i][k] : Coupling{};  // U's diagonal is 1
#pragma GCC unroll 8
        for (std::size_t m = i; m < k; ++m) {
          if (m == i || Couples::of(i, m)) sum = Coupling(sum + f[i][m] * u(m, k));
        }
        rest[i] = sum;
      }
      const Coupling own = f[k][k];
      const Variance before = d_[k];
      d_[k] = Variance(q[k] + arithmetic::product<Variance>(arithmetic::product<Variance>(before, own), own));
      if (k == 0) continue;
      const Coupling share = arithmetic::ratio<Coupling>(before, d_[k]);
#pragma GCC unroll 8
      for (std::size_t i = 0; i < k; ++i)
        u(i, k) = kept(arithmetic::product<Coupling>(arithmetic::product<Coupling>(share, rest[i]), own), k);
      Variance weight = arithmetic::product<Variance>(q[k], share);
#pragma GCC unroll 8
      for (std::size_t last = 1; last < k; ++last) {
        const std::size_t j = k - last;
        const Variance weighted = arithmetic::product<Variance>(weight, rest[j]), old = d_[j];
        d_[j] = Variance(old + arithmetic::product<Variance>(weighted, rest[j]));
        const Variance per_all = arithmetic::ratio<Variance>(Variance(1), d_[j]);
        const Coupling gain = arithmetic::product<Coupling>(weighted, per_all);
        weight = arithmetic::product<Variance>(arithmetic::product<Variance>(weight, per_all), old);
#pragma GCC unroll 8
        for (std::size_t i = 0; i < j; ++i) {
          rest[i] = Coupling(rest[i] - rest[j] * u(i, j));
          u(i, j) = kept(Coupling(u(i, j) + gain * rest[i]), k);
        }
      }
      d_[0] = Variance(d_[0] + arithmetic::product<Variance>(arithmetic::product<Variance>(weight, rest[0]), rest[0]));
    }
  }

  /// Updates with a measurement: Jacobian h, noise variance r > 0, innovation e (measured minus predicted). Returns the
  /// correction of each state, P h' e / (h P h' + r).
  constexpr std::array<State, N> observe(const Row& h, const Variance& r, const State& e) {
    std::array<Variance, N> b{};  // U D U' h', built column by column
    Variance alpha = r;           // variance of the innovation, from the states so far
    Variance per_alpha{};         // 1 / alpha
#pragma GCC unroll 8
    for (std::size_t j = 0; j < N; ++j) {
      Coupling f = h[j];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < j; ++k) f = Coupling(f + u(k, j) * h[k]);
      const Variance g = arithmetic::product<Variance>(d_[j], f), before = alpha, per_before = per_alpha;
      alpha = Variance(alpha + arithmetic::product<Variance>(g, f));
      per_alpha = arithmetic::ratio<Variance>(Variance(1), alpha);
      d_[j] = arithmetic::product<Variance>(arithmetic::product<Variance>(d_[j], per_alpha), before);
#pragma GCC unroll 8
      for (std::size_t i = 0; i < j; ++i) {
        const Coupling old = u(i, j);
        u(i, j) = Coupling(old - arithmetic::product<Coupling>(arithmetic::product<Coupling>(b[i], per_before), f));
        b[i] = Variance(b[i] + arithmetic::product<Variance>(g, old));
      }
      b[j] = g;
    }
    const Coupling off = arithmetic::product<Coupling>(e, per_alpha);
    std::array<State, N> correction;
#pragma GCC unroll 8
    for (std::size_t i = 0; i < N; ++i) correction[i] = arithmetic::product<State>(b[i], off);
    return correction;
  }

  /// P itself, row by row; for reports and tests.
  constexpr std::array<std::array<double, N>, N> dense() const {
    std::array<std::array<double, N>, N> p{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = 0; j < N; ++j) {
        for (std::size_t k = i > j ? i : j; k < N; ++k) {
          const double left = i == k ? 1.0 : arithmetic::as_double(u(i, k)),
                       right = j == k ? 1.0 : arithmetic::as_double(u(j, k));
          p[i][j] += left * right * arithmetic::as_double(d_[k]);
        }
      }
    }
    return p;
  }

 private:
  friend struct LaneAccess;

  /// A coupling as it is stored at the end of a step, in column `last` of the noise: in steps of 2^-43.
  static constexpr Coupling kept(const Coupling& coupling, std::size_t last) {
    if constexpr (N > 2 && std::floating_point<S>) {
      constexpr S coarse(std::same_as<S, float> ? 0x1.8p-20 : 0x1.8p9);
      if (last == N - 1) return (coupling + coarse) - coarse;
    }
    return coupling;
  }
  static constexpr std::size_t place(std::size_t i, std::size_t j) { return j * (j - 1) / 2 + i; }
  constexpr Coupling& u(std::size_t i, std::size_t j) { return u_[place(i, j)]; }
  constexpr const Coupling& u(std::size_t i, std::size_t j) const { return u_[place(i, j)]; }

  std::array<Variance, N> d_{};
  std::array<Coupling, N*(N - 1) / 2> u_{};  // above the diagonal, column by column
};

}  // namespace bms::estimator
