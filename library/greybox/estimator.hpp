// The estimator for one cell: a Sample goes in, an Estimate with its standard deviation comes out.
//
//   #include "my_cell.hpp"               // bms cell header my_cell.toml --out my_cell.hpp
//   #include <greybox/estimator.hpp>
//
//   greybox::Estimator<float, bms::generated::Model> estimator;
//   const auto estimate = estimator.step(bms::generated::cell<float>, sample);
//
// float for a core with an FPU, greybox::FixedPoint for one without, double for a host. Compile with C++20 and, for the
// same bits on every core, with -ffp-contract=off. No heap, no exceptions, no clock, no input or output.
#pragma once

#include "arithmetic/scalar.hpp"
#include "estimator/estimate.hpp"
#include "estimator/soc_estimator.hpp"
#include "measurement/sample.hpp"

namespace greybox {

using bms::arithmetic::FixedPoint;       ///< the scalar of a core without an FPU
using bms::estimator::Estimate;          ///< state of charge, its standard deviation, voltages, flags
using bms::estimator::Flag;              ///< why an estimate is less accurate than usual
using bms::measurement::no_reading;      ///< a current or a voltage that is missing
using bms::measurement::no_temperature;  ///< a temperature that is missing
using bms::measurement::Sample;          ///< time, current, voltage, temperature of a cell, in micro-units
using bms::measurement::StartingPoint;   ///< state of charge before the first sample, from your storage

/// Estimator of a cell. S: its scalar; Model: that of the header of the cell.
template <class S, template <class> class Model>
using Estimator = bms::estimator::SocEstimator<S, Model>;

}  // namespace greybox
