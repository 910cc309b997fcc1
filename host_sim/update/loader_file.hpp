// The boot loader as a file, with the public keys of its batteries (firmware/boot/key_table.hpp).
#pragma once

#include <string>
#include <vector>

#include "boot/crypto.hpp"

namespace bms::update {

struct LoaderKey {
  boot::PublicKey point{};
  bool development = false;
};

/// A copy of the linked loader `elf` with these keys, at most boot::most_keys, as `out`. Throws BadInput for a file of
/// another kind and for too many keys.
void write_loader(const std::string& elf, const std::vector<LoaderKey>& keys, const std::string& out);

}  // namespace bms::update
