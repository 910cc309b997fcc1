// The textbook covariance of a Kalman filter with Eigen's fixed-size matrices: the reference for UdCovariance, which it
// can replace in ReferenceFilter.
//
//   propagate   P <- F P F' + diag(q)
//   observe     K = P h' / (h P h' + r), and one of
//     joseph    P <- (I - K h) P (I - K h)' + K r K'      symmetric and positive; more arithmetic
//     plain     P <- P - K h P                            less arithmetic; rounding can make P indefinite
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

namespace bms::tests {

enum class Form { joseph, plain };

template <class S, std::size_t N, Form form = Form::joseph>
class EigenCovariance {
  static constexpr int n = static_cast<int>(N);

 public:
  using Square = Eigen::Matrix<S, n, n>;
  using Vector = Eigen::Matrix<S, n, 1>;
  using Matrix = std::array<std::array<S, N>, N>;
  using Row = std::array<S, N>;
  using Variances = std::array<S, N>;

  void set_diagonal(const Variances& variances) { p_ = Square(vector(variances).asDiagonal()); }

  template <std::size_t K>
  S variance() const {
    return p_(static_cast<int>(K), static_cast<int>(K));
  }

  void propagate(const Matrix& f_rows, const Variances& q) {
    const Square f = Eigen::Map<const Eigen::Matrix<S, n, n, Eigen::RowMajor>>(f_rows[0].data());
    const Square p = f * p_ * f.transpose();
    p_ = p;
    p_.diagonal() += vector(q);
  }

  /// r: variance of the measurement; e: innovation. Returns the correction of each state.
  std::array<S, N> observe(const Row& h_row, const S& r, const S& e) {
    const Vector h = vector(h_row), ph = p_ * h;
    const Vector k = ph / (h.dot(ph) + r);
    if constexpr (form == Form::joseph) {
      const Square a = Square::Identity() - k * h.transpose();
      const Square p = a * p_ * a.transpose() + r * k * k.transpose();
      p_ = p;
    } else {
      p_ -= k * ph.transpose();
    }
    std::array<S, N> correction{};
    for (std::size_t i = 0; i < N; ++i) correction[i] = k(static_cast<int>(i)) * e;
    return correction;
  }

  const Square& dense() const { return p_; }

 private:
  static Vector vector(const std::array<S, N>& values) { return Eigen::Map<const Vector>(values.data()); }

  Square p_ = Square::Zero();
};

}  // namespace bms::tests
