#include "update/container_file.hpp"

#include <regex>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"

namespace bms::update {

namespace {

using namespace boot;

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::vector<Digest> hashes_of(const Header& header, const std::string& payload) {
  std::vector<Digest> hashes;
  for (std::uint32_t k = 0; k < header.blocks(); ++k)
    hashes.push_back(sha256(bytes_of(payload).subspan(k * block_bytes, header.block_size(k))));
  return hashes;
}

}  // namespace

HeaderBytes Container::header_bytes() const {
  HeaderBytes out{};
  std::ranges::copy(bytes_of(bytes).first(boot::header_bytes), out.begin());
  return out;
}

std::vector<Container> sign(std::vector<Payload> payloads, const SigningKey& key) {
  Sha256 all;
  for (const Payload& p : payloads) {  // with what the header says: the same code as another version is another release
    HeaderBytes header{};
    write_header(p.header, {}, header);
    all.add(header);
    all.add(bytes_of(p.bytes));
  }
  const Digest release = all.finish();
  std::vector<Container> out;
  for (Payload& p : payloads) {
    if (p.bytes.empty() || p.bytes.size() > most_blocks * block_bytes)
      throw files::BadInput("payload", 1,
                            fmt::format("has {} bytes, expected 1 to {}", p.bytes.size(), most_blocks * block_bytes));
    p.header.payload_bytes = static_cast<std::uint32_t>(p.bytes.size());
    p.header.key = key_id(key.public_key());
    std::copy_n(release.begin(), p.header.release.size(), p.header.release.begin());
    HeaderBytes header{};
    write_header(p.header, hashes_of(p.header, p.bytes), header);
    const Signature signature = key.sign(sha256(std::span(header).first<signed_bytes>()));
    std::ranges::copy(signature, header.begin() + signed_bytes);
    out.push_back({p.header, std::string(header.begin(), header.end()) + p.bytes});
  }
  return out;
}

std::vector<Container> read_containers(const std::filesystem::path& path) {
  const std::string all = files::read_file(path);
  std::vector<Container> out;
  for (std::size_t at = 0; at < all.size();) {
    const std::size_t left = all.size() - at;
    Container c;
    if (left >= boot::header_bytes) c.bytes = all.substr(at, boot::header_bytes);
    const Refusal why = left < boot::header_bytes ? Refusal::incomplete : read_header(c.header_bytes(), c.header);
    if (why != Refusal::none)
      throw files::BadInput(path.string(), 1,
                            fmt::format("{}, expected a file that bms image sign writes", words_for(why)));
    if (left - boot::header_bytes < c.header.payload_bytes)
      throw files::BadInput(path.string(), 1,
                            fmt::format("ends after {} of {} bytes of the image", all.size() - at,
                                        boot::header_bytes + c.header.payload_bytes));
    c.bytes = all.substr(at, boot::header_bytes + c.header.payload_bytes);
    at += c.bytes.size();
    out.push_back(std::move(c));
  }
  if (out.empty()) throw files::BadInput(path.string(), 1, "is empty, expected a file that bms image sign writes");
  return out;
}

Refusal check(const Container& container, const PublicKey& key) {
  const HeaderBytes header = container.header_bytes();
  if (container.header.key != key_id(key)) return Refusal::unknown_key;
  if (!signature_right(key, sha256(std::span(header).first<signed_bytes>()), stated_signature(header)))
    return Refusal::bad_signature;
  const auto hashes = hashes_of(container.header, container.bytes.substr(boot::header_bytes));
  for (std::uint32_t k = 0; k < hashes.size(); ++k) {
    if (hashes[k] != stated_hash(header, k)) return Refusal::block_damaged;
  }
  return Refusal::none;
}

std::string version_text(std::uint32_t version) {
  return fmt::format("{}.{}.{}", version >> 16, version >> 8 & 0xFF, version & 0xFF);
}

std::uint32_t read_version(const std::string& name, const std::string& text) {
  static const std::regex form(R"((\d{1,5})\.(\d{1,3})\.(\d{1,3}))");
  std::smatch m;
  if (std::regex_match(text, m, form)) {
    const unsigned long major = std::stoul(m[1]), minor = std::stoul(m[2]), patch = std::stoul(m[3]);
    if (major < 65'536 && minor < 256 && patch < 256)
      return static_cast<std::uint32_t>(major << 16 | minor << 8 | patch);
  }
  throw files::BadInput(name, 1, fmt::format("'{}', expected a version like 0.2.0", text));
}

}  // namespace bms::update
