#include "model/cell.hpp"

int plain() { return consumer::cells; }
