// The command line of bms: it parses the arguments, runs one command and returns the exit code.
#pragma once

#include <memory>
#include <vector>

#include "tool/command.hpp"

namespace bms::tool {

/// commands: those that exist, in the order of the help. Returns the exit code: 0 done; 1 done, and the answer is no; 2
/// bad usage or bad input; 3 a fault of the program.
int run_command_line(const std::vector<std::unique_ptr<Command>>& commands, int argc, char** argv);

}  // namespace bms::tool
