#include "tests/common_instances.hpp"

BMS_COMMON_INSTANCES(template)
