// Files of signed containers (firmware/boot/container.hpp): makes them from linked images, reads and checks them.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "boot/container.hpp"
#include "update/signing_key.hpp"

namespace bms::update {

struct Container {
  boot::Header header;
  std::string bytes;  ///< header and payload as they are sent

  boot::HeaderBytes header_bytes() const;
};

/// Payload of one slot and what its header says, apart from release and key.
struct Payload {
  boot::Header header;
  std::string bytes;
};

/// Signs payloads of one release. Their header states slot, version and so on; sizes, hashes, key and release are
/// computed. Throws BadInput if a payload is too large.
std::vector<Container> sign(std::vector<Payload> payloads, const SigningKey& key);

/// The containers of a file. Throws BadInput for anything else; checks no signature.
std::vector<Container> read_containers(const std::filesystem::path& path);

/// Returns why a container is not what its header says, or Refusal::none: every block's hash, and the signature.
boot::Refusal check(const Container& container, const boot::PublicKey& key);

/// 0.2.0 for 0x00000200
std::string version_text(std::uint32_t version);
/// Throws BadInput, with `name` in front, if the text is not three numbers.
std::uint32_t read_version(const std::string& name, const std::string& text);

}  // namespace bms::update
