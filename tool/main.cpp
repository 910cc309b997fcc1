// The command line of bms: it parses the arguments, runs one command and returns the exit code.
//
//   0 done; 1 done, and the answer is no; 2 bad usage or bad input; 3 a fault of the program
#include <cstdio>
#include <exception>
#include <utility>
#include <vector>

#include "files/bad_input.hpp"
#include "tool/commands.hpp"

namespace {

using namespace bms::tool;

/// All commands, in the order of the help.
std::vector<std::unique_ptr<Command>> all_commands() {
  std::vector<std::unique_ptr<Command>> commands;
  for (const auto make : {replay_command, simulate_command, experiment_command, identify_command, diagnose_command,
                          study_command, proof_command, hil_command, flash_command, monitor_command, log_command})
    commands.push_back(make());
  return commands;
}

/// Prints the help, or a usage error on one line. Returns the exit code.
int refuse(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
  std::fprintf(stderr, "bms: %s (see bms --help)\n", error.what());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  const auto commands = all_commands();
  CLI::App app{"greybox-bms: a battery model inside a battery management system, and the same model over recordings"};
  app.name("bms");
  app.require_subcommand(1);
  app.set_version_flag("--version", BMS_VERSION);
  app.footer(
      "bms COMMAND --help shows the options of a command.\n"
      "Conventions: a current above 0 charges the cell; a state of charge is a fraction from 0 to 1.");
  std::vector<std::pair<CLI::App*, Command*>> entries;
  for (const auto& command : commands) entries.emplace_back(command->add(app), command.get());
  try {
    app.parse(argc, argv);
    for (const auto& [entry, command] : entries) {
      if (entry->parsed()) return command->run();
    }
    return 3;  // require_subcommand has refused this
  } catch (const CLI::ParseError& error) {
    return refuse(app, error);
  } catch (const bms::files::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bms: %s\n", error.what());
    return 3;
  }
}
