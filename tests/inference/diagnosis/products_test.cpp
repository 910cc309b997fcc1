#include "diagnosis/products.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace bms::diagnosis {
namespace {

/// Element by element, which shares nothing with tiles.
double product_of(const Columns& a, Eigen::Index i, const Columns& b, Eigen::Index j) {
  double sum = 0;
  for (Eigen::Index k = 0; k < a.rows(); ++k) sum += a(k, i) * b(k, j);
  return sum;
}

Columns waves(Eigen::Index rows, Eigen::Index columns, double phase) {
  Columns c(rows, columns);
  for (Eigen::Index k = 0; k < rows; ++k) {
    for (Eigen::Index j = 0; j < columns; ++j)
      c(k, j) = std::sin(phase + 0.37 * static_cast<double>(k) + 1.3 * static_cast<double>(j * j));
  }
  return c;
}

TEST(Products, AreTheSumsOverTheRowsForEveryWidth) {
  for (const Eigen::Index rows : {0, 1, 255, 256, 257, 700}) {
    for (const Eigen::Index wide : {1, 3, 4, 9, 17}) {
      for (const Eigen::Index narrow : {1, 4, 5, 8}) {
        const Columns a = waves(rows, wide, 0.1), b = waves(rows, narrow, 0.9);
        const Eigen::MatrixXd found = products(a, b);
        ASSERT_EQ(found.rows(), wide);
        ASSERT_EQ(found.cols(), narrow);
        for (Eigen::Index i = 0; i < wide; ++i) {
          for (Eigen::Index j = 0; j < narrow; ++j)
            ASSERT_EQ(found(i, j), product_of(a, i, b, j)) << rows << ' ' << wide << ' ' << narrow;
        }
      }
    }
  }
}

TEST(Products, OfColumnsWithThemselvesAreSymmetric) {
  for (const Eigen::Index columns : {1, 4, 7, 8, 13, 24}) {
    const Columns a = waves(300, columns, 0.4);
    const Eigen::MatrixXd found = squared(a);
    for (Eigen::Index i = 0; i < columns; ++i) {
      for (Eigen::Index j = 0; j < columns; ++j) ASSERT_EQ(found(i, j), product_of(a, i, a, j)) << i << ' ' << j;
    }
  }
}

TEST(Products, OfSomeColumnsOfAMatrixReadNoOthers) {
  Columns a = waves(300, 9, 0.2);
  const Columns middle = a.middleCols(3, 2);
  a.leftCols(3).setConstant(std::nan(""));
  a.rightCols(4).setConstant(std::nan(""));
  EXPECT_EQ(squared(a.middleCols(3, 2)), squared(middle));
}

}  // namespace
}  // namespace bms::diagnosis
