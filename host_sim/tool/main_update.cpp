// bms with the commands about updates: from a checkout they wait for no analysis.
#include "tool/command_line.hpp"
#include "tool/commands.hpp"

int main(int argc, char** argv) {
  using namespace bms::tool;
  std::vector<std::unique_ptr<Command>> commands;
  for (const auto make : {image_command, update_command}) commands.push_back(make());
  return run_command_line(commands, argc, argv);
}
