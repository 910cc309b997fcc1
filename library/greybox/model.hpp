// The model of a cell with its mechanisms: what a header made by `bms cell header` is written in.
#pragma once

#include "model/cell.hpp"
#include "model/extended.hpp"
#include "model/extended_rc.hpp"
