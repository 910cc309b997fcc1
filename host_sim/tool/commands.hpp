// All subcommands of bms. Each is one file, command_NAME.cpp.
#pragma once

#include <memory>

#include "tool/against.hpp"
#include "tool/command.hpp"

namespace bms::tool {

std::unique_ptr<Command> import_command();  ///< a log of a tester, a logger or a CAN bus as a recording
/// Estimates for a recording, on the host or an emulated board; against: of two firmwares on one log.
std::unique_ptr<Command> replay_command(RunAgainst against);
std::unique_ptr<Command> simulate_command();    ///< model voltage for a current, open loop
std::unique_ptr<Command> experiment_command();  ///< a current profile by name
std::unique_ptr<Command> identify_command();    ///< recordings in, cell file out
std::unique_ptr<Command> cell_command();        ///< checks, shows, scales and plots a cell file
std::unique_ptr<Command> diagnose_command();    ///< where a cell file and recordings disagree, and why
std::unique_ptr<Command> ammeter_command();     ///< errors of the current sensor from a log, and their correction
std::unique_ptr<Command> fleet_command();       ///< many recordings of a depot: run, merge, report
std::unique_ptr<Command> study_command();       ///< the paper's comparison of models, optimisers and experiments
std::unique_ptr<Command> proof_command();       ///< the diagnosis of real recordings against measurements
std::unique_ptr<Command> hil_command();         ///< a board in the loop with a simulated pack or a recording
std::unique_ptr<Command> flash_command();       ///< writes a board's image onto the chip
std::unique_ptr<Command> monitor_command();     ///< CAN frames as a screen, a log, a page
std::unique_ptr<Command> log_command();         ///< what a battery has stored, read over CAN
std::unique_ptr<Command> service_command();     ///< a command that needs a service session
std::unique_ptr<Command> parameters_command();  ///< the parameters of a battery, read and set over CAN
std::unique_ptr<Command> update_command();      ///< new firmware over CAN
std::unique_ptr<Command> image_command();       ///< signed images: keys, signing, checking

}  // namespace bms::tool
