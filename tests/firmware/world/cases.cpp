#include "tests/firmware/world/cases.hpp"

#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "files/text_file.hpp"

namespace bms::world {

namespace {

/// One line per entry: a letter, a name and a value, separated by tabs.
std::string report_of(const Outcome& outcome) {
  std::string text = fmt::format("g\t{}\t{}\n", outcome.good ? 1 : 0, outcome.why);
  for (const auto& [name, value] : outcome.values) text += fmt::format("v\t{}\t{}\n", name, value);
  for (const auto& [name, value] : outcome.texts) text += fmt::format("t\t{}\t{}\n", name, value);
  return text + "end\n";
}

void read_report(const std::string& text, Outcome& outcome) {
  std::istringstream lines(text);
  bool complete = false;
  for (std::string line; std::getline(lines, line);) {
    complete = complete || line == "end";
    const auto first = line.find('\t');
    const auto second = first == std::string::npos ? first : line.find('\t', first + 1);
    if (second == std::string::npos) continue;
    const std::string name = line.substr(first + 1, second - first - 1), value = line.substr(second + 1);
    if (line[0] == 'g') {
      outcome.good = name == "1";
      outcome.why = value;
    }
    if (line[0] == 'v') outcome.values[name] = std::stod(value);
    if (line[0] == 't') outcome.texts[name] = value;
  }
  if (!complete) outcome.fail("the case ended without a report");
}

void write_all(int file, const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t written = write(file, text.data() + at, text.size() - at);
    if (written <= 0) return;
    at += static_cast<std::size_t>(written);
  }
}

}  // namespace

void Outcome::fail(const std::string& what) {
  good = false;
  if (!why.empty()) why += "; ";
  why += what;
}

double Outcome::value(const std::string& of, double otherwise) const {
  const auto found = values.find(of);
  return found == values.end() ? otherwise : found->second;
}

std::string Outcome::text(const std::string& of) const {
  const auto found = texts.find(of);
  return found == texts.end() ? std::string{} : found->second;
}

Cases::~Cases() { wait_for(0); }

std::filesystem::path Cases::file_of(const std::string& name) const {
  std::string file = name;
  std::replace(file.begin(), file.end(), '/', '_');
  return kept / file;
}

std::vector<Outcome> Cases::all_kept() const {
  std::vector<Outcome> all;
  if (!std::filesystem::exists(kept)) return all;
  for (const auto& file : std::filesystem::directory_iterator(kept)) {
    all.emplace_back().name = file.path().filename();
    read_report(files::read_file(file.path()), all.back());
  }
  std::sort(all.begin(), all.end(), [](const Outcome& a, const Outcome& b) { return a.name < b.name; });
  return all;
}

bool Cases::known(const std::string& name) {
  if (kept.empty() || !std::filesystem::exists(file_of(name))) return false;
  Outcome outcome;
  outcome.name = name;
  read_report(files::read_file(file_of(name)), outcome);
  if (!outcome.good && !only_kept) return false;
  outcomes_.push_back(outcome);
  return true;
}

bool Cases::over() const {
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begun_;
  return only_kept || (largest > 0 && run_ >= largest) || (most_minutes > 0 && passed.count() > 60 * most_minutes);
}

void Cases::start(const std::string& name, const std::function<void(Outcome&)>& body) {
  const bool of_another_part = seen_++ < first;
  if (known(name) || of_another_part || over()) return;
  wait_for(at_once_ - 1);
  ++run_;
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  std::fflush(nullptr);
  const int pid = fork();
  if (pid < 0) throw std::runtime_error("no process");
  if (pid == 0) {
    close(ends[0]);
    Outcome outcome;
    try {
      body(outcome);
    } catch (const std::exception& e) {
      outcome.fail(e.what());
    }
    write_all(ends[1], report_of(outcome));
    _exit(0);
  }
  close(ends[1]);
  running_.push_back({pid, ends[0], outcomes_.size(), {}, kept.empty() ? kept : file_of(name)});
  outcomes_.emplace_back().name = name;
}

void Cases::ended(Child& child) {
  close(child.pipe);
  waitpid(child.pid, nullptr, 0);
  Outcome& outcome = outcomes_[child.number];
  read_report(child.text, outcome);
  if (!child.kept.empty()) {
    std::filesystem::create_directories(child.kept.parent_path());
    std::ofstream(child.kept) << child.text;
  }
  if (talks && !outcome.good) fmt::print("FAILED {}: {}\n", outcome.name, outcome.why);
  std::fflush(stdout);
}

void Cases::wait_for(std::size_t most) {
  while (running_.size() > most) {
    std::vector<pollfd> files;
    for (const Child& child : running_) files.push_back({child.pipe, POLLIN, 0});
    poll(files.data(), files.size(), -1);
    for (std::size_t k = files.size(); k-- > 0;) {
      if (files[k].revents == 0) continue;
      char bytes[4096];
      const ssize_t count = ::read(running_[k].pipe, bytes, sizeof bytes);
      if (count > 0) {
        running_[k].text.append(bytes, static_cast<std::size_t>(count));
      } else {
        ended(running_[k]);
        running_.erase(running_.begin() + static_cast<std::ptrdiff_t>(k));
      }
    }
  }
}

std::vector<Outcome> Cases::finish() {
  wait_for(0);
  return std::exchange(outcomes_, {});
}

unsigned processors() { return std::max(1U, std::thread::hardware_concurrency()); }

}  // namespace bms::world
