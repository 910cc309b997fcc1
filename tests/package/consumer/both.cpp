#include <greybox/condition.hpp>
#include <greybox/estimator.hpp>
#include <greybox/pack.hpp>

#include "model/cell.hpp"

int both() { return consumer::cells + static_cast<int>(sizeof(greybox::Sample)); }
