// The RC branch of the grey box, discretised step by step.
#pragma once

#include "model/one_rc.hpp"

namespace bms::identification {

/// Discretises again only where the result differs: with one node, R1 and C1 are the same at every SOC.
template <class S>
class Discretiser {
 public:
  explicit Discretiser(bool several_nodes) : several_nodes_(several_nodes) {}

  const typename model::OneRc<S>::Discretisation& of(const model::TablePoint<S>& at, double duration_s) {
    if (several_nodes_ || duration_s != duration_s_) last_ = model::OneRc<S>::discretise(at, S(duration_s));
    duration_s_ = duration_s;
    return last_;
  }

 private:
  bool several_nodes_;
  double duration_s_ = 0;
  typename model::OneRc<S>::Discretisation last_{};
};

}  // namespace bms::identification
