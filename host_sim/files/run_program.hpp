// The end that programs with a command line share.
#pragma once

#include <cstdio>
#include <exception>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "files/bad_input.hpp"

namespace bms::files {

/// Parses the command line and calls run(). Returns the exit code: 0 done; 2 bad usage or bad input, in one line;
/// 3 internal error.
template <class Run>
int run_program(CLI::App& app, int argc, char** argv, const Run& run) {
  try {
    app.parse(argc, argv);
    run();
    return 0;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    fmt::print(stderr, "{}: {} (see --help)\n", app.get_name(), error.what());
    return 2;
  } catch (const BadInput& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", app.get_name(), error.what());
    return 3;
  }
}

}  // namespace bms::files
