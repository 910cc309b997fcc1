// Has the name of a header of greybox-bms.
#pragma once

namespace consumer {

inline constexpr int cells = 16;

}  // namespace consumer
