// A smooth curve through points: cubic between neighbours, continuous slope, no overshoot. It rises where the points
// rise.
//
// The slope at a point is the weighted harmonic mean of the two neighbouring chords, 0 where they differ in sign
// (Fritsch and Butland, 1984); at an end, and straight on beyond it, the slope of the last chord.
#pragma once

#include <vector>

namespace bms::plant {

struct Point {
  double x, y;
};

class MonotoneCurve {
 public:
  /// At least two points, x rising.
  explicit MonotoneCurve(std::vector<Point> points);

  double at(double x) const;

 private:
  std::vector<Point> points_;
  std::vector<double> slopes_;
};

}  // namespace bms::plant
