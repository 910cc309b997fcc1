#include "tool/command_line.hpp"

#include <fcntl.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "files/bad_input.hpp"
#include "numerics/in_parallel.hpp"
#include "tool/output.hpp"
#include "tool/progress.hpp"

namespace bms::tool {

namespace {

/// Large matrices come and go by the thousand: their memory stays with the program instead of being returned, cleared
/// and mapped again each time.
void keep_memory() {
#ifdef __GLIBC__
  constexpr int largest_kept = 32 << 20;  // that glibc accepts [bytes]
  mallopt(M_MMAP_THRESHOLD, largest_kept);
  mallopt(M_TRIM_THRESHOLD, 16 * largest_kept);
#endif
}

/// Prints the help, or a usage error on one line. Returns the exit code.
int refuse(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) {  // --help, --version
    app.exit(error);
    check_standard_output();
    return 0;
  }
  std::fprintf(stderr, "bms: %s (see bms --help)\n", bms::files::printable(error.what()).c_str());
  return 2;
}

/// Changes of letters that make one word of the other.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t k = 0; k < row.size(); ++k) row[k] = k;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t before = row[0]++;
    for (std::size_t k = 1; k <= b.size(); ++k) {
      const std::size_t changed = before + (a[i - 1] == b[k - 1] ? 0 : 1);
      before = row[k];
      row[k] = std::min({changed, row[k] + 1, row[k - 1] + 1});
    }
  }
  return row.back();
}

/// The name that is most like a word; names with more than two changes are other words.
class Nearest {
 public:
  explicit Nearest(std::string word) : word_(std::move(word)) {}
  void try_name(const std::string& name) {
    const std::size_t by = distance(word_, name);
    if (by >= changes_) return;
    changes_ = by;
    name_ = name;
  }
  /// "; did you mean NAME?"; empty if none is near.
  std::string question() const { return name_.empty() ? "" : "; did you mean " + name_ + "?"; }

 private:
  std::string word_, name_;
  std::size_t changes_ = 3;
};

/// Why the first word was not understood; empty if it is a command or an option.
std::string unknown_command(const std::vector<std::pair<CLI::App*, Command*>>& entries, const std::string& word) {
  if (word.empty() || word.front() == '-') return "";
  Nearest nearest(word);
  for (const auto& [entry, command] : entries) {
    const std::string name = entry->get_name();
    if (name == word) return "";
    nearest.try_name(name);
  }
  return "no such command '" + bms::files::printable(word) + "', expected one of those of bms --help" +
         nearest.question();
}

/// Why an option was not understood; empty if all are known. Their values are not looked at.
std::string unknown_option(const CLI::App& top, int argc, char** argv) {
  const CLI::App* app = &top;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    if (word == "--") break;
    if (!word.starts_with("--")) {
      const auto inner = app->get_subcommands([&](const CLI::App* a) { return a->get_name() == word; });
      if (!inner.empty()) app = inner.front();
      continue;
    }
    const std::string name = word.substr(0, word.find('='));
    Nearest nearest(name);
    bool known = false;
    for (const CLI::App* a = app; a != nullptr; a = a->get_parent()) {
      known = known || a->get_option_no_throw(name) != nullptr;
      for (const CLI::Option* option : a->get_options()) {
        for (const std::string& other : option->get_lnames()) nearest.try_name("--" + other);
      }
    }
    if (known) continue;
    return "no such option '" + bms::files::printable(name) + "', expected one of those of bms " +
           (app == &top ? "" : app->get_name() + " ") + "--help" + nearest.question();
  }
  return "";
}

/// A file that is opened must not become a closed standard output, or results would be mixed. A closed pipe is an error
/// like a full disk, not the end of the process.
void prepare_standard_streams() {
  constexpr std::array modes = {O_RDONLY, O_RDONLY, O_WRONLY};  // of /dev/null; writing to fd 1 fails and is noticed
  for (int fd = 0; fd < 3; ++fd) {
    if (fcntl(fd, F_GETFD) < 0) open("/dev/null", modes[static_cast<std::size_t>(fd)]);
  }
  std::signal(SIGPIPE, SIG_IGN);
}

int run(CLI::App& app, const std::vector<std::pair<CLI::App*, Command*>>& entries, int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "";
  if (first == "help" || first == "version") {
    std::fputs(first == "help" ? app.help().c_str() : BMS_VERSION "\n", stdout);
    check_standard_output();
    return 0;
  }
  if (const std::string why = unknown_command(entries, first); !why.empty()) {
    std::fprintf(stderr, "bms: %s\n", why.c_str());
    return 2;
  }
  if (const std::string why = unknown_option(app, argc, argv); !why.empty()) {
    std::fprintf(stderr, "bms: %s\n", why.c_str());
    return 2;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return refuse(app, error);
  }
  for (const auto& [entry, command] : entries) {
    if (!entry->parsed()) continue;
    const std::string name = entry->get_name();
    // these are live, or a dialogue with a battery
    const bool live = name == "monitor" || name == "log" || name == "service";
    std::optional<Heartbeat> heartbeat;
    if (!live) heartbeat.emplace(name);
    const int code = command->run();
    heartbeat.reset();
    check_standard_output();
    return code;
  }
  return 3;  // require_subcommand has refused this
}

}  // namespace

int run_command_line(const std::vector<std::unique_ptr<Command>>& commands, int argc, char** argv) {
  keep_memory();
  prepare_standard_streams();
  CLI::App app{"greybox-bms: a battery model inside a battery management system, and the same model over recordings"};
  app.name("bms");
  app.require_subcommand(1);
  app.set_version_flag("--version", BMS_VERSION);
  app.add_option_function<int>("--processors", bms::numerics::use_processors,
                               "processors that a command uses at most, before its name (default: all)")
      ->envname("BMS_PROCESSORS")
      ->check(CLI::PositiveNumber);
  app.footer(
      "bms COMMAND --help shows the options of a command.\n"
      "Conventions: a current above 0 charges the cell; a state of charge is a fraction from 0 to 1.");
  std::vector<std::pair<CLI::App*, Command*>> entries;
  for (const auto& command : commands) entries.emplace_back(command->add(app), command.get());
  try {
    return run(app, entries, argc, argv);
  } catch (const bms::files::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::system_error& error) {  // printing may fail before check_standard_output() is called
    std::fprintf(stderr, "bms: %s\n", bms::files::printable(error.what()).c_str());
    return std::ferror(stdout) != 0 ? 2 : 3;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bms: %s\n", bms::files::printable(error.what()).c_str());
    return 3;
  }
}

}  // namespace bms::tool
