// What stands at addresses that loader, application and tool agree on: slots, the keys, the loader's message.
#include <cstring>

#include "boot/flash_map.hpp"
#include "boot/handover.hpp"
#include "boot/key_table.hpp"
#include "tests/firmware/boot/bench.hpp"

namespace bms::boot {
namespace {

TEST(FlashMap, IsThatOfTheReferenceManual) {
  EXPECT_EQ(payload_address(Kind::application, 0), 0x0802'0800U);
  EXPECT_EQ(payload_address(Kind::application, 1), 0x0806'0800U);
  EXPECT_EQ(payload_address(Kind::cell, 0), 0x080A'0800U);
  EXPECT_EQ(payload_address(Kind::cell, 1), 0x080C'0800U);
  EXPECT_EQ(application_slots[0] + application_slot_bytes, application_slots[1]);
  EXPECT_EQ(application_slots[1] + application_slot_bytes, cell_slots[0]);
  EXPECT_EQ(cell_slots[1] + cell_slot_bytes, 0x080E'0000U);
  EXPECT_EQ(loader_begin + loader_first_bytes, 0x0800'4000U) << "the stored data begin";
  EXPECT_EQ(loader_second_begin, 0x0801'0000U) << "sector 4";
  EXPECT_EQ(loader_first_bytes + loader_second_bytes, 48U * 1024);
}

Start some_start() {
  Start s;
  s.found = true;
  s.slot = 1;
  s.trial = true;
  s.returned = true;
  s.refusal = Refusal::bad_signature;
  s.header.version = 0x030201;
  s.header.cell_hash = 0xCAFE'F00D;
  s.header.security_version = 17;
  s.header.flags = flag_development;
  return s;
}

Battery some_battery() {
  Battery b;
  b.loader_version = 0x000102;
  b.security_counter = 9;
  b.product = false;
  return b;
}

TEST(HandoverToTheImage, HasEveryFieldOfTheStart) {
  const Handover h = handover_of(some_start(), some_battery());
  EXPECT_EQ(h.loader_version, 0x000102U);
  EXPECT_EQ(h.security_counter, 9U);
  EXPECT_EQ(h.product, 0);
  const auto s = start_of(h);
  ASSERT_TRUE(s);
  EXPECT_TRUE(s->found && s->trial && s->returned && s->header.development());
  EXPECT_EQ(s->slot, 1);
  EXPECT_EQ(s->refusal, Refusal::bad_signature);
  EXPECT_EQ(s->header.version, 0x030201U);
  EXPECT_EQ(s->header.cell_hash, 0xCAFE'F00DU);
  EXPECT_EQ(s->header.security_version, 17U);

  Start other = some_start();
  other.slot = 0;
  other.trial = other.returned = false;
  other.refusal = Refusal::none;
  other.header.flags = 0;
  const auto back = start_of(handover_of(other, some_battery()));
  ASSERT_TRUE(back);
  EXPECT_FALSE(back->trial || back->returned || back->header.development());
  EXPECT_EQ(back->slot, 0);
  EXPECT_EQ(back->refusal, Refusal::none);
}

TEST(HandoverToTheImage, OfADevelopmentImageOrAProductIsNotMixedUp) {
  Battery product = some_battery();
  product.product = true;
  Start s = some_start();
  s.header.flags = 0;
  const Handover h = handover_of(s, product);
  EXPECT_EQ(h.product, 1);
  EXPECT_EQ(h.development, 0);
}

/// A loader stays for the life of a battery. The numbers were computed apart from its code.
TEST(HandoverToTheImage, HasTheCheckThatEveryLoaderWrites) {
  const Handover h{.magic = 0x424F'4F54,
                   .loader_version = 0x0002'0100,
                   .security_counter = 7,
                   .slot = 1,
                   .trial = 1,
                   .returned = 1,
                   .refusal = 19,
                   .product = 1,
                   .development = 1,
                   .version = 0x0003'0201,
                   .cell_hash = 0x89AB'CDEF,
                   .security_version = 9};
  EXPECT_EQ(check_of(h), 0x2737'576AU);
  const CellHandover cell{.magic = 0x4345'4C4C,
                          .slot = 1,
                          .trial = 1,
                          .returned = 1,
                          .refusal = 19,
                          .version = 0x0003'0201,
                          .cell_hash = 0x89AB'CDEF,
                          .security_version = 9,
                          .security_counter = 7};
  EXPECT_EQ(check_of(cell), 0x261F'7572U);
}

TEST(HandoverToTheImage, WithAnyWrongBitIsNone) {
  const Handover right = handover_of(some_start(), some_battery());
  for (std::size_t bit = 0; bit < 8 * sizeof right; ++bit) {
    if (bit / 8 >= offsetof(Handover, spare) && bit / 8 < offsetof(Handover, version)) continue;
    std::array<std::uint8_t, sizeof right> bytes{};
    std::memcpy(bytes.data(), &right, sizeof right);
    bytes[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
    Handover wrong;
    std::memcpy(&wrong, bytes.data(), sizeof wrong);
    EXPECT_FALSE(start_of(wrong)) << "bit " << bit;
  }
  EXPECT_FALSE(start_of(Handover{})) << "RAM of zeros";
  Handover third = right;
  third.slot = 2;
  third.check = check_of(third);
  EXPECT_FALSE(start_of(third)) << "there are two slots";
}

TEST(HandoverToTheImage, OfCellConstantsKnowsBothSlotsAndThoseOfTheBuild) {
  for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}}) {
    Start start = some_start();
    start.slot = slot;
    const auto back = start_of(cell_handover_of(start, some_battery()));
    ASSERT_TRUE(back);
    EXPECT_TRUE(back->found);
    EXPECT_EQ(back->slot, slot);
    EXPECT_EQ(back->refusal, Refusal::bad_signature);
  }
  const CellHandover none = cell_handover_of(Start{}, some_battery());
  EXPECT_EQ(none.slot, 0xFF) << "as its declaration says: applications read what older loaders write";
  const auto back = start_of(none);
  ASSERT_TRUE(back);
  EXPECT_FALSE(back->found);
}

class KeysInTheLoader : public ::testing::Test {
 protected:
  KeysInTheLoader() { bytes.assign(std::size_t{most_keys} * key_entry_bytes, 0xFF); }
  void put(std::uint32_t entry, std::uint32_t kind, std::uint8_t fill) {
    hal::put_bytes(bytes, entry * key_entry_bytes, kind);
    std::fill_n(bytes.begin() + entry * key_entry_bytes + 4, key_entry_bytes - 4, fill);
  }
  KeyTable table() { return {bytes, bench.slots()}; }

  Bench bench;
  std::vector<std::uint8_t> bytes;
};

TEST_F(KeysInTheLoader, AreThoseOfTheFilledEntries) {
  EXPECT_TRUE(table().keys().empty());
  put(0, product_key_kind, 0x11);
  put(2, development_key_kind, 0x22);
  put(3, 0x1234'5678, 0x33);
  const KeyTable all = table();
  ASSERT_EQ(all.keys().size(), 2U);
  EXPECT_FALSE(all.keys()[0].development || all.keys()[0].revoked);
  EXPECT_TRUE(all.keys()[1].development);
  for (const std::uint8_t byte : all.keys()[0].point) EXPECT_EQ(byte, 0x11);
  for (const std::uint8_t byte : all.keys()[1].point) EXPECT_EQ(byte, 0x22);
}

TEST_F(KeysInTheLoader, AreRevokedByTheBitOfTheirEntry) {
  put(1, product_key_kind, 0x11);
  put(3, product_key_kind, 0x22);
  bench.slots().program_one_time(revocation_word, ~(1U << 3));
  const KeyTable all = table();
  ASSERT_EQ(all.keys().size(), 2U);
  EXPECT_FALSE(all.keys()[0].revoked);
  EXPECT_TRUE(all.keys()[1].revoked);
}

TEST_F(KeysInTheLoader, ABatteryWithAValidDevelopmentKeyIsNoProduct) {
  put(0, product_key_kind, 0x11);
  EXPECT_TRUE(table().product());
  put(1, development_key_kind, 0x22);
  EXPECT_FALSE(table().product());
  bench.slots().program_one_time(revocation_word, ~(1U << 1));
  EXPECT_TRUE(table().product());
}

}  // namespace
}  // namespace bms::boot
