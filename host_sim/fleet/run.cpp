#include "fleet/run.hpp"

#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <list>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "fleet/process.hpp"

namespace bms::fleet {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A unit under way.
struct Running {
  Unit unit;
  std::string recording_hash, cell_hash;
  fs::path page;  ///< empty: no page
  Process process;
};

std::string recording_hash(const std::string& path) {
  try {
    return files::sha256(files::read_file(path));
  } catch (const files::BadInput&) {
    return "";  // the task says what is wrong with it
  }
}

/// The last line that is not a warning: the tool's one line on bad input.
std::string error_line(const std::string& text) {
  std::string error;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = text.substr(at, end - at);
    if (!line.empty() && !line.starts_with("warning: ")) error = line;
    at = end + 1;
  }
  return files::printable(error.empty() ? "ended without a message" : error);
}

/// Returns true for signals that a faulty program sends itself. Others come from outside.
bool is_own_fault(int signal) {
  return signal == SIGSEGV || signal == SIGABRT || signal == SIGFPE || signal == SIGILL || signal == SIGBUS;
}

/// Returns the exit code as a shell has it; negative if the unit did not end by itself, or was interrupted.
int exit_code_of(int status) {
  constexpr int interrupted = 130;
  if (WIFEXITED(status)) return WEXITSTATUS(status) == interrupted ? -1 : WEXITSTATUS(status);
  return is_own_fault(WTERMSIG(status)) ? 128 + WTERMSIG(status) : -1;
}

/// Without a finding the recording's page is removed, if only pages with one are wanted.
bool keeps_page(const Depot& depot, const Json& result) {
  return depot.pages != Pages::found || result.value("verdict", "") != "NO_MISMATCH";
}

class Runner {
 public:
  Runner(const Depot& depot, const RunOptions& options) : depot_(depot), options_(options) {}

  RunCounts run() {
    std::size_t index = 0;
    read_manifest(depot_.manifest().string(), "table9", [&](const Unit& unit) {
      if (index++ % options_.parts != options_.part) return;
      ++counts_.units;
      if (is_finished(depot_, unit)) {
        ++counts_.skipped;
        return report();
      }
      if (stopped()) {
        ++counts_.unfinished;
        return;
      }
      start(unit);
      while (running_.size() >= options_.jobs && !stopped()) wait_for_one();
    });
    while (!running_.empty() && !stopped()) wait_for_one();
    counts_.unfinished += running_.size();
    running_.clear();  // kills what is still running
    return counts_;
  }

 private:
  bool stopped() const { return options_.stopped && options_.stopped(); }
  void report() const {
    if (options_.done) options_.done(counts_.skipped + counts_.ran + counts_.unfinished);
  }

  void start(const Unit& unit) {
    const std::string key = key_of(unit);
    const fs::path page = depot_.pages == Pages::none ? fs::path() : depot_.page(key);
    const fs::path identified = depot_.task == Task::identify ? depot_.identified(key) : fs::path();
    for (const fs::path& file : {depot_.result(key), page, identified}) {
      if (!file.empty()) fs::create_directories(file.parent_path());
    }
    std::vector<std::string> argv = {options_.program.string(), "--processors", std::to_string(options_.processors)};
    for (std::string& a : arguments_of(depot_, unit, "-", page.string(), identified.string()))
      argv.push_back(std::move(a));
    const std::string of_recording = recording_hash(unit.recording), of_cell = cell_hash(unit.cell);
    running_.push_back({unit, of_recording, of_cell, page, Process(argv)});
  }

  void wait_for_one() {
    int status = 0;
    const pid_t pid = waitpid(-1, &status, 0);
    if (pid < 0 && errno == EINTR) return;
    if (pid < 0) throw std::system_error(errno, std::generic_category(), "waiting for a unit");
    const auto ended =
        std::find_if(running_.begin(), running_.end(), [&](const Running& r) { return r.process.pid() == pid; });
    if (ended == running_.end()) return;
    ended->process.ended();
    finish(*ended, exit_code_of(status));
    running_.erase(ended);
    report();
  }

  void finish(const Running& r, int exit_code) {
    if (exit_code < 0) {
      ++counts_.unfinished;
      return;
    }
    Json result = Json::parse(r.process.standard_output(), nullptr, false);
    const bool good = exit_code <= 1 && result.is_object();
    if (!good) result = Json(nullptr);
    const bool has_page = good && !r.page.empty() && keeps_page(depot_, result) && fs::exists(r.page);
    std::error_code error;
    if (!has_page && !r.page.empty()) fs::remove(r.page, error);
    const Json file = {{"recording", r.unit.recording},
                       {"recording_sha256", r.recording_hash},
                       {"cell", r.unit.cell},
                       {"cell_sha256", r.cell_hash},
                       {"task", name_of(depot_.task)},
                       {"arguments", depot_.arguments},
                       {"version", depot_.version},
                       {"pages", name_of(depot_.pages)},
                       {"page", has_page},
                       {"exit_code", exit_code},
                       {"error", good ? Json(nullptr) : Json(error_line(r.process.standard_error()))},
                       {"result", std::move(result)}};
    files::write_file(depot_.result(key_of(r.unit)), file.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
    ++counts_.ran;
    counts_.errors += good ? 0 : 1;
  }

  const Depot& depot_;
  const RunOptions& options_;
  std::list<Running> running_;
  RunCounts counts_;
};

}  // namespace

RunCounts run_units(const Depot& depot, const RunOptions& options) { return Runner(depot, options).run(); }

}  // namespace bms::fleet
