// AES-128 and AES-CMAC against the vectors of their standards.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "authentication/codes.hpp"

namespace bms::authentication {
namespace {

std::vector<std::uint8_t> bytes(const std::string& hex) {
  std::vector<std::uint8_t> all;
  for (std::size_t k = 0; k + 1 < hex.size(); k += 2)
    all.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(k, 2), nullptr, 16)));
  return all;
}
Block block(const std::string& hex) {
  Block b{};
  const auto all = bytes(hex);
  std::copy(all.begin(), all.end(), b.begin());
  return b;
}

TEST(Aes128, EncryptsTheExamplesOfTheStandard) {
  // FIPS 197: appendix B, appendix C.1
  EXPECT_EQ(encrypted(block("3243f6a8885a308d313198a2e0370734"), block("2b7e151628aed2a6abf7158809cf4f3c")),
            block("3925841d02dc09fbdc118597196a0b32"));
  EXPECT_EQ(encrypted(block("00112233445566778899aabbccddeeff"), block("000102030405060708090a0b0c0d0e0f")),
            block("69c4e0d86a7b0430d8cdb78070b4c55a"));
  // NIST SP 800-38A, F.1.1, ECB-AES128
  const Key key = block("2b7e151628aed2a6abf7158809cf4f3c");
  EXPECT_EQ(encrypted(block("6bc1bee22e409f96e93d7e117393172a"), key), block("3ad77bb40d7a3660a89ecaf32466ef97"));
  EXPECT_EQ(encrypted(block("ae2d8a571e03ac9c9eb76fac45af8e51"), key), block("f5d3d58503b9699de785895a96fdbaaf"));
  EXPECT_EQ(encrypted(block("30c81c46a35ce411e5fbc1191a0a52ef"), key), block("43b1cd7f598ece23881b00e3ed030688"));
  EXPECT_EQ(encrypted(block("f69f2445df4f9b17ad2b417be66c3710"), key), block("7b0c785e27e8ad3f8223207104725dd4"));
}

TEST(Cmac, GivesTheExamplesOfRfc4493) {
  const Cmac mac(block("2b7e151628aed2a6abf7158809cf4f3c"));
  const auto all = bytes(
      "6bc1bee22e409f96e93d7e117393172aae2d8a571e03ac9c9eb76fac45af8e5130c81c46a35ce411e5fbc1191a0a52ef"
      "f69f2445df4f9b17ad2b417be66c3710");
  const std::span<const std::uint8_t> message = all;
  EXPECT_EQ(mac(message.first(0)), block("bb1d6929e95937287fa37d129b756746"));
  EXPECT_EQ(mac(message.first(16)), block("070a16b46b4d4144f79bdd9dd04a287c"));
  EXPECT_EQ(mac(message.first(40)), block("dfa66747de9ae63030ca32611497c827"));
  EXPECT_EQ(mac(message.first(64)), block("51f0bebf7e3b9d92fc49741779363cfe"));
}

/// Computed with the package cryptography (OpenSSL) from the description in codes.hpp.
TEST(Codes, AreThoseOfAnotherImplementation) {
  const Key device = block("000102030405060708090a0b0c0d0e0f");
  const Cmac service(role_key(device, Role::service)), drive(role_key(device, Role::drive));
  EXPECT_EQ(session_code(service, 0x112233445566, 0x0102), 0xA8EAE407U);
  EXPECT_EQ(command_code(service, 0x112233445566, 7, {1, 2, 3, 4, 5, 6, 7, 8}), 0xBC4B457CU);
  EXPECT_EQ(drive_code(drive, 0x112233445566, 0xABCD, 1), 0xE1133DE2U);
}

TEST(Codes, DependOnEveryBitOfWhatTheySecure) {
  const Cmac mac(development_key);
  const std::uint32_t code = command_code(mac, 1, 1, {});
  for (int bit = 0; bit < 48; ++bit) EXPECT_NE(command_code(mac, 1 ^ 1ULL << bit, 1, {}), code) << bit;
  for (int bit = 0; bit < 16; ++bit)
    EXPECT_NE(command_code(mac, 1, static_cast<std::uint16_t>(1 ^ 1 << bit), {}), code) << bit;
  for (std::size_t bit = 0; bit < 64; ++bit) {
    std::array<std::uint8_t, 8> command{};
    command[bit / 8] = static_cast<std::uint8_t>(1 << bit % 8);
    EXPECT_NE(command_code(mac, 1, 1, command), code) << bit;
  }
  EXPECT_NE(session_code(mac, 1, 0), drive_code(mac, 1, 0, 0));
  EXPECT_NE(role_key(development_key, Role::service), role_key(development_key, Role::drive));
}

}  // namespace
}  // namespace bms::authentication
