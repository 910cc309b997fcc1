#include "tests/common_headers.hpp"
