// The loader's cryptography against published vectors and against OpenSSL's signatures.
#include "tests/firmware/boot/bench.hpp"

namespace bms::boot {
namespace {

std::vector<std::uint8_t> hex(const std::string& text) {
  std::vector<std::uint8_t> out;
  for (std::size_t k = 0; k + 1 < text.size(); k += 2)
    out.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(k, 2), nullptr, 16)));
  return out;
}

template <std::size_t Size>
std::array<std::uint8_t, Size> fixed(const std::string& text) {
  std::array<std::uint8_t, Size> out{};
  std::ranges::copy(hex(text), out.begin());
  return out;
}

TEST(BootCrypto, Sha256OfTheExamplesOfFips180) {
  EXPECT_EQ(sha256(bytes_of("abc")), fixed<32>("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"));
  EXPECT_EQ(sha256(bytes_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq")),
            fixed<32>("248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"));
}

/// RFC 6979, A.2.5: P-256, SHA-256, message "sample".
TEST(BootCrypto, TheSignatureOfRfc6979IsRight) {
  const auto key = fixed<64>(
      "60fed4ba255a9d31c961eb74c6356d68c049b8923b61fa6ce669622e60f29fb6"
      "7903fe1008b8bc99a41ae9e95628bc64f2f1b20c2d7e9f5177a3c294d4462299");
  const auto signature = fixed<64>(
      "efd48b2aacb6a8fd1140dd9cd45e81d69d2c877b56aaf991c34d0ea84eaf3716"
      "f7cb1c942d657c41d436c7a1b6e29f65f3e900dbb9aff4064dc4ab2f843acda8");
  const Digest digest = sha256(bytes_of("sample"));
  EXPECT_TRUE(signature_right(key, digest, signature));
  for (std::size_t bit = 0; bit < 512; bit += 37) {
    auto wrong = signature;
    wrong[bit / 8] = static_cast<std::uint8_t>(wrong[bit / 8] ^ 1 << bit % 8);
    EXPECT_FALSE(signature_right(key, digest, wrong)) << bit;
  }
  auto other = digest;
  other[31] ^= 1;
  EXPECT_FALSE(signature_right(key, other, signature));
}

TEST(BootCrypto, ImpossibleSignaturesAndPointsAreWrong) {
  const PublicKey key = key_of("product").public_key();
  const Digest digest = sha256(bytes_of("x"));
  EXPECT_FALSE(signature_right(key, digest, Signature{}));
  Signature ones;
  ones.fill(0xFF);
  EXPECT_FALSE(signature_right(key, digest, ones));
  EXPECT_FALSE(signature_right(PublicKey{}, digest, key_of("product").sign(digest)));
}

TEST(BootCrypto, SignaturesOfOpenSslAreRightAgainAndAgain) {
  const auto& key = key_of("product");
  for (int k = 0; k < 20; ++k) {
    const Digest digest = sha256(bytes_of(std::to_string(k)));
    EXPECT_TRUE(signature_right(key.public_key(), digest, key.sign(digest)));
    EXPECT_FALSE(signature_right(key_of("next").public_key(), digest, key.sign(digest)));
  }
}

}  // namespace
}  // namespace bms::boot
