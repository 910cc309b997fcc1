// Every number that a verdict hangs on, in one place. Costs and gains are differences of -2 log posterior: a gain of
// x^2 is an effect of x standard deviations. Where they come from: README.md, "How the thresholds were found".
#pragma once

#include <cstddef>

namespace bms::diagnosis::decision {

inline constexpr double detected =
    26;  ///< gain of one mechanism over the calibration that chance reaches in 1 of 216 healthy recordings
inline constexpr double far_k = 8;           ///< from the cell file's temperature, where resistances must have changed
inline constexpr double worth_a_fit = 5;     ///< first-order gain below which a mechanism is not fitted
inline constexpr std::size_t most_fits = 6;  ///< of mechanisms beside each other
inline constexpr std::size_t most_rivals = 5;   ///< of mechanisms in the place of another
inline constexpr double hopeless = 80;          ///< a rival this far behind the best is not fitted to the end
inline constexpr double same = 7;               ///< rivals this close cannot be told apart
inline constexpr double inseparable = 0.97;     ///< signatures this much alike are one class
inline constexpr double same_inseparable = 30;  ///< and of a class all this close are named
inline constexpr double per_unknown = 3;        ///< cost of every unknown after the first
inline constexpr double per_burst = 12;  ///< cost of every burst of a loose contact: two moments that were sought
inline constexpr double faint =
    52;  ///< gain, twice what is detected, below which a cause must explain its share or is none
inline constexpr double explained = 0.8;             ///< share of the mismatch that a cause must explain
inline constexpr double explained_by_bursts = 0.98;  ///< and one that may come and go as it likes
inline constexpr double much_left = 40;  ///< what must remain, in gain, to say that something unknown is there
inline constexpr double larger_than_error =
    3;  ///< one of several causes does not move the voltage by more than this times the error
inline constexpr double noticeable =
    0.02;  ///< share of the error that one of several causes moves the voltage by at least, or
inline constexpr double noticeable_gain =
    0.05;                                 ///< of what all gain together: a moment's effect is small by its mean square
inline constexpr double may_grow = 1.15;  ///< of the plain error, by adding a cause
inline constexpr double temper = 1.5;     ///< log-likelihoods are this much too sure of themselves
inline constexpr double settled = 40;     ///< gain by which a next experiment should part rivals: more than
                                          ///< same_inseparable, as no forecast is quite right
inline constexpr double far_out =
    0.003;  ///< share of the whitened residual beyond 4 deviations that single bad readings do not reach
inline constexpr double surely =
    0.93;  ///< no probability is larger: of what nothing in the catalogue came near, as many were right
inline constexpr double fast_excess = 0.25;  ///< variance of the whitened residual above 1 that noise does not reach

}  // namespace bms::diagnosis::decision
