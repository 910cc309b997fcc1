// A smooth curve through points: cubic between neighbours, with a continuous slope and without overshoot. It is
// monotone where the points are.
//
// The slope at a point is the weighted harmonic mean of the two neighbouring chords, or 0 where they differ in sign
// (Fritsch and Butland, 1984). At and beyond an end it is the slope of the last chord.
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
