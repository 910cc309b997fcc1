// bms with the commands about a cell: from a checkout they wait for no study, proof, fleet, loop and monitor.
#include "tool/command_line.hpp"
#include "tool/commands.hpp"

int main(int argc, char** argv) {
  using namespace bms::tool;
  std::vector<std::unique_ptr<Command>> commands;
  for (const auto make : {simulate_command, identify_command, cell_command, diagnose_command, ammeter_command})
    commands.push_back(make());
  return run_command_line(commands, argc, argv);
}
