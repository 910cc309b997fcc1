// Compares flash, RAM and stack of every board with its budget, and tests how the stack depth is determined.
#include <regex>

#include <gtest/gtest.h>

#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "images/image_file.hpp"
#include "tests/firmware/board_budget.hpp"
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/rated_cell.hpp"
#include "tests/firmware/stack_depth.hpp"

namespace bms::firmware {
namespace {

class Budgets : public ::testing::TestWithParam<std::string> {};

TEST_P(Budgets, CoverTheImageOfTheChip) {
  const BoardFigures f = figures_of(GetParam());
  const BoardBudget budget = budget_of(GetParam());
  EXPECT_LE(f.flash, budget.flash);
  EXPECT_LE(f.ram, budget.ram);
  EXPECT_LE(f.stack_worst, budget.stack);
  const files::CommittedFigures flash(BMS_SOURCE_DIR "/boards/README.md", "budgets");
  ASSERT_TRUE(flash.has(GetParam())) << "no row in boards/README.md: run ./bms figures";
  EXPECT_LE(static_cast<double>(f.flash), 1.05 * flash.at(GetParam()))
      << "if the growth is worth it, run ./bms figures";
}

TEST_P(Budgets, CoverTwoMinutesOfARun) {
  const auto run = run_of(GetParam());
  if (!run) GTEST_SKIP() << "no emulator runs the image of " << GetParam() << " without a host program";
  const std::uint64_t worst = figures_of(GetParam()).stack_worst;
  EXPECT_LE(run->stack, worst);
  EXPECT_GT(3 * run->stack, worst) << "the run did not reach the deep functions";
  EXPECT_GT(run->sample_ms, 0);
  EXPECT_LE(run->sample_ms, budget_of(GetParam()).sample_ms);
}

INSTANTIATE_TEST_SUITE_P(Of, Budgets, ::testing::ValuesIn(images::board_names()),
                         [](const auto& board) { return board.param; });

/// Parameters and the ends of charges took 7 KB; a slot for update has 256 KiB.
TEST(ForkliftBudgets, Are96KilobytesOfFlashAnd16OfRam) {
  const BoardBudget b = budget_of("stm32f405_forklift");
  EXPECT_EQ(b.flash, 96U * 1024);
  EXPECT_EQ(b.ram, 16U * 1024);
}

/// What receives an update takes 9 KB of RAM, and 2 KiB of stack for one header; cell constants of an update take 9 KB
/// more. The chip has 128 KiB of RAM and the stack apart from it, a slot 256 KiB; the budgets of board.cmake are those
/// of an image without a slot.
TEST(ForkliftBudgets, OfAnImageInASlotAre28KilobytesOfRamAndTheStackAboveItsGuard) {
  const auto image =
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::remote_slot_a);
  const ImageSize size = size_of(image);
  const images::ImageFile file(image);
  const std::uint32_t stack = file.symbol("image_stack_top") - file.symbol("image_stack_limit") - 1'024,
                      worst = stack_depth(image).worst();
  std::printf("in a slot: %zu bytes of flash, %zu of RAM, at worst %u of %u of stack\n",
              static_cast<std::size_t>(size.text + size.data), static_cast<std::size_t>(size.data + size.bss), worst,
              stack);
  EXPECT_LE(size.text + size.data, 128U * 1024);
  EXPECT_LE(size.data + size.bss, 28U * 1024);
  EXPECT_LE(worst, stack);
}

/// What the model says about pulses has tables of its own in RAM, because they are too large for the stack.
TEST(ForkliftBudgets, HoldForACellFileThatRatesPulses) {
  const BoardBudget budget = budget_of("stm32f405_forklift");
  const auto image = images::firmware_image("stm32f405_forklift", table9_rated(), images::Image::application);
  const ImageSize size = size_of(image);
  const std::uint64_t worst = stack_depth(image).worst();
  std::printf("%zu bytes of flash, %zu of RAM, at worst %zu of stack\n",
              static_cast<std::size_t>(size.text + size.data), static_cast<std::size_t>(size.data + size.bss),
              static_cast<std::size_t>(worst));
  EXPECT_LE(size.text + size.data, budget.flash);
  EXPECT_LE(size.data + size.bss, budget.ram);
  EXPECT_LE(worst, budget.stack);
}

// instructions as objdump prints them
const std::string main_calls_two = R"(
08000000 <main>:
 8000000:	b530      	push	{r4, r5, lr}
 8000002:	b086      	sub	sp, #24
 8000004:	f000 f800 	bl	8000100 <leaf()>
 8000008:	d001      	beq.n	800000e <main+0xe>
 800000a:	f000 f800 	bl	8000200 <deep(int)>
 800000e:	b006      	add	sp, #24
 8000010:	bd30      	pop	{r4, r5, pc}

08000100 <leaf()>:
 8000100:	4770      	bx	lr

08000200 <deep(int)>:
 8000200:	ed2d 8b04 	vpush	{d8-d9}
 8000204:	f84d ed08 	str.w	lr, [sp, #-8]!
 8000208:	f000 f800 	bl	8000100 <leaf()>
 800020c:	f85d eb08 	ldr.w	lr, [sp], #8
 8000210:	ecbd 8b04 	vpop	{d8-d9}
 8000214:	4770      	bx	lr
)";

TEST(StackDepth, IsTheDeepestPathThroughTheCalls) {
  const Functions functions = functions_of(main_calls_two);
  EXPECT_EQ(functions.at(0x8000000).stack, 36U);
  EXPECT_EQ(functions.at(0x8000200).stack, 24U);
  const Depth d = depth_from(functions, 0x8000000, {});
  EXPECT_EQ(d.bytes, 60U);
  EXPECT_EQ(d.path, (std::vector<std::string>{"main", "deep(int)", "leaf()"}));
}

TEST(StackDepth, CountsABranchAfterAnEpilogueAsDeepAsBefore) {
  const Functions f = functions_of(
      "08000000 <f>:\n 8000000:\tb510\tpush\t{r4, lr}\n 8000002:\td001\tbeq.n\t8000008 <f+0x8>\n "
      "8000004:\tbd10\tpop\t{r4, pc}\n 8000008:\tb084\tsub\tsp, #16\n");
  EXPECT_EQ(f.at(0x8000000).stack, 24U);
}

TEST(StackDepth, CountsALargeFrameOfTheCortexM0) {
  const Functions f = functions_of(
      "00000000 <f>:\n   0:\tb510\tpush\t{r4, lr}\n   2:\t4c01\tldr\tr4, [pc, #4]\t@ (8 <f+0x8>)\n   "
      "4:\t44a5\tadd\tsp, r4\n   6:\tbd10\tpop\t{r4, pc}\n   8:\tfffffdf8 \t.word\t0xfffffdf8\n");
  EXPECT_EQ(f.at(0).stack, 8U + 0x208);
}

TEST(StackDepth, RejectsWhatItCannotDetermine) {
  const Functions pointer = functions_of("00000000 <f>:\n   0:\t4798\tblx\tr3\n   2:\t4770\tbx\tlr\n");
  EXPECT_THROW(depth_from(pointer, 0, {}), std::runtime_error);
  EXPECT_EQ(depth_from(pointer, 0, {{"f", {}}}).bytes, 0U);
  const Functions itself =
      functions_of("00000000 <f>:\n   0:\tb510\tpush\t{r4, lr}\n   2:\tf7ff\tbl\t0 <f>\n   6:\tbd10\tpop\t{r4, pc}\n");
  EXPECT_THROW(depth_from(itself, 0, {}), std::runtime_error);
  EXPECT_THROW(functions_of("00000000 <f>:\n   0:\t4798\tsub.w\tsp, sp, r3\n"), std::runtime_error);
}

/// Compared with the figures of the compiler (-fstack-usage) for the same image.
TEST(StackDepth, OfAFunctionAgreesWithTheCompiler) {
  const auto image =
      images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::application);
  std::map<std::string, std::uint32_t> compiler;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(image.parent_path() / "CMakeFiles")) {
    if (entry.path().extension() != ".su") continue;
    static const std::regex line("[^\\n]*?:[0-9]+:[0-9]+:([^\\t]*)\\t([0-9]+)\\tstatic");
    const std::string text = files::read_file(entry.path());
    for (std::sregex_iterator it(text.begin(), text.end(), line), end; it != end; ++it)
      compiler[(*it)[1]] = static_cast<std::uint32_t>(std::stoul((*it)[2]));
  }
  std::size_t compared = 0;
  for (const auto& function :
       functions_of(images::output_of({"arm-none-eabi-objdump", "--disassemble", "--demangle", image.string()}))) {
    const auto& f = function.second;
    const auto known = std::find_if(compiler.begin(), compiler.end(), [&](const auto& c) {
      return c.first == f.name || c.first.ends_with(" " + f.name);
    });
    if (known == compiler.end()) continue;
    EXPECT_EQ(f.stack, known->second) << f.name;
    ++compared;
  }
  EXPECT_GT(compared, 40U);
}

}  // namespace
}  // namespace bms::firmware
