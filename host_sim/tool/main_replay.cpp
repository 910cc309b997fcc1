// bms with the commands that need no identification: from a checkout they do not wait for it.
#include "files/bad_input.hpp"
#include "tool/command_line.hpp"
#include "tool/commands.hpp"

int main(int argc, char** argv) {
  using namespace bms::tool;
  const auto no_loop = [](const AgainstOptions&) -> int {
    throw bms::files::BadInput("--against", 1, "this program has no loop, expected the complete bms");
  };
  std::vector<std::unique_ptr<Command>> commands;
  commands.push_back(import_command());
  commands.push_back(replay_command(no_loop));
  commands.push_back(experiment_command());
  return run_command_line(commands, argc, argv);
}
