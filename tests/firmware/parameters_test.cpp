// The parameters that a workshop sets over CAN, on this machine with the real application: which keys set them, what is
// refused, what a loss of power leaves, and that the protections follow them.
#include <gtest/gtest.h>

#include <cmath>

#include "firmware/board_design.hpp"
#include "firmware/board_parameters.hpp"
#include "firmware/boot/update_server.hpp"
#include "tests/firmware/service_fixture.hpp"
#include "tests/firmware/stored_state_fixture.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;
using parameters::Parameter;
using Answer = can::CommandAnswer;

constexpr authentication::Key own_key{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
constexpr std::uint32_t sample_us = 100'000;
static_assert(parameters::update_request == boot::update_request_id);
static_assert(parameters::update_response == boot::update_response_id);

const protection::ProtectionPlan& plan_of_build() {
  static const auto plan = protection::protection_plan(host_hal::Table9Board<16>::design(0.1));
  return plan;
}
const parameters::Ranges& ranges() {
  static const auto all = parameters::ranges_of(host_hal::Table9Board<16>::design(0.1), {.inputs_fitted = 3});
  return all;
}

/// The forklift board with parameters, as firmware/board_parameters.cpp has them.
struct ParameterCell : host_hal::Table9Board<16> {
  static constexpr bool may_stop = true, switches_off = true;
  static inline std::optional<parameters::ParameterBlock> block;
  static inline parameters::ActivePlan active;

  static parameters::ParameterBlock& parameters() { return *block; }
  static void apply_parameters() { active.build(plan_of_build(), block->active(), ranges(), sample_us); }
  static bool plan_intact() { return active.intact(); }
  static const protection::ProtectionPlan& plan() { return active.plan(); }
};

class ParameterBoard {
 public:
  explicit ParameterBoard(const FlashModel& flash) : flash_(flash) {
    plug_in(&flash_);
    host_hal::sent.clear();
    host_hal::requests.clear();
    persistence_.start(hal::reset_cause(), hal::last_fault(), hal::calendar_s());
    ParameterCell::block.emplace(ranges());
    ParameterCell::parameters().start(persistence_);
    ParameterCell::apply_parameters();
    application_.emplace(measurement::StartingPoint{600'000'000, 20'000'000},
                         messages::Identity{host_hal::cell_hash, 0x000200}, 6.0F, persistence_);
  }
  ~ParameterBoard() { plug_in(nullptr); }

  void process_sample(const Pack& pack) { application_->process_sample(pack); }
  FlashModel& flash() { return flash_; }
  storage::Persistence& persistence() { return persistence_; }

 private:
  FlashModel flash_;
  storage::Persistence persistence_;
  std::optional<Application<ParameterCell>> application_;
};

class ParametersTest : public ::testing::Test {
 protected:
  void SetUp() override {
    host_hal::begin();
    host_hal::key = own_key;
    host_hal::development = false;
    new_chip.fill(0, erased);
    new_chip.fill(1, erased);
    new_chip.fill(2, erased);
  }
  void TearDown() override { host_hal::begin(); }

  void run(ParameterBoard& board, int samples) {
    for (int k = 0; k < samples; ++k) {
      now_us_ += sample_us;
      Pack pack;
      pack.time_us = now_us_;
      pack.current_ua = 0;
      pack.cell_uv.fill(cell_uv + static_cast<std::int32_t>(now_us_ / sample_us % 2) * 500);
      pack.pack_uv = 16 * pack.cell_uv[0];
      pack.temperature_cdegc.fill(2'500);
      const double pack_v = 1e-6 * pack.pack_uv;
      const auto& c = host_hal::switched;
      if (c.main_plus && c.main_minus)
        dc_link_v_ = pack_v;
      else if (c.precharge && c.main_minus)
        dc_link_v_ += (pack_v - dc_link_v_) * (1 - std::exp(-0.1 / 0.5));
      host_hal::set_link(pack_v, dc_link_v_);
      board.process_sample(pack);
    }
  }
  void send(ParameterBoard& board, std::span<const can::Frame> frames) {
    for (const can::Frame& f : frames) host_hal::requests.push_back(f);
    run(board, 1);
  }
  std::uint32_t result_of(ParameterBoard& board, std::span<const can::Frame> frames) {
    host_hal::sent.clear();
    send(board, frames);
    const auto answer = last<Answer>();
    return answer ? answer->result : 99;
  }
  void open_session(ParameterBoard& board) {
    send(board, std::array{workshop.challenge()});
    send(board, std::array{workshop.response(4'711)});
    ASSERT_EQ(last<can::ServiceChallenge>()->state, can::ServiceChallenge::state_open);
  }
  std::uint32_t begin(ParameterBoard& board) {
    return result_of(board, workshop.command(can::Command::code_set_parameter, 0));
  }
  std::uint32_t set(ParameterBoard& board, Parameter p, std::int32_t value) {
    return result_of(board, workshop.command(can::Command::code_set_parameter, static_cast<std::uint32_t>(value),
                                             static_cast<std::uint8_t>(p)));
  }
  std::uint32_t apply(ParameterBoard& board, const parameters::Values& values) {
    return result_of(board, workshop.command(can::Command::code_apply_parameters, parameters::check_code(values)));
  }
  static const parameters::Values& active() { return ParameterCell::parameters().active(); }
  static parameters::Values with(std::initializer_list<std::pair<Parameter, std::int32_t>> changes) {
    parameters::Values values = active();
    for (const auto& [p, value] : changes) at(values, p) = value;
    return values;
  }

  /// The current records of these kinds cannot be read any more.
  static void decay(FlashModel& flash, std::initializer_list<storage::Kind> kinds) {
    plug_in(&flash);
    storage::Log log;
    log.open();
    std::size_t decayed = 0;
    for (const auto& r : log.current_records()) {
      for (const storage::Kind kind : kinds) {
        if (r.kind.type != kind.type) continue;
        flash.flip(r.sector, (r.line + 1U) * storage::line_bytes + 2, 0x10);
        ++decayed;
      }
    }
    ASSERT_EQ(decayed, kinds.size());
  }

  static constexpr std::initializer_list<std::pair<Parameter, std::int32_t>> on_a_canopen_truck{
      {Parameter::discharge_current_max, 30},
      {Parameter::can_bit_rate, 500},
      {Parameter::can_base, 0x500},
      {Parameter::can_stop, 0x050}};

  const std::vector<std::uint8_t> erased = std::vector<std::uint8_t>(0x4000, 0xFF);
  FlashModel new_chip{{3, 0x4000}, 1};
  KeyHolder workshop{own_key}, stranger{authentication::development_key};
  std::int32_t cell_uv = 3'280'000;

 private:
  std::uint64_t now_us_ = 0;
  double dc_link_v_ = 0;
};

TEST_F(ParametersTest, AWorkshopLowersALimitWhichProtectsAtOnceAndAfterARestart) {
  ParameterBoard board(new_chip);
  run(board, 3);
  open_session(board);
  EXPECT_EQ(begin(board), Answer::result_done);
  EXPECT_EQ(set(board, Parameter::cell_voltage_max, 3'450), Answer::result_done);
  EXPECT_EQ(apply(board, with({{Parameter::cell_voltage_max, 3'450}})), Answer::result_done);
  const auto& action = board.persistence().actions().last(0);
  EXPECT_EQ(action.code, can::StoredAction::code_apply_parameters);
  EXPECT_EQ(action.argument, parameters::check_code(active()));
  EXPECT_EQ(board.persistence().actions().last(1).code, can::StoredAction::code_session_opened)
      << "single values are not recorded";
  // 3.65 V and 2.0 V make 3.70 V of the row; of 3.45 V it is 3.45 + 0.03 * 1.45 V
  cell_uv = 3'500'000;
  run(board, 30);
  EXPECT_EQ(last<can::Faults>()->cell_overvoltage, 1U);
  ParameterBoard again(board.flash());
  run(again, 30);
  EXPECT_EQ(last<can::Faults>()->cell_overvoltage, 1U);
  EXPECT_EQ(at(active(), Parameter::cell_voltage_max), 3'450);
  EXPECT_EQ(ParameterCell::parameters().state(), parameters::BlockState::stored);
  ParameterBoard other(new_chip);
  run(other, 30);
  EXPECT_EQ(last<can::Faults>()->cell_overvoltage, 0U) << "3.5 V is below the limit of the build";
}

TEST_F(ParametersTest, NothingIsAcceptedWithoutItsAuthority) {
  ParameterBoard board(new_chip);
  run(board, 3);
  const auto before = active();
  EXPECT_EQ(begin(board), Answer::result_not_authorised) << "no session";
  open_session(board);
  // the right command without its authority, and with that of another key
  EXPECT_EQ(result_of(board, std::array{workshop.command(can::Command::code_set_parameter, 0)[1]}),
            Answer::result_not_authorised);
  stranger.response(1);
  EXPECT_EQ(result_of(board, stranger.command(can::Command::code_set_parameter, 0)), Answer::result_not_authorised);
  EXPECT_EQ(begin(board), Answer::result_done);
  const auto lower = workshop.command(can::Command::code_set_parameter, 3'450, 1);
  EXPECT_EQ(result_of(board, lower), Answer::result_done);
  // an authority belongs to one value of one parameter
  auto forged = workshop.command(can::Command::code_set_parameter, 3'500, 1);
  can::Command other = can::Command::of(forged[1]);
  other.argument = 3'650;
  forged[1] = other.frame(can::counter_of(forged[1]));
  EXPECT_EQ(result_of(board, forged), Answer::result_not_authorised);
  EXPECT_EQ(active(), before);
}

TEST_F(ParametersTest, RecordedCommandsChangeNothingAgain) {
  ParameterBoard board(new_chip);
  run(board, 3);
  open_session(board);
  std::vector<std::array<can::Frame, 2>> recorded;
  const auto say = [&](const std::array<can::Frame, 2>& frames) {
    recorded.push_back(frames);
    return result_of(board, frames);
  };
  EXPECT_EQ(say(workshop.command(can::Command::code_set_parameter, 0)), Answer::result_done);
  EXPECT_EQ(say(workshop.command(can::Command::code_set_parameter, 3'450, 1)), Answer::result_done);
  EXPECT_EQ(say(workshop.command(can::Command::code_apply_parameters,
                                 parameters::check_code(with({{Parameter::cell_voltage_max, 3'450}})))),
            Answer::result_done);
  begin(board);
  set(board, Parameter::cell_voltage_max, 3'400);
  ASSERT_EQ(apply(board, with({{Parameter::cell_voltage_max, 3'400}})), Answer::result_done);
  for (const auto& frames : recorded) EXPECT_EQ(result_of(board, frames), Answer::result_not_authorised);
  EXPECT_EQ(at(active(), Parameter::cell_voltage_max), 3'400);
  ParameterBoard again(board.flash());
  run(again, 2);
  open_session(again);
  for (const auto& frames : recorded) EXPECT_EQ(result_of(again, frames), Answer::result_not_authorised);
  EXPECT_EQ(at(active(), Parameter::cell_voltage_max), 3'400);
}

TEST_F(ParametersTest, EveryValueBeyondItsRangeIsRefusedAndDiscardsTheSet) {
  ParameterBoard board(new_chip);
  run(board, 3);
  open_session(board);
  const auto before = active();
  int refused = 0;
  for (std::size_t k = 0; k < parameters::parameter_count; ++k) {
    const auto p = static_cast<Parameter>(k + 1);
    const auto [lowest, highest, initial] = ranges()[k];
    for (const std::int32_t value :
         {lowest - 1, highest + 1, std::int32_t{-2'147'483'647}, std::int32_t{2'147'483'647}}) {
      ASSERT_EQ(begin(board), Answer::result_done);
      ASSERT_EQ(set(board, Parameter::cell_voltage_max, 3'450), Answer::result_done);
      EXPECT_EQ(set(board, p, value), Answer::result_refused) << "parameter " << k + 1 << ", value " << value;
      EXPECT_EQ(apply(board, with({{Parameter::cell_voltage_max, 3'450}})), Answer::result_refused);
      ++refused;
    }
  }
  for (const auto& [p, value] : {std::pair{Parameter::can_bit_rate, 300}, std::pair{Parameter::can_base, 0x190},
                                 std::pair{static_cast<Parameter>(22), 1}}) {
    begin(board);
    EXPECT_EQ(set(board, p, value), Answer::result_refused) << static_cast<int>(p);
    ++refused;
  }
  EXPECT_EQ(refused, 87);
  // each possible, but not together: two messages with one identifier
  for (const auto& [p, value] : {std::pair{Parameter::can_stop, 0x1A0}, std::pair{Parameter::can_base, 0x300},
                                 std::pair{Parameter::can_base, 0x700}, std::pair{Parameter::can_base, 0x780}}) {
    begin(board);
    EXPECT_EQ(set(board, p, value), Answer::result_done);
    EXPECT_EQ(apply(board, with({{p, value}})), Answer::result_refused) << value;
  }
  begin(board);
  set(board, Parameter::cell_voltage_max, 3'450);
  EXPECT_EQ(apply(board, with({{Parameter::cell_voltage_max, 3'460}})), Answer::result_refused) << "a lost frame";
  EXPECT_EQ(apply(board, with({{Parameter::cell_voltage_max, 3'450}})), Answer::result_refused) << "discarded";
  EXPECT_EQ(active(), before);
  EXPECT_EQ(ParameterCell::parameters().revision(), 0);
}

/// Node and number of a battery in a group, and identifiers for each of them: 0x20A is one of a CANopen charger.
TEST(GroupParameters, ArePossibleOnlyTogether) {
  const auto possible = [](std::int32_t node, std::int32_t batteries, std::int32_t base = 0x180) {
    parameters::Values values = initial_values(ranges());
    at(values, Parameter::group_node) = node;
    at(values, Parameter::group_batteries) = batteries;
    at(values, Parameter::can_base) = base;
    return parameters::possible(values, ranges());
  };
  EXPECT_TRUE(possible(0, 0)) << "not set";
  EXPECT_TRUE(possible(1, 1)) << "alone";
  EXPECT_TRUE(possible(1, 2) && possible(2, 2));
  EXPECT_FALSE(possible(0, 2) || possible(1, 0) || possible(3, 2) || possible(5, 5) || possible(-1, 2));
  EXPECT_FALSE(possible(1, 3)) << "of node 3";
  for (std::int32_t node = 1; node <= 4; ++node) EXPECT_TRUE(possible(node, 4, 0x100)) << node;
  EXPECT_FALSE(possible(1, 3, 0x780)) << "beyond 11 bits";
}

TEST(GroupParameters, AreInTheSettingOfTheBus) {
  for (const auto& [node, batteries] : {std::pair{0, 0}, std::pair{2, 2}, std::pair{4, 4}}) {
    parameters::Values values = initial_values(ranges()), restored = values;
    at(values, Parameter::group_node) = node;
    at(values, Parameter::group_batteries) = batteries;
    at(values, Parameter::can_stop) = 0x0A5;
    parameters::set_bus(restored, parameters::bus_setting(values));
    EXPECT_EQ(restored, values);
  }
}

TEST_F(ParametersTest, AClosedContactorRefuses) {
  ParameterBoard board(new_chip);
  run(board, 3);
  open_session(board);
  begin(board);
  set(board, Parameter::charge_current_max, 30);
  send(board, std::array{workshop.drive(can::DriveRequest::request_charge)});
  const auto drive = [&] { return result_of(board, std::array{workshop.drive(can::DriveRequest::request_charge)}); };
  for (int k = 0; k < 60 && !host_hal::switched.main_plus; ++k) drive();
  ASSERT_TRUE(host_hal::switched.main_plus);
  EXPECT_EQ(apply(board, with({{Parameter::charge_current_max, 30}})), Answer::result_refused);
  EXPECT_EQ(at(active(), Parameter::charge_current_max), 60);
  EXPECT_EQ(result_of(board, workshop.command(can::Command::code_switch_off, 0)), Answer::result_refused);
  EXPECT_FALSE(host_hal::parked);
}

/// Makes new_set the active one, until the power fails. Returns true if it did.
bool fails_while_changing(FlashModel& flash, std::uint64_t at, const parameters::Values& new_set) {
  plug_in(&flash);
  storage::Persistence persistence;
  persistence.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
  parameters::ParameterBlock block(ranges());
  flash.cut_in(at);
  bool failed = false;
  try {
    block.start(persistence);
    block.begin();
    for (std::size_t k = 0; k < new_set.size(); ++k) block.set(static_cast<std::uint32_t>(k + 1), new_set[k]);
    EXPECT_TRUE(block.apply(parameters::check_code(new_set), persistence));
  } catch (const PowerCut&) {
    failed = true;
  }
  flash.no_cut();
  return failed;
}

/// The power fails at every word that the change of the parameters programs, and again at every word of the start after
/// that: the old or the new set, as a whole.
TEST_F(ParametersTest, APowerCutAtEveryWriteLeavesTheOldOrTheNewSet) {
  ParameterBoard board(new_chip);
  run(board, 3);
  open_session(board);
  begin(board);
  for (const auto& [p, value] : {std::pair{Parameter::cell_voltage_max, 3'500}, std::pair{Parameter::shunt, 101'000}})
    ASSERT_EQ(set(board, p, value), Answer::result_done);
  const auto old_set = with({{Parameter::cell_voltage_max, 3'500}, {Parameter::shunt, 101'000}});
  ASSERT_EQ(apply(board, old_set), Answer::result_done);
  const auto new_set =
      with({{Parameter::cell_voltage_max, 3'400}, {Parameter::can_base, 0x500}, {Parameter::shunt, 99'000}});
  const FlashModel before = board.flash();
  std::uint64_t cuts = 0, with_old = 0, with_new = 0;
  for (std::uint64_t at = 0;; ++at) {
    FlashModel flash = before;
    flash.reseed(at);
    if (!fails_while_changing(flash, at, new_set)) break;
    for (int start = 0; start < 3; ++start) {
      storage::Persistence persistence;
      parameters::ParameterBlock block(ranges());
      flash.cut_in(3 * static_cast<std::uint64_t>(start));
      try {
        persistence.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
        block.start(persistence);
      } catch (const PowerCut&) {
        ++cuts;
      }
      flash.no_cut();
    }
    storage::Persistence persistence;
    parameters::ParameterBlock block(ranges());
    persistence.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
    block.start(persistence);
    ASSERT_EQ(block.state(), parameters::BlockState::stored) << "cut at word " << at;
    ASSERT_TRUE(block.active() == old_set || block.active() == new_set) << "cut at word " << at;
    ++(block.active() == new_set ? with_new : with_old);
    ++cuts;
  }
  std::printf("%llu power cuts: the old set %llu times, the new one %llu times\n",
              static_cast<unsigned long long>(cuts), static_cast<unsigned long long>(with_old),
              static_cast<unsigned long long>(with_new));
  EXPECT_GT(with_old, 10U);
  EXPECT_GT(with_new, 10U);
  plug_in(nullptr);
}

TEST_F(ParametersTest, LostCopiesOpenAndAreReportedUntilAWorkshopAcceptsTheBuild) {
  ParameterBoard board(new_chip);
  run(board, 3);
  open_session(board);
  begin(board);
  for (const auto& [p, value] : on_a_canopen_truck) ASSERT_EQ(set(board, p, value), Answer::result_done);
  ASSERT_EQ(apply(board, with(on_a_canopen_truck)), Answer::result_done);
  // both copies of the record decay; the settings remain
  FlashModel decayed = board.flash();
  decay(decayed, {storage::parameters_kind, storage::parameters_copy_kind});
  ParameterBoard again(decayed);
  for (const Parameter p : {Parameter::can_bit_rate, Parameter::can_base, Parameter::can_stop})
    EXPECT_EQ(at(active(), p), at(with(on_a_canopen_truck), p)) << "on the bus as before";
  EXPECT_EQ(at(active(), Parameter::discharge_current_max), at(ranges(), Parameter::discharge_current_max).initial);
  run(again, 3);
  EXPECT_EQ(last<can::Board>()->parameters_lost, 1U);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
  open_session(again);
  EXPECT_EQ(result_of(again, workshop.command(can::Command::code_clear_faults, 1)), Answer::result_done);
  run(again, 12);
  EXPECT_EQ(last<can::Board>()->parameters_lost, 0U);
  result_of(again, workshop.command(can::Command::code_clear_faults, 1));
  run(again, 3);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
  ParameterBoard accepted(again.flash());
  EXPECT_FALSE(ParameterCell::parameters().lost());
  EXPECT_EQ(at(active(), Parameter::can_base), 0x500) << "the accepted set keeps the bus";
}

TEST_F(ParametersTest, AnInputThatIsNewInAnImageIsFittedWhateverAnOlderSetSays) {
  using parameters::ParametersRecord;
  FlashModel flash = new_chip;
  plug_in(&flash);
  storage::Persistence persistence;
  persistence.start(hal::reset_cause(), hal::last_fault(), hal::calendar_s());
  const auto image_with = [](std::int32_t inputs) {
    return parameters::ranges_of(host_hal::Table9Board<16>::design(0.1), {.inputs_fitted = inputs});
  };
  const auto fitted_after_a_start_of = [&](const parameters::Ranges& image) {
    parameters::ParameterBlock block(image);
    block.start(persistence);
    return at(block.active(), Parameter::inputs_fitted);
  };
  // a record of an image with two inputs, on a truck without auxiliary contacts
  ParametersRecord record{.revision = 1, .count = parameters::parameter_count, .values = initial_values(ranges())};
  at(record.values, Parameter::inputs_fitted) = parameters::second_current_fitted;
  std::array<std::uint8_t, storage::max_payload_bytes> bytes;
  const storage::Bytes payload = encode(record, bytes);
  ASSERT_TRUE(persistence.store_block(ParametersRecord::kind, payload));
  ASSERT_TRUE(persistence.store_block(ParametersRecord::copy, payload));
  const parameters::Ranges with_five_more = image_with(127), with_six_more = image_with(255);
  EXPECT_EQ(fitted_after_a_start_of(with_five_more), 126) << "the interlock would be ignored";

  // what a workshop takes out of an image's inputs stays out
  parameters::ParameterBlock block(with_five_more);
  block.start(persistence);
  block.begin();
  auto values = block.active();
  at(values, Parameter::inputs_fitted) = 2 + 16;
  ASSERT_TRUE(block.set(static_cast<std::uint32_t>(Parameter::inputs_fitted), 2 + 16));
  ASSERT_TRUE(block.apply(parameters::check_code(values), persistence));
  EXPECT_EQ(fitted_after_a_start_of(with_five_more), 2 + 16);
  EXPECT_EQ(fitted_after_a_start_of(with_six_more), 2 + 16 + 128);
  plug_in(nullptr);
}

TEST_F(ParametersTest, OnlyAWorkshopSwitchesAnUnusedBatteryOff) {
  ParameterBoard board(new_chip);
  run(board, 30);
  EXPECT_TRUE(host_hal::parked);
  EXPECT_EQ(host_hal::switched_off, 0U);
  const auto off = can::Command::code_switch_off;
  EXPECT_EQ(result_of(board, stranger.command(off, 0)), Answer::result_not_authorised);
  open_session(board);
  EXPECT_EQ(result_of(board, workshop.command(off, 1)), Answer::result_refused);
  run(board, 50);
  EXPECT_EQ(host_hal::switched_off, 0U);
  EXPECT_EQ(result_of(board, workshop.command(off, 0)), Answer::result_done);
  run(board, 15);
  EXPECT_EQ(host_hal::switched_off, 0U) << "the answer is sent first";
  run(board, 15);
  EXPECT_EQ(host_hal::switched_off, 1U);
  EXPECT_EQ(board.persistence().actions().last(0).code, can::StoredAction::code_switch_off);
  run(board, 100);
  EXPECT_EQ(host_hal::switched_off, 1U) << "once, if its key keeps it on";
}

TEST_F(ParametersTest, AFlippedBitOfThePlanIsAnInternalFault) {
  ParameterBoard board(new_chip);
  run(board, 3);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 0U);
  ParameterCell::active.disturb().rules[2].threshold ^= 1 << 12;
  run(board, 200);
  EXPECT_EQ(last<can::Faults>()->internal_fault, 1U);
}

TEST_F(ParametersTest, AreReadByEverybodyWithTheirRanges) {
  ParameterBoard board(new_chip);
  run(board, 3);
  host_hal::sent.clear();
  can::Command read;
  read.code = can::Command::code_read_parameters;
  send(board, std::array{read.frame(9)});
  run(board, 25);
  std::vector<can::ParameterValue> values;
  for (const auto& f : host_hal::sent) {
    if (f.id == can::ParameterValue::id) values.push_back(can::ParameterValue::of(f));
  }
  ASSERT_EQ(values.size(), 4 * (parameters::parameter_count + 1));
  EXPECT_EQ(static_cast<std::uint32_t>(values[0].value), parameters::check_code(active()));
  for (std::size_t k = 1; k <= parameters::parameter_count; ++k) {
    EXPECT_EQ(values[4 * k].number, k);
    EXPECT_EQ(values[4 * k].value, active()[k - 1]);
    EXPECT_EQ(values[4 * k + 1].value, ranges()[k - 1].lowest);
    EXPECT_EQ(values[4 * k + 2].value, ranges()[k - 1].highest);
    EXPECT_EQ(values[4 * k + 3].value, ranges()[k - 1].initial);
  }
}

/// Limits of 280 A: a short circuit is 1,400 A.
struct LargeCell : host_hal::Table9Board<16> {
  static const protection::ProtectionPlan& plan() {
    auto large = design(0.1);
    large.limits.charge_current_max_a = large.limits.discharge_current_max_a = 280;
    large.capacity_ah = 280;
    static const auto plan = protection::protection_plan(large);
    return plan;
  }
};

struct SmallCell : host_hal::Table9Board<16> {
  static const protection::ProtectionPlan& plan() { return plan_of_build(); }
};

TEST(PackCurrent, OfALargePackGoesBeyond655AmperesAndThatOfASmallOneIsNotSent) {
  host_hal::begin();
  storage::Persistence persistence;
  Application<LargeCell> large{std::nullopt, {0, 0}, 280, persistence};
  Application<SmallCell> small{std::nullopt, {0, 0}, 6, persistence};
  Pack pack;
  pack.cell_uv.fill(3'280'000);
  pack.pack_uv = 16 * 3'280'000;
  pack.current_ua = -1'234'567'000;
  large.process_sample(pack);
  EXPECT_NEAR(last<can::PackElectrical>()->current, -655.34, 0.01);
  EXPECT_EQ(last<can::PackCurrent>()->current, -1'234'567);
  pack.time_us += 100'000;
  pack.current_ua = measurement::no_reading;
  large.process_sample(pack);
  EXPECT_EQ(last<can::PackCurrent>()->current, can::PackCurrent::current_layout.invalid);
  const auto sent_by = [&](auto& application) {
    host_hal::sent.clear();
    for (int k = 0; k < 20; ++k) {
      pack.time_us += 100'000;
      application.process_sample(pack);
    }
    const auto of = [](std::uint32_t id) {
      return std::ranges::count_if(host_hal::sent, [&](const can::Frame& f) { return f.id == id; });
    };
    return std::array{of(can::PackElectrical::id), of(can::PackCurrent::id)};
  };
  const auto [large_electrical, large_current] = sent_by(large);
  const auto [small_electrical, small_current] = sent_by(small);
  EXPECT_EQ(large_electrical, 20);
  EXPECT_EQ(large_current, 20);
  EXPECT_EQ(small_electrical, 20) << "it sends, but not this message";
  EXPECT_EQ(small_current, 0);
}

}  // namespace
}  // namespace bms::firmware
