// The device key of a pack from a file: 32 hexadecimal digits in one line. boards/stm32f405_forklift/README.md says how
// a production line makes and keeps them.
#pragma once

#include <string>

#include "authentication/codes.hpp"

namespace bms::tool {

/// Throws BadInput if the file is anything else.
authentication::Key read_key(const std::string& path);

}  // namespace bms::tool
