// The container byte for byte, as files in depots have it: written from the table of container.hpp, not by its code.
#include <gtest/gtest.h>

#include <vector>

#include "boot/container.hpp"

namespace bms::boot {
namespace {

/// Every field has another value; 5,000 bytes are two blocks.
HeaderBytes by_hand() {
  HeaderBytes b{};
  const auto put = [&](std::size_t at, const std::vector<std::uint8_t>& bytes) {
    std::ranges::copy(bytes, b.begin() + static_cast<std::ptrdiff_t>(at));
  };
  put(0, {'B', 'M', 'S', 'I', 1, 0, 2, 1, 0x88, 0x13, 0, 0});
  put(12, {0x0D, 0x0C, 0x0B, 0x0A, 0x11, 0x10, 0x0F, 0x0E, 0x15, 0x14, 0x13, 0x12, 0x19, 0x18, 0x17, 0x16});
  put(28, {0x1D, 0x1C, 0x1B, 0x1A});
  put(32, {'a', '_', 'b', 'o', 'a', 'r', 'd', '_', 'o', 'f', '_', '3', '1', '_', 'c', 'h',
           'a', 'r', 'a', 'c', 't', 'e', 'r', 's', '_', 'i', 'n', '_', 'a', 'l', 'l'});
  put(64, {0x21, 0x20, 0x1F, 0x1E, 0x25, 0x24, 0x23, 0x22});
  put(72, {1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 13, 14, 15, 16, 17, 18});
  put(128, std::vector<std::uint8_t>(32, 0xA1));
  put(160, std::vector<std::uint8_t>(32, 0xA2));
  return b;
}

TEST(Container, IsReadAsItsTableSays) {
  Header h;
  ASSERT_EQ(read_header(by_hand(), h), Refusal::none);
  EXPECT_EQ(h.kind, Kind::cell);
  EXPECT_EQ(h.slot, 1);
  EXPECT_EQ(h.payload_bytes, 5'000U);
  EXPECT_EQ(h.version, 0x0A0B'0C0DU);
  EXPECT_EQ(h.security_version, 0x0E0F'1011U);
  EXPECT_EQ(h.oldest_loader, 0x1213'1415U);
  EXPECT_EQ(h.address, 0x1617'1819U);
  EXPECT_EQ(h.flags, 0x1A1B'1C1DU);
  EXPECT_TRUE(h.development());
  EXPECT_EQ(h.board_name(), "a_board_of_31_characters_in_all");
  EXPECT_EQ(h.cell_hash, 0x1E1F'2021U);
  EXPECT_EQ(h.built_for_cell_hash, 0x2223'2425U);
  EXPECT_EQ(h.key, (KeyId{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(h.release, (std::array<std::uint8_t, 8>{11, 12, 13, 14, 15, 16, 17, 18}));
  EXPECT_EQ(h.blocks(), 2U);
  EXPECT_EQ(h.block_size(0), 4'096U);
  EXPECT_EQ(h.block_size(1), 904U);
}

TEST(Container, IsWrittenAsItsTableSays) {
  Header h;
  ASSERT_EQ(read_header(by_hand(), h), Refusal::none);
  std::array<Digest, 2> hashes{};
  hashes[0].fill(0xA1);
  hashes[1].fill(0xA2);
  HeaderBytes written;
  written.fill(0x55);
  write_header(h, hashes, written);
  EXPECT_EQ(written, by_hand());
  EXPECT_EQ(stated_hash(written, 0), hashes[0]);
  EXPECT_EQ(stated_hash(written, 1), hashes[1]);
  for (std::size_t k = 0; k < 64; ++k) written[1'984 + k] = static_cast<std::uint8_t>(k);
  for (std::size_t k = 0; k < 64; ++k) EXPECT_EQ(stated_signature(written)[k], k);
}

TEST(Container, OfMoreBlocksThanTheHeaderHasRoomForIsNotWrittenBehindThem) {
  HeaderBytes written{};
  write_header({}, std::vector<Digest>(60, Digest{7}), written);
  EXPECT_EQ(written[1'888], 7) << "the last of 56";
  EXPECT_EQ(written[1'920], 0);
}

TEST(Container, IsRefusedForWhatNoHeaderHas) {
  const auto with = [](std::size_t at, const std::vector<std::uint8_t>& bytes) {
    HeaderBytes b = by_hand();
    std::ranges::copy(bytes, b.begin() + static_cast<std::ptrdiff_t>(at));
    Header h;
    return read_header(b, h);
  };
  for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(with(k, {0}), k == 5 ? Refusal::none : Refusal::not_a_header) << k;
  EXPECT_EQ(with(4, {2}), Refusal::not_a_header);
  EXPECT_EQ(with(5, {1}), Refusal::not_a_header);
  EXPECT_EQ(with(6, {0}), Refusal::header_damaged);
  EXPECT_EQ(with(6, {1}), Refusal::none);
  EXPECT_EQ(with(6, {3}), Refusal::header_damaged);
  EXPECT_EQ(with(7, {0}), Refusal::none);
  EXPECT_EQ(with(7, {2}), Refusal::header_damaged);
  EXPECT_EQ(with(63, {'x'}), Refusal::header_damaged) << "the name of the board has no end";
  EXPECT_EQ(with(8, {0, 0, 0, 0}), Refusal::header_damaged);
  EXPECT_EQ(with(8, {1, 0, 0, 0}), Refusal::none);
  EXPECT_EQ(with(8, {0x00, 0x80, 0x03, 0}), Refusal::none) << "56 blocks of 4,096";
  EXPECT_EQ(with(8, {0x01, 0x80, 0x03, 0}), Refusal::too_large);
}

TEST(Container, OfWhichNothingIsStatedIsZeroAfterItsKind) {
  HeaderBytes written;
  written.fill(0x55);
  write_header(Header{}, {}, written);
  EXPECT_EQ(std::count(written.begin() + 7, written.end(), 0), header_bytes - 7);
}

TEST(Container, NamesItsBlocks) {
  Header h;
  for (const auto& [bytes, blocks, last] :
       {std::array{1U, 1U, 1U}, {4'095U, 1U, 4'095U}, {4'096U, 1U, 4'096U}, {4'097U, 2U, 1U}, {8'192U, 2U, 4'096U}}) {
    h.payload_bytes = bytes;
    EXPECT_EQ(h.blocks(), blocks) << bytes;
    EXPECT_EQ(h.block_size(blocks - 1), last) << bytes;
  }
}

/// Numbers of the bus never change their meaning.
TEST(Refusals, HaveTheirNumbersAndWords) {
  EXPECT_EQ(static_cast<int>(Refusal::other_board), 3);
  EXPECT_EQ(static_cast<int>(Refusal::unknown_key), 5);
  EXPECT_EQ(static_cast<int>(Refusal::bad_signature), 7);
  EXPECT_EQ(static_cast<int>(Refusal::older_security), 9);
  EXPECT_EQ(static_cast<int>(Refusal::too_large), 11);
  for (std::size_t k = 0; k < refusal_words.size(); ++k) {
    const auto refusal = static_cast<Refusal>(k);
    const bool changed = refusal == Refusal::not_a_header || refusal == Refusal::header_damaged ||
                         refusal == Refusal::bad_signature || refusal == Refusal::block_damaged;
    EXPECT_EQ(says_damaged(refusal), changed) << words_for(refusal);
  }
  EXPECT_EQ(static_cast<int>(Refusal::not_at_rest), 15);
  EXPECT_EQ(static_cast<int>(Refusal::erase_at_restart), 23);
  EXPECT_EQ(words_for(Refusal::trial_failed), "the image was started on trial and did not confirm itself");
  EXPECT_EQ(static_cast<int>(Refusal::other_cell_file), 24);
  EXPECT_EQ(static_cast<int>(Refusal::cell_out_of_range), 28);
  EXPECT_EQ(words_for(Refusal::cell_out_of_range), "a cell constant is outside the range that a cell file may have");
  EXPECT_EQ(words_for(static_cast<Refusal>(29)), "refused for a reason that this tool lacks");
}

}  // namespace
}  // namespace bms::boot
