#include "tests/firmware/step_cost.hpp"

#include <cstdio>
#include <regex>
#include <stdexcept>

#include <fmt/format.h>

#include "estimator/cell_differences.hpp"
#include "estimator/condition.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "protection/protection.hpp"
#include "tests/firmware/elf_image.hpp"

namespace bms::firmware {

namespace {

/// Options with which the emulator counts the instructions of a function.
std::vector<std::string> counting(const std::filesystem::path& image, const char* function, const std::string& log) {
  const auto symbols = symbols_of(image);
  const Symbol counted = symbol_named(symbols, function), interrupt = symbol_named(symbols, "clock_interrupt");
  return {"-plugin",
          fmt::format("{},entry={:x},skip={:x}-{:x}", BMS_INSTRUCTION_COUNT, counted.address & ~1ULL,
                      interrupt.address & ~1ULL, (interrupt.address & ~1ULL) + interrupt.size),
          "-d",
          "plugin",
          "-D",
          log};
}

StepCost counted_in(const std::string& log) {
  unsigned long long calls = 0, first = 0, least = 0, most = 0, sum = 0;
  const std::string text = files::read_file(log);
  if (std::sscanf(text.c_str(), "calls %llu first %llu min %llu max %llu sum %llu", &calls, &first, &least, &most,
                  &sum) != 5 ||
      calls < 2) {
    throw std::runtime_error("unexpected output of the instruction counter: " + text);
  }
  return {calls, first, least, most, static_cast<double>(sum) / static_cast<double>(calls - 1)};
}

}  // namespace

StepCost count_instructions(const images::EmulatedBoard& board, const std::filesystem::path& image,
                            const char* function) {
  const files::TemporaryFolder folder;
  const std::string log = (folder.path() / "count").string();
  auto command = images::emulator_command(board, image, {});
  const auto more = counting(image, function, log);
  command.insert(command.end(), more.begin(), more.end());
  command.insert(command.end(), {"-serial", "none"});
  if (const int code = images::ChildProcess(command, folder.path() / "log").wait(); code != 0)
    throw std::runtime_error(
        fmt::format("{} ended with {}: {}", image.string(), code, files::read_file(folder.path() / "log")));
  return counted_in(log);
}

StepCost count_instructions(const images::EmulatedBoard& board, const std::filesystem::path& replay_image,
                            const std::vector<measurement::Sample>& samples, std::size_t states, const char* function) {
  const files::TemporaryFolder folder;
  const std::string log = (folder.path() / "count").string();
  images::run_on_board(board, replay_image, samples, std::nullopt, counting(replay_image, function, log), states);
  return counted_in(log);
}

Footprint footprint(const std::filesystem::path& application_image) {
  const auto symbols = symbols_of(application_image);
  const ImageSize size = size_of(application_image);
  Footprint f;
  static const std::regex of_estimator(
      ".*bms::(firmware::estimator_step\\(|estimator::SocEstimator<|firmware::BoardCell::update_condition\\(|estimator:"
      ":Condition<|"
      "estimator::current_"
      "limits<|estimator::StartSearch<|estimator::SocSums<|estimator::PriorMisfit<|estimator::SocBank<|estimator::"
      "StartMisfit<|arithmetic::|model::|estimator::"
      "UdCovariance<|"
      "estimator::InputCheck).*");
  for (const Symbol& s : symbols) {
    if (s.name.starts_with("bms::generated::cell<"))
      f.cell_tables += s.size;
    else if (std::regex_match(s.name, of_estimator) && s.name.find("bms::firmware::Telemetry<") == std::string::npos)
      f.estimator_text += s.size;  // telemetry has the estimator only among its template arguments
  }
  f.image_text = size.text;
  f.image_ram = size.data + size.bss;
  const std::string usage = files::read_file(application_image.parent_path() /
                                             "CMakeFiles/estimator_step.dir/firmware/estimator_step.cpp.su");
  std::smatch found;
  if (!std::regex_search(usage, found, std::regex("bms::firmware::estimator_step[^\t]*\t([0-9]+)\tstatic")))
    throw std::runtime_error("no stack usage in " + usage);
  f.step_stack = std::stoull(found[1]);
  return f;
}

std::vector<std::pair<std::string, double>> core_figures(const images::EmulatedBoard& board,
                                                         const files::CellFile& cell,
                                                         const std::vector<measurement::Sample>& samples) {
  const StepCost cost = count_instructions(board, images::firmware_image(board.name, cell, images::Image::replay),
                                           samples, replay::state_count(cell));
  const StepCost condition =
      count_instructions(board, images::firmware_image(board.name, cell, images::Image::replay), samples,
                         replay::state_count(cell), "bms::firmware::BoardCell::update_condition(");
  const ImageSize size = size_of(images::firmware_image(board.name, cell, images::Image::application));
  const auto number = [](std::uint64_t n) { return static_cast<double>(n); };
  return {{"step, mean [instructions]", cost.mean},
          {"step, longest [instructions]", number(cost.most)},
          {"first step, which starts the filter [instructions]", number(cost.first)},
          {"quality, display, health per sample, mean [instructions]", condition.mean},
          {"flash of the whole application [bytes]", number(size.text)},
          {"RAM of the whole application, without stack [bytes]", number(size.data + size.bss)}};
}

std::vector<std::pair<std::string, double>> step_figures(const images::EmulatedBoard& board,
                                                         const files::CellFile& cell,
                                                         const std::vector<measurement::Sample>& samples) {
  const StepCost cost = count_instructions(board, images::firmware_image(board.name, cell, images::Image::replay),
                                           samples, replay::state_count(cell));
  const StepCost condition =
      count_instructions(board, images::firmware_image(board.name, cell, images::Image::replay), samples,
                         replay::state_count(cell), "bms::firmware::BoardCell::update_condition(");
  const StepCost pack = count_instructions(board, images::firmware_image(board.name, cell, images::Image::pack),
                                           "bms::firmware::pack_step(");
  const Footprint f = footprint(images::firmware_image(board.name, cell, images::Image::application));
  const auto number = [](std::uint64_t n) { return static_cast<double>(n); };
  return {{"step, mean [instructions]", cost.mean},
          {"step, longest [instructions]", number(cost.most)},
          {"first step, which starts the filter [instructions]", number(cost.first)},
          {"quality, display, health per sample, mean [instructions]", condition.mean},
          {"differences of sixteen cells, mean [instructions]", pack.mean},
          {"stack of a step [bytes]", number(f.step_stack)},
          {"code of estimator and model [bytes]", number(f.estimator_text)},
          {"the cell's tables [bytes]", number(f.cell_tables)},
          {"state of the difference of one cell [bytes]", number(sizeof(estimator::CellDifference<float>))},
          {"state of one cell [bytes]", number(sizeof(estimator::CellState<float, model::OneRc>))},
          {"state of one estimator with its input checks [bytes]", number(sizeof(estimator::SocEstimator<float>))},
          {"state of quality, display, limits and health [bytes]",
           number(sizeof(estimator::Condition<estimator::SocEstimator<float>>))},
          {"flash of the whole application [bytes]", number(f.image_text)},
          {"RAM of the whole application, without stack [bytes]", number(f.image_ram)}};
}

std::vector<std::pair<std::string, StepCost>> filter_form_costs(const images::EmulatedBoard& board,
                                                                const files::CellFile& cell) {
  const auto image = images::firmware_image(board.name, cell, images::Image::filter_forms);
  return {{"U-D factors, `ud_covariance.hpp`", count_instructions(board, image, "bms::firmware::ud_step(")},
          {"Eigen, Joseph form", count_instructions(board, image, "bms::firmware::eigen_joseph_step(")},
          {"Eigen, plain form, which can lose its positive variances",
           count_instructions(board, image, "bms::firmware::eigen_plain_step(")}};
}

std::vector<std::pair<std::string, double>> protection_figures(const images::EmulatedBoard& board,
                                                               const files::CellFile& cell) {
  const auto image = images::firmware_image(board.name, cell, images::Image::protection);
  const StepCost cost = count_instructions(board, image, "bms::protection::protection_step(");
  std::uint64_t code = 0, plan = 0;
  for (const Symbol& s : symbols_of(image)) {
    if (s.name.starts_with("bms::protection::protection_step(")) code += s.size;
    if (s.name.starts_with("bms::protection::scenario_plan")) plan += s.size;
  }
  const auto number = [](std::uint64_t n) { return static_cast<double>(n); };
  return {{"sixteen cells, mean [instructions]", cost.mean},
          {"sixteen cells, longest [instructions]", number(cost.most)},
          {"code [bytes]", number(code)},
          {"the table and the other constants of a pack [bytes]", number(plan)},
          // pointers have four bytes on the board, eight here
          {"state of sixteen cells, at most [bytes]", number(sizeof(protection::Protection<16>))},
          {"state of one cell, at most [bytes]", number(sizeof(protection::Protection<1>))}};
}

}  // namespace bms::firmware
