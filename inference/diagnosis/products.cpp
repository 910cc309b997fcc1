// Tiles of the product are summed in registers while the rows pass, a few hundred rows at a time: these stay in the
// cache. Each element is the sum over the rows in their order, whatever the tiles are.
#include "diagnosis/products.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "arithmetic/vector_width.hpp"
#include "diagnosis/numerics.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

using arithmetic::FourDoubles;
/// Rows and columns of a tile, in elements of the product; rows that pass at a time.
constexpr std::size_t tile_rows = arithmetic::doubles_at_once, tile_columns = 2 * arithmetic::doubles_at_once,
                      rows_at_once = tile_rows * tile_columns * tile_columns;

constexpr std::size_t whole(std::size_t count, std::size_t tile) { return (count + tile - 1) / tile * tile; }

/// Some rows of a matrix, filled up with zeros to whole tiles.
class Strip {
 public:
  explicit Strip(std::size_t columns) : stride_(whole(columns, tile_columns)), values_(stride_ * rows_at_once, 0.0) {}

  void take(const AnyColumns& from, Eigen::Index first, Eigen::Index rows) {
    double* to = values_.data();
    for (Eigen::Index k = first; k < first + rows; ++k, to += stride_) {
      const double* row = from.data() + k * from.outerStride();
      arithmetic::each_register(static_cast<std::size_t>(from.cols()), [&]<class Value>(std::size_t at) {
        arithmetic::Loaded<Value>(row + at).store(to + at);
      });
    }
  }
  const double* column(std::size_t first) const { return values_.data() + first; }
  std::size_t stride() const { return stride_; }

 private:
  std::size_t stride_;
  std::vector<double> values_;
};

/// Two registers of a row of a tile. Members instead of an array: g++ then keeps them in registers.
struct TileRow {
  arithmetic::Loaded<FourDoubles> low, high;

  explicit TileRow(const double* from) : low(from), high(from + arithmetic::doubles_at_once) {}
  void add(double a, const TileRow& b) {
    low.value += a * b.low.value;
    high.value += a * b.high.value;
  }
  void store(double* to) const {
    low.store(to);
    high.store(to + arithmetic::doubles_at_once);
  }
};

/// Members instead of an array here as well.
template <std::size_t Rows>
struct Tile {
  TileRow first;
  Tile<Rows - 1> rest;

  Tile(const double* from, std::size_t stride) : first(from), rest(from + stride, stride) {}
  void add(const double* a, const TileRow& b) {
    first.add(*a, b);
    rest.add(a + 1, b);
  }
  void store(double* to, std::size_t stride) const {
    first.store(to);
    rest.store(to + stride, stride);
  }
};
template <>
struct Tile<0> {
  Tile(const double*, std::size_t) {}
  void add(const double*, const TileRow&) {}
  void store(double*, std::size_t) const {}
};

/// Adds a tile of a' b to `sum`, whose rows are `stride` apart.
void add_tile(const double* a, std::size_t a_stride, const double* b, std::size_t b_stride, std::size_t rows,
              double* sum, std::size_t stride) {
  Tile<tile_rows> tile(sum, stride);
  for (std::size_t k = 0; k < rows; ++k, a += a_stride, b += b_stride) tile.add(a, TileRow(b));
  tile.store(sum, stride);
}

/// Rows of tiles that a thread sums: each so many, from the first on.
struct Share {
  std::size_t first, step;
};

/// Adds a share of the tiles of a' b to `sum`. symmetric: tiles that lie below the diagonal are left out.
void add_tiles(const AnyColumns& a, const AnyColumns& b, bool symmetric, Share share, std::vector<double>& sum) {
  const auto rows_of_result = static_cast<std::size_t>(a.cols()),
             columns_of_result = static_cast<std::size_t>(b.cols());
  Strip strip_a(symmetric ? 0 : rows_of_result), strip_b(columns_of_result);
  const Strip& left = symmetric ? strip_b : strip_a;
  const std::size_t stride = whole(columns_of_result, tile_columns);
  for (Eigen::Index first = 0; first < a.rows(); first += static_cast<Eigen::Index>(rows_at_once)) {
    const Eigen::Index rows = std::min(static_cast<Eigen::Index>(rows_at_once), a.rows() - first);
    arithmetic::in_widest_vectors([&] {
      if (!symmetric) strip_a.take(a, first, rows);
      strip_b.take(b, first, rows);
      for (std::size_t i = share.first * tile_rows; i < rows_of_result; i += share.step * tile_rows) {
        for (std::size_t j = symmetric ? i / tile_columns * tile_columns : 0; j < columns_of_result; j += tile_columns)
          add_tile(left.column(i), left.stride(), strip_b.column(j), strip_b.stride(), static_cast<std::size_t>(rows),
                   sum.data() + i * stride + j, stride);
      }
    });
  }
}

/// symmetric: the upper triangle is summed.
Eigen::MatrixXd sum_of_tiles(const AnyColumns& a, const AnyColumns& b, bool symmetric) {
  const auto rows_of_result = static_cast<std::size_t>(a.cols()),
             columns_of_result = static_cast<std::size_t>(b.cols());
  const std::size_t stride = whole(columns_of_result, tile_columns),
                    tiles = whole(rows_of_result, tile_rows) / tile_rows;
  std::vector<double> sum(tiles * tile_rows * stride, 0.0);
  const bool large = static_cast<double>(a.rows()) * static_cast<double>(a.cols()) * static_cast<double>(b.cols()) >
                     numerics.products.worth_a_thread;
  const std::size_t pieces = large ? std::min(numerics::best_pieces(), tiles) : 1;
  numerics::in_parallel(pieces, [&](std::size_t k) { add_tiles(a, b, symmetric, {k, pieces}, sum); });
  Eigen::MatrixXd result(a.cols(), b.cols());
  for (std::size_t i = 0; i < rows_of_result; ++i) {
    for (std::size_t j = 0; j < columns_of_result; ++j) {
      const bool below = symmetric && j < i;
      result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          below ? sum[j * stride + i] : sum[i * stride + j];
    }
  }
  return result;
}

}  // namespace

Eigen::MatrixXd squared(const AnyColumns& columns) { return sum_of_tiles(columns, columns, true); }

Eigen::MatrixXd products(const AnyColumns& a, const AnyColumns& b) { return sum_of_tiles(a, b, false); }

}  // namespace bms::diagnosis
