// Stored records field by field, the older layout, and bytes that are not a record.
#include "storage/records.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace bms::storage {
namespace {

using Raw = std::vector<std::uint8_t>;

template <class R>
Raw bytes_of(const R& record) {
  std::array<std::uint8_t, max_payload_bytes> into;
  const Bytes bytes = encode(record, into);
  return {bytes.begin(), bytes.end()};
}

/// Different in every field, with both signs of the current.
Readings some_readings(int k) {
  Readings r;
  r.soc = static_cast<std::uint8_t>(k);
  const auto current = static_cast<std::int16_t>(k % 2 == 0 ? -8'000 + k : 8'000 - k);
  r.range.lowest = {static_cast<std::int16_t>(100 + k), static_cast<std::int16_t>(20 + k), current};
  r.range.highest = {static_cast<std::int16_t>(8'000 + k), static_cast<std::int16_t>(200 - k), current};
  return r;
}

EventsRecord full_events() {
  EventsRecord e;
  e.starts = 0x01020304;
  for (std::size_t k = 0; k < e.resets.size(); ++k) e.resets[k] = static_cast<std::uint16_t>(1000 + k);
  for (std::uint16_t k = 1; k <= 20; ++k) e.add({k, 100'000U * k, packed(some_readings(k))});
  return e;
}

SettingsRecord full_settings() {
  SettingsRecord s;
  for (std::size_t k = 0; k < SettingsRecord::max_settings; ++k)
    EXPECT_TRUE(s.set(static_cast<std::uint16_t>(7 * k), -100'000 * static_cast<std::int32_t>(k)));
  return s;
}

CellsRecord cells_record(std::uint8_t count) {
  CellsRecord c;
  c.count = count;
  for (std::size_t k = 0; k < count; ++k)
    c.cell[k] = {static_cast<std::int16_t>(-3000 + 400 * static_cast<int>(k)), static_cast<std::uint16_t>(40'000 + k)};
  return c;
}

TEST(ChargeRecord, IsLittleEndianFieldAfterField) {
  ChargeRecord r;
  r.pack = {0x11223344, 0x0A0B0C0D};
  r.moved_ppb = 5;
  r.charged_uah = 0x060504030201;
  r.discharged_uah = 0xFFFFFFFFFFFF;
  r.operating_s = 0x01000000;
  r.calendar_s = 0xFFFFFFFF;
  EXPECT_EQ(bytes_of(r), (Raw{0x44, 0x33, 0x22, 0x11, 0x0D, 0x0C, 0x0B, 0x0A, 5, 0, 0, 0, 1,    2,    3,    4,
                              5,    6,    0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 1, 0xFF, 0xFF, 0xFF, 0xFF}));
}

/// A firmware update must find the records of the version before.
TEST(Records, KeepTheirTypeNumbersAndFieldOrder) {
  EXPECT_EQ(ChargeRecord::kind, (Kind{1, 2}));
  EXPECT_EQ(CellsRecord::kind, (Kind{2, 1}));
  EXPECT_EQ(HealthRecord::kind, (Kind{3, 1}));
  EXPECT_EQ(EventsRecord::kind, (Kind{4, 2}));
  EXPECT_EQ(SettingsRecord::kind, (Kind{5, 1}));
  EXPECT_EQ(ExtremesRecord::kind, (Kind{6, 1}));
  CellsRecord cells;
  cells.count = 2;
  cells.cell[0] = {-2, 0x0102};
  cells.cell[1] = {3, 4};
  EXPECT_EQ(bytes_of(cells), (Raw{2, 0xFE, 0xFF, 2, 1, 3, 0, 4, 0}));
  EXPECT_EQ(bytes_of(HealthRecord{0x01020304, 5, -1, 0x7F000000}),
            (Raw{4, 3, 2, 1, 5, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0x7F}));
  EventsRecord events;
  events.starts = 9;
  events.resets[6] = 0x0807;
  Readings readings;
  readings.soc = 0x11;
  readings.range.lowest = {0x0666, 0x44, -2};
  readings.range.highest = {0x1555, 0x33, -2};
  events.add({0x65, 0x04030201, packed(readings)});
  Raw expected(230, 0);
  expected[0] = 9;
  expected[16] = 7;
  expected[17] = 8;
  expected[18] = 1;
  // After code and time one word, from its lowest bit: soc 8 bits, current 14, highest and lowest temperature 8 each,
  // highest and lowest voltage 13 each.
  const std::uint64_t word = 0x11 | 0x3FFEULL << 8 | 0x33ULL << 22 | 0x44ULL << 30 | 0x1555ULL << 38 | 0x0666ULL << 51;
  Raw event = {0x65, 1, 2, 3, 4};
  for (int k = 0; k < 8; ++k) event.push_back(static_cast<std::uint8_t>(word >> (8 * k)));
  std::copy(event.begin(), event.end(), expected.begin() + 22);
  EXPECT_EQ(bytes_of(events), expected);
  ExtremesRecord extremes;
  extremes.range.lowest = {0x0102, 3, -2};
  extremes.range.highest = {0x0405, 6, 0x0708};
  EXPECT_EQ(bytes_of(extremes), (Raw{2, 1, 3, 0, 0xFE, 0xFF, 5, 4, 6, 0, 8, 7}));
  SettingsRecord settings;
  EXPECT_TRUE(settings.set(0x0102, -2));
  EXPECT_EQ(bytes_of(settings), (Raw{1, 0, 1, 2, 1, 0xFE, 0xFF, 0xFF, 0xFF}));
}

TEST(Records, OfANewBatteryAreEmpty) {
  EXPECT_EQ(bytes_of(ChargeRecord{}), Raw(32, 0));
  EXPECT_EQ(bytes_of(CellsRecord{}), Raw(1, 0));
  EXPECT_EQ(bytes_of(HealthRecord{}), Raw(16, 0));
  EXPECT_EQ(bytes_of(EventsRecord{}), Raw(230, 0));
  const Raw unknown{0xFF, 0x1F, 0xFF, 0, 0, 0xE0, 0xFF, 0x1F, 0xFF, 0, 0, 0xE0};
  EXPECT_EQ(bytes_of(ExtremesRecord{}), unknown);
  EXPECT_EQ(packed({}), 0xFF | 0x2000ULL << 8 | 0xFFFFULL << 22 | 0x3FF'FFFFULL << 38) << "no reading is known";
  EXPECT_EQ(bytes_of(SettingsRecord{}), Raw(3, 0));
  EXPECT_EQ(SettingsRecord::Setting{}, (SettingsRecord::Setting{0, 0}));
  EXPECT_EQ(CellsRecord::Cell{}, (CellsRecord::Cell{0, 0}));
  EXPECT_EQ(cycles_milli({}, 6'000'000), 0U);
  ChargeRecord r;
  r.discharged_uah = 9'000'000;
  EXPECT_EQ(cycles_milli(r, 6'000'000), 1'500U);
  EXPECT_EQ(cycles_milli(r, 1), 9'000'000'000U);
  EXPECT_EQ(cycles_milli(r, 0), 0U) << "no cycles without a capacity";
}

template <class R>
void is_decoded_as_encoded(const R& record) {
  const Raw bytes = bytes_of(record);
  EXPECT_LE(bytes.size(), max_payload_bytes);
  R back;
  ASSERT_TRUE(decode(bytes, R::kind.layout, back));
  EXPECT_TRUE(back == record);
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_FALSE(decode(Bytes(bytes).first(n), R::kind.layout, back)) << "shortened to " << n;
  Raw longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(decode(longer, R::kind.layout, back));
  EXPECT_FALSE(decode(bytes, R::kind.layout + 1, back)) << "a newer layout is not decoded";
}

TEST(Records, AreDecodedAsEncodedAndOnlyFromTheirLength) {
  ChargeRecord charge;
  charge.pack = {987'654'321, 12'345'678};
  charge.charged_uah = 123'456'789'012;
  is_decoded_as_encoded(charge);
  for (const std::uint8_t count : {std::uint8_t{8}, std::uint8_t{15}, std::uint8_t{16}, std::uint8_t{24}}) {
    is_decoded_as_encoded(cells_record(count));
    EXPECT_EQ(bytes_of(cells_record(count)).size(), 1U + 4U * count);
  }
  is_decoded_as_encoded(CellsRecord{});
  is_decoded_as_encoded(HealthRecord{912'000, 3'000, 1'430'000, 20'000});
  is_decoded_as_encoded(full_events());
  EventsRecord with_processor_fault = full_events();
  with_processor_fault.add({0xFF62, 5, packed(some_readings(1))});  // the last interrupt of an STM32F405
  with_processor_fault.add({127, 0xFFFFFFFF, {}});
  is_decoded_as_encoded(with_processor_fault);
  ExtremesRecord extremes;
  extremes.range.add(some_readings(5).range);
  is_decoded_as_encoded(extremes);
  is_decoded_as_encoded(ExtremesRecord{});
  is_decoded_as_encoded(full_settings());
  is_decoded_as_encoded(SettingsRecord{});
}

TEST(CellsRecord, OfMoreThan32CellsIsNotDecoded) {
  Raw bytes(1 + 4 * 33, 1);
  bytes[0] = 33;
  CellsRecord cells;
  EXPECT_FALSE(decode(bytes, CellsRecord::kind.layout, cells));
  bytes.resize(1 + 4 * 32);
  bytes[0] = 32;
  EXPECT_TRUE(decode(bytes, CellsRecord::kind.layout, cells));
  EXPECT_EQ(cells.cell[31].sigma, 0x0101);
}

TEST(ChargeRecord, OfTheOlderLayoutIsMigratedWithTheSigmaOfAMinute) {
  const Raw layout_1{0x00, 0x46, 0xC3, 0x23, 0x80, 0x96, 0x98, 0x00};  // 600,000,000 and 10,000,000 ppb
  ChargeRecord r;
  r.charged_uah = 99;
  ASSERT_TRUE(decode(layout_1, 1, r));
  EXPECT_EQ(r.pack.soc_ppb, 600'000'000);
  EXPECT_EQ(r.pack.soc_sigma_ppb, 10'000'000);
  EXPECT_EQ(r.moved_ppb, 16'666'667U) << "1C for a minute";
  EXPECT_EQ(r.charged_uah, 0U);
  EXPECT_FALSE(decode(layout_1, 2, r));
}

/// The layout before readings were added, as that firmware wrote it.
TEST(EventsRecord, OfTheOlderLayoutIsReadWithoutReadings) {
  Raw older(118, 0);
  older[0] = 3;
  older[18] = 2;
  const Raw faults = {29, 0, 1, 2, 3, 4, 0x05, 0xFF, 9, 0, 0, 0};
  std::copy(faults.begin(), faults.end(), older.begin() + 22);
  EventsRecord e = full_events();
  ASSERT_TRUE(decode(older, 1, e));
  EXPECT_EQ(e.starts, 3U);
  EXPECT_EQ(e.faults, 2U);
  EXPECT_EQ(e.last(1), (EventsRecord::Fault{29, 0x04030201, packed({})}));
  EXPECT_EQ(e.last(0), (EventsRecord::Fault{0xFF05, 9, packed({})})) << "a bus fault of the processor";
  EXPECT_EQ(e.last(2).code, 0);
  EXPECT_FALSE(decode(older, 2, e));
}

TEST(ReadingRange, WidensWithEveryKnownReading) {
  using enum ReadingRange::Quantity;
  ReadingRange range;
  range.add(ReadingRange{});
  EXPECT_EQ(range, ReadingRange{});
  range.add(voltage, 3'300);
  EXPECT_EQ(range.lowest, (ReadingRange::Values{3'300, 255, -8'192})) << "no temperature and no current so far";
  EXPECT_EQ(range.highest, range.lowest);
  ReadingRange later;
  later.lowest = {3'200, 40, -1'200};
  later.highest = {3'250, 80, -1'200};
  range.add(later);
  later.lowest = {3'250, 50, 400};
  later.highest = {3'400, 90, 400};
  range.add(later);
  range.add(ReadingRange{});
  EXPECT_EQ(range.lowest, (ReadingRange::Values{3'200, 40, -1'200}));
  EXPECT_EQ(range.highest, (ReadingRange::Values{3'400, 90, 400}));
}

TEST(ChargeRecord, AnImpossibleSocIsNotAccepted) {
  EXPECT_EQ(plausible({1'040'000'000, 5}).soc_ppb, 1'000'000'000);
  EXPECT_EQ(plausible({1'040'000'000, 5}).soc_sigma_ppb, 5);
  EXPECT_EQ(plausible({-2'000'000'000, 5}).soc_sigma_ppb, 289'000'000);
  EXPECT_EQ(plausible({500'000'000, -5}).soc_sigma_ppb, 289'000'000);
  EXPECT_EQ(plausible({500'000'000, 0}).soc_sigma_ppb, 289'000'000);
  EXPECT_EQ(plausible({500'000'000, 1}).soc_sigma_ppb, 1);
  EXPECT_EQ(plausible({500'000'000, 289'000'001}).soc_sigma_ppb, 289'000'000) << "sigma of an unknown soc";
  for (const std::int32_t edge : {-250'000'000, 1'250'000'000}) {
    const std::int32_t beyond = edge < 0 ? edge - 1 : edge + 1, end = edge < 0 ? 0 : 1'000'000'000;
    EXPECT_EQ(plausible({edge, 5}), (estimator::StoredEstimate{end, 5}));
    EXPECT_EQ(plausible({beyond, 5}), (estimator::StoredEstimate{end, 289'000'000}));
  }
  EXPECT_EQ(plausible({0, 5}), (estimator::StoredEstimate{0, 5}));
  EXPECT_EQ(plausible({1'000'000'000, 5}), (estimator::StoredEstimate{1'000'000'000, 5}));
}

TEST(EventsRecord, ContainsTheLastSixteenFaultsNewestFirst) {
  const EventsRecord e = full_events();
  EXPECT_EQ(e.faults, 20U);
  EXPECT_EQ(e.last(0).code, 20);
  EXPECT_EQ(e.last(15).code, 5);
  EXPECT_EQ(e.last(15).time_s, 500'000U);
  EXPECT_EQ(e.last(15).readings, packed(some_readings(5)));
  EventsRecord few;
  few.add({3, 4, {}});
  EXPECT_EQ(few.last(0).code, 3);
  EXPECT_EQ(few.last(1).code, 0);
}

TEST(SettingsRecord, StoresAValueByKeyAndReportsWhenItIsFull) {
  SettingsRecord s = full_settings();
  EXPECT_EQ(s.get(14), -200'000);
  EXPECT_FALSE(s.get(15));
  EXPECT_FALSE(s.set(9'999, 1));
  const auto revision = s.revision;
  EXPECT_TRUE(s.set(14, -200'000));
  EXPECT_EQ(s.revision, revision) << "nothing has changed";
  EXPECT_TRUE(s.set(14, 5));
  EXPECT_EQ(s.get(14), 5);
  EXPECT_EQ(s.revision, revision + 1);
}

TEST(Records, OfRandomBytesAreReadSafely) {
  std::mt19937 random(1);
  for (int k = 0; k < 100'000; ++k) {
    Raw bytes(random() % 240);
    for (auto& b : bytes) b = static_cast<std::uint8_t>(random());
    const auto layout = static_cast<std::uint8_t>(random() % 4);
    ChargeRecord charge;
    CellsRecord cells;
    HealthRecord health;
    EventsRecord events;
    SettingsRecord settings;
    EXPECT_TRUE(!decode(bytes, layout, charge) || charge.pack.soc_sigma_ppb <= 289'000'000);
    EXPECT_TRUE(!decode(bytes, layout, cells) || cells.count <= CellsRecord::max_cells);
    EXPECT_TRUE(!decode(bytes, layout, settings) || settings.count <= SettingsRecord::max_settings);
    decode(bytes, layout, health);
    if (decode(bytes, layout, events)) events.add(events.last(3));
    ExtremesRecord extremes;
    decode(bytes, layout, extremes);
  }
}

}  // namespace
}  // namespace bms::storage
