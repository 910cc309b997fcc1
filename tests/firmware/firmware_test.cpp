// The firmware images of the emulated boards: their symbols, the cost of a step, their CAN messages, and the record of
// a fault.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "images/firmware_image.hpp"
#include "images/image_file.hpp"
#include "replay/replay.hpp"
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/slcan_board.hpp"
#include "tests/firmware/step_cost.hpp"

namespace bms::firmware {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::filesystem::path image(images::Image kind, const char* cell = "table9") {
  return images::firmware_image("netduinoplus2", files::read_cell(cell), kind);
}
std::filesystem::path microbit_image(images::Image kind) {
  return images::firmware_image("microbit", files::read_cell("table9"), kind);
}
const images::EmulatedBoard& microbit() { return images::emulated_boards().back(); }

std::vector<measurement::Sample> shift() {
  return measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
}

TEST(FirmwareImage, HasNoDoubleArithmeticHeapExceptionsOrTypeInformation) {
  EXPECT_THAT(forbidden_in(symbols_of(image(images::Image::application))), IsEmpty());
  EXPECT_THAT(forbidden_in(symbols_of(image(images::Image::replay))), IsEmpty());
}

TEST(FirmwareImage, ForbiddenSymbolsAreFoundInAHostProgram) {
  const auto found = forbidden_in(symbols_of(BMS_TOOL, ""));
  EXPECT_THAT(found, ::testing::Contains(StartsWith("operator new")));
  EXPECT_THAT(found, ::testing::Contains(StartsWith("__cxa_throw")));
  EXPECT_THAT(found, ::testing::Contains(StartsWith("typeinfo ")));
  EXPECT_THAT(found, ::testing::Contains(StartsWith("vtable ")));
  EXPECT_EQ(forbidden_in({{0, 0, 'T', "__aeabi_dadd"},
                          {0, 0, 'T', "__aeabi_f2d"},
                          {0, 0, 'T', "__muldf3"},
                          {0, 0, 'T', "_malloc_r"},
                          {0, 0, 'T', "_sbrk"},
                          {0, 0, 'T', "__aeabi_fadd"},
                          {0, 0, 'T', "memcpy"},
                          {0, 0, 'T', "__aeabi_uldivmod"}})
                .size(),
            5U);
}

/// Compares the table in estimator/README.md, which `./bms figures` writes, with new measurements.
TEST(FirmwareImage, CostsNoMoreThanTheTableSays) {
  const files::CommittedFigures table(BMS_SOURCE_DIR "/estimator/README.md", "netduinoplus2");
  const auto measured = step_figures(images::emulated_boards().front(), files::read_cell("table9"), shift());
  ASSERT_FALSE(measured.empty());
  for (const auto& [name, value] : measured) {
    ASSERT_TRUE(table.has(name)) << name;
    EXPECT_LE(value, 1.05 * table.at(name)) << name << ": if the growth is worth it, run ./bms figures";
  }
}

TEST(ProtectionImage, CostsNoMoreThanTheTableSaysAndDecidesAsTheHost) {
  const files::CommittedFigures table(BMS_SOURCE_DIR "/firmware/protection/README.md", "netduinoplus2");
  const auto measured = protection_figures(images::emulated_boards().front(),
                                           files::read_cell("table9"));  // throws if the board decides otherwise
  ASSERT_FALSE(measured.empty());
  for (const auto& [name, value] : measured) {
    ASSERT_TRUE(table.has(name)) << name;
    EXPECT_LE(value, 1.05 * table.at(name)) << name << ": if the growth is worth it, run ./bms figures";
  }
}

TEST(ProtectionImage, HasNoFloatingPoint) {
  const auto symbols = symbols_of(image(images::Image::protection));
  EXPECT_THAT(forbidden_in(symbols), IsEmpty());
  for (const Symbol& s : symbols)
    EXPECT_FALSE(s.name.starts_with("__aeabi_f") || s.name.starts_with("__aeabi_i2f")) << s.name;
}

TEST(FirmwareImage, AStepStaysInsideItsBudget) {
  const StepCost cost = count_instructions(images::emulated_boards().front(), image(images::Image::replay), shift());
  EXPECT_EQ(cost.calls, 28801U);
  EXPECT_LE(cost.mean, 300);       // design budget of a step
  EXPECT_LE(cost.first, 30'000U);  // and of the one that starts the filter
  EXPECT_LT(cost.least, cost.mean);
  EXPECT_GT(cost.least, 100U);
}

TEST(MicrobitImage, AStepStaysInsideItsBudget) {
  const StepCost cost = count_instructions(microbit(), microbit_image(images::Image::replay), shift());
  EXPECT_EQ(cost.calls, 28801U);
  EXPECT_LE(cost.mean, 3'000);      // design budget of a step
  EXPECT_LE(cost.first, 300'000U);  // and of the one that starts the filter
  EXPECT_GT(cost.least, 1'000U);
}

TEST(MicrobitImage, HasNoDoubleArithmeticHeapExceptionsOrTypeInformation) {
  EXPECT_THAT(forbidden_in(symbols_of(microbit_image(images::Image::application))), IsEmpty());
  EXPECT_THAT(forbidden_in(symbols_of(microbit_image(images::Image::replay))), IsEmpty());
}

/// Telemetry computes in float; step, condition and cell differences do not.
TEST(MicrobitImage, EstimatesWithoutSoftwareFloat) {
  const auto objects = microbit_image(images::Image::application).parent_path() / "CMakeFiles";
  for (const char* object :
       {"estimator_step.dir/firmware/estimator_step.cpp.obj", "application.dir/firmware/board_cell.cpp.obj"}) {
    const auto symbols = symbols_of(objects / object);
    ASSERT_FALSE(symbols.empty());
    for (const Symbol& s : symbols) {
      EXPECT_THAT(s.name, ::testing::Not(::testing::MatchesRegex("__aeabi_(f|d|cf|cd|i2f|ui2f|l2f|ul2f).*"))) << object;
    }
  }
}

TEST(MicrobitImage, CostsNoMoreThanTheTableSays) {
  const files::CommittedFigures table(BMS_SOURCE_DIR "/estimator/README.md", "microbit");
  const auto measured = core_figures(microbit(), files::read_cell("table9"), shift());
  ASSERT_FALSE(measured.empty());
  for (const auto& [name, value] : measured) {
    ASSERT_TRUE(table.has(name)) << name;
    EXPECT_LE(value, 1.05 * table.at(name)) << name << ": if the growth is worth it, run ./bms figures";
  }
}

TEST(SlcanBoard, TelemetryAgreesWithTheReplay) {
  const auto all = shift();
  const std::vector<measurement::Sample> part(all.begin() + 3000, all.begin() + 4200);
  const measurement::StartingPoint start = replay::starting_point(replay::SocPrior{0.8, 0.05}).value();
  const replay::Track host = replay::run_on_host(files::read_cell("table9"), part, start, replay::ScalarKind::float32);

  SlcanBoard board(image(images::Image::application));
  EXPECT_EQ(board.read(), "");  // ready
  board.write("S6\rO\r");
  EXPECT_EQ(board.read(), "");
  EXPECT_EQ(board.read(), "");
  board.write("t31080008AF2F80F0FA02\r");  // 800,000,000 and 50,000,000 ppb, little-endian
  double displayed = 0;
  for (std::size_t k = 0; k < part.size(); ++k) {
    board.send_sample(part[k].time_us, part[k].current_ua, part[k].voltage_uv, part[k].temperature_cdegc);
    const BoardTelemetry t = board.telemetry();
    const replay::EstimateRow& expected = host.rows[k];
    ASSERT_NEAR(t.soc, 5e4 * expected.soc, 0.51) << k;
    ASSERT_NEAR(t.soc_sigma, 5e4 * expected.soc_sigma, 0.51) << k;
    if (k > 0) {
      ASSERT_NEAR(t.soc_display, displayed, 5e4 * 0.002) << k << ": 0.5 % per minute, plus the counted charge";
    }
    displayed = t.soc_display;
    ASSERT_EQ(t.voltage, static_cast<unsigned>(std::lround(1e-3 * part[k].voltage_uv))) << k;
    ASSERT_NEAR(t.current, 5e-5 * part[k].current_ua, 0.51) << k;
    ASSERT_EQ(t.temperature, part[k].temperature_cdegc) << k;
    ASSERT_NEAR(t.v_rc_uv, 1e6 * expected.v_rc_v, 1.0) << k;
    ASSERT_NEAR(t.voltage_predicted_uv, 1e6 * expected.voltage_predicted_v, 1.0) << k;
    ASSERT_EQ(t.flags, expected.flags) << k;
    ASSERT_EQ(t.sample_counter, (k + 1) % 65536) << k;
    ASSERT_EQ(t.status_counter, k % 15) << k;
  }
  EXPECT_NE(std::lround(1e4 * host.rows.back().soc), 8000) << "the samples must change the state of charge";
  board.write("C\r");
  EXPECT_EQ(board.wait(), 0);
}

TEST(SlcanBoard, ReportsItsCellFile) {
  const files::CellFile cell = files::read_cell("table9");
  SlcanBoard board(image(images::Image::application));
  board.read();
  board.write("O\r");
  board.read();
  board.send_sample(0, 0, 3'300'000, 2500);
  const std::string identity = board.read_until("t1838");
  EXPECT_EQ(identity.substr(9, 8), fmt::format("{:02X}{:02X}{:02X}{:02X}", cell.hash & 255, cell.hash >> 8 & 255,
                                               cell.hash >> 16 & 255, cell.hash >> 24));
  const images::ImageFile file(image(images::Image::application));
  std::uint32_t in_the_image = 0;
  std::memcpy(&in_the_image, file.at(file.symbol("image_cell_hash"), sizeof in_the_image).data(), sizeof in_the_image);
  EXPECT_EQ(in_the_image, cell.hash);
  EXPECT_EQ(fmt::format("{:08x}", in_the_image), files::sha256(cell.text).substr(0, 8));
  EXPECT_EQ(identity.substr(17), "0200");  // 0.2.0, minor before major
  EXPECT_EQ(identity[7], '0') << "patch";
}

TEST(SlcanBoard, InvalidBytesAreRejectedAndTheNextSampleIsProcessed) {
  SlcanBoard board(image(images::Image::application));
  board.read();
  board.write("t3128\rO\r");
  EXPECT_EQ(board.read(), "\a") << "closed";
  EXPECT_EQ(board.read(), "");
  for (const std::string& line :
       {std::string("t31"), std::string("t3129"), std::string("t312800"), std::string("t312G00000000000000"),
        std::string("t8108") + std::string(16, '0'), std::string(3000, 't'), std::string("\xff\x00\x80\n\t;", 6),
        std::string("t3128zzzzzzzzzzzzzzzz"), std::string("O0"), std::string("S9")}) {
    board.write(line + "\r");
    EXPECT_EQ(board.read(), "\a") << line.substr(0, 20);
  }
  board.write("T0000031280011223344556677\rt31D4" + std::string(8, '0') + "\rt3008" + std::string(16, '0') +
              "\r");  // valid frames for other nodes
  for (int k = 0; k < 3; ++k) EXPECT_EQ(board.read(), "");
  // a time frame whose reading was lost: flagged as missing, the last reading is not repeated
  board.send_sample(0, 0, 3'300'000, 2500);
  const BoardTelemetry first = board.telemetry();
  EXPECT_NE(first.soc, 0xFFFFU);
  board.write(
      "t31D8"
      "40420F000000"
      "C409\r");
  const BoardTelemetry lost = board.telemetry();
  EXPECT_NE(lost.flags & (estimator::current_missing | estimator::voltage_missing), 0U);
  EXPECT_EQ(lost.voltage, 0xFFFFU);
  board.send_sample(2'000'000, 0, 3'300'000, 2500);
  EXPECT_EQ(board.telemetry().flags & (estimator::current_missing | estimator::voltage_missing), 0U);
}

class Fault : public ::testing::TestWithParam<const char*> {};

/// The image exits with the number of its check that failed (tests/firmware/fault_image.cpp).
TEST_P(Fault, LeavesARecordForTheNextRun) {
  const files::TemporaryFolder folder;
  auto command = images::emulator_command(images::emulated_boards().front(), image(images::Image::fault), {GetParam()});
  command.insert(command.end(), {"-serial", "none"});
  EXPECT_EQ(images::ChildProcess(command, folder.path() / "log").wait(), 0) << files::read_file(folder.path() / "log");
}
INSTANTIATE_TEST_SUITE_P(Kinds, Fault, ::testing::Values("address", "undefined", "stack", "overflow"),
                         [](const auto& kind) { return std::string(kind.param); });

}  // namespace
}  // namespace bms::firmware
