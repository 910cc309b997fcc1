// The back end of the core that this is compiled for. The only place that asks which core it is.
#pragma once

#if defined(__ARM_ARCH_6M__)
#include "arithmetic/armv6m.hpp"
#else
#include "arithmetic/no_backend.hpp"
#endif
