// bms with all commands.
#include "tool/against.hpp"
#include "tool/command_line.hpp"
#include "tool/commands.hpp"

int main(int argc, char** argv) {
  using namespace bms::tool;
  std::vector<std::unique_ptr<Command>> commands;
  commands.push_back(import_command());
  commands.push_back(replay_command(run_against));
  for (const auto make :
       {simulate_command, experiment_command, identify_command, cell_command, diagnose_command, ammeter_command,
        fleet_command, study_command, proof_command, hil_command, flash_command, monitor_command, log_command,
        service_command, parameters_command, image_command, update_command})
    commands.push_back(make());
  return run_command_line(commands, argc, argv);
}
