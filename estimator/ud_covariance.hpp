// Covariance of the state as P = U D U', U unit upper triangular, D diagonal: symmetric by construction. P is positive
// while every entry of D is, and both operations below compute D from sums and quotients of positive numbers only. The
// factors need half the digits of P itself, so that float and fixed point are enough.
//
//   propagate   P <- F P F' + diag(q), F upper triangular      modified weighted Gram-Schmidt (Thornton 1976). The
//               projection of the last state merges its two columns into one, with the weight d q / (d f^2 + q)
//   observe     one scalar measurement z = h x + noise(r)      Bierman 1977
//
// Both as in G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation" (1977), chapters V and VI.
// With more than two states, couplings below 1e-9 are taken for none. Where no voltage corrects the states for hours,
// couplings decay until they or their products are subnormal numbers, and most processors take a hundred times as long
// for those: with the file of another cell a step took seven times as long. The variances are at least 1e-12 (in units
// of V2 and 1), to which such a coupling adds less than 1e-18.
// The last entry of D is the variance of the last state, without arithmetic; this is the SOC's place if no state acts
// on it. Memory: N (N + 1) / 2 numbers. Cost: estimator/README.md.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

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

  constexpr void propagate(const Matrix& f, const Variances& q) {
    // rows of [F U | I], weighted by [D | q]; both blocks are upper triangular and stay so
    Matrix state{}, noise{};
#pragma GCC unroll 8
    for (std::size_t i = 0; i < N; ++i) {
#pragma GCC unroll 8
      for (std::size_t j = i; j < N; ++j) {
        Coupling sum = f[i][j];  // U's diagonal is 1
#pragma GCC unroll 8
        for (std::size_t k = i; k < j; ++k) sum = Coupling(sum + f[i][k] * u(k, j));
        state[i][j] = sum;
      }
    }
    Variances d = d_;
    // The last row has one entry in each block. After its projection the remainders in both blocks are proportional, so
    // one column replaces two.
    {
      const Coupling f_last = state[N - 1][N - 1];
      const Variance sum =
          Variance(q[N - 1] + arithmetic::product<Variance>(arithmetic::product<Variance>(d[N - 1], f_last), f_last));
      const Coupling share = arithmetic::ratio<Coupling>(d[N - 1], sum);
#pragma GCC unroll 8
      for (std::size_t i = 0; i + 1 < N; ++i)
        u(i, N - 1) = arithmetic::product<Coupling>(arithmetic::product<Coupling>(share, state[i][N - 1]), f_last);
      d_[N - 1] = sum;
      d[N - 1] = arithmetic::product<Variance>(q[N - 1], share);
    }
#pragma GCC unroll 8
    for (std::size_t last = 1; last < N; ++last) {
      const std::size_t j = N - 1 - last;
      Variances weighted;  // row j times its weights
      Variance sum = q[j];
#pragma GCC unroll 8
      for (std::size_t k = j; k < N; ++k) {
        weighted[k] = arithmetic::product<Variance>(d[k], state[j][k]);
        sum = Variance(sum + arithmetic::product<Variance>(weighted[k], state[j][k]));
      }
#pragma GCC unroll 8
      for (std::size_t k = j + 1; k + 1 < N; ++k)
        sum = Variance(sum +
                       arithmetic::product<Variance>(arithmetic::product<Variance>(q[k], noise[j][k]), noise[j][k]));
      d_[j] = sum;
#pragma GCC unroll 8
      for (std::size_t i = 0; i < j; ++i) {
        Variance cross{};
#pragma GCC unroll 8
        for (std::size_t k = j; k < N; ++k)
          cross = Variance(cross + arithmetic::product<Variance>(weighted[k], state[i][k]));
#pragma GCC unroll 8
        for (std::size_t k = j + 1; k + 1 < N; ++k)
          cross = Variance(
              cross + arithmetic::product<Variance>(arithmetic::product<Variance>(q[k], noise[j][k]), noise[i][k]));
        const Coupling projected = arithmetic::ratio<Coupling>(cross, sum);
        u(i, j) = projected;
#pragma GCC unroll 8
        for (std::size_t k = j; k < N; ++k) state[i][k] = Coupling(state[i][k] - projected * state[j][k]);
        noise[i][j] = -projected;  // row j's own noise has weight 1
#pragma GCC unroll 8
        for (std::size_t k = j + 1; k + 1 < N; ++k) noise[i][k] = Coupling(noise[i][k] - projected * noise[j][k]);
      }
    }
    if constexpr (N > 2 && std::floating_point<S>) {
      for (Coupling& coupling : u_) {
        if (arithmetic::magnitude(coupling) < S(1e-9)) coupling = S(0);
      }
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

  static constexpr std::size_t place(std::size_t i, std::size_t j) { return j * (j - 1) / 2 + i; }
  constexpr Coupling& u(std::size_t i, std::size_t j) { return u_[place(i, j)]; }
  constexpr const Coupling& u(std::size_t i, std::size_t j) const { return u_[place(i, j)]; }

  std::array<Variance, N> d_{};
  std::array<Coupling, N*(N - 1) / 2> u_{};  // above the diagonal, column by column
};

}  // namespace bms::estimator
