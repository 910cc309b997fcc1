// One subcommand of the command line.
#pragma once

namespace CLI {
class App;
}

namespace bms::tool {

/// A subcommand: it declares its options, holds their values and runs with them.
class Command {
 public:
  virtual ~Command() = default;

  /// Adds the subcommand to `app` with its options, their defaults and an example. Reads no file. The options refer to
  /// this object, so it must outlive `app`.
  virtual CLI::App* add(CLI::App& app) = 0;

  /// Runs the command after its options have been parsed. Returns the exit code: 0 done; 1 done, and the answer is no.
  /// Throws files::BadInput for bad usage and bad input (exit code 2); any other exception is a fault of the program.
  virtual int run() = 0;
};

}  // namespace bms::tool
