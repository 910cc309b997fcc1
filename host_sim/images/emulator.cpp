#include "images/emulator.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <stdexcept>

#include "files/bad_input.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "hal/stream_format.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"

namespace bms::images {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int silence_ms = 30'000;  ///< an emulator without output for so long hangs

/// Writes the samples as the image reads them.
void write_stream(const std::filesystem::path& path, const std::vector<measurement::Sample>& samples,
                  const std::optional<measurement::StartingPoint>& start) {
  hal::StreamHeader header;
  if (start) {
    header.has_start = 1;
    header.soc_ppb = start->soc_ppb;
    header.soc_sigma_ppb = start->soc_sigma_ppb;
  }
  std::string bytes(sizeof header + samples.size() * sizeof(measurement::Sample), '\0');
  std::memcpy(bytes.data(), &header, sizeof header);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    measurement::Sample clean{};
    std::memset(static_cast<void*>(&clean), 0,
                sizeof clean);  // padding of 0: the file is reproducible
    clean = samples[k];
    std::memcpy(bytes.data() + sizeof header + k * sizeof(measurement::Sample), &clean, sizeof clean);
  }
  files::write_file(path, bytes);
}

/// Read end of a named pipe. It is opened without waiting for the writer.
class Pipe {
 public:
  explicit Pipe(const std::filesystem::path& path) {
    if (mkfifo(path.c_str(), 0600) != 0)
      throw std::runtime_error("cannot create a pipe in " + path.parent_path().string());
    fd_ = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  }
  ~Pipe() { close(fd_); }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;

  bool wait(int timeout_ms) const {
    pollfd p{fd_, POLLIN, 0};
    return poll(&p, 1, timeout_ms) > 0;
  }
  /// Returns the bytes read; 0: there is no writer (any more); -1: nothing yet.
  ssize_t read(char* into, std::size_t size) const { return ::read(fd_, into, size); }

 private:
  int fd_ = -1;
};

}  // namespace

const std::vector<EmulatedBoard>& emulated_boards() {
  static const std::vector<EmulatedBoard> boards = {{"netduinoplus2", "netduinoplus2", replay::ScalarKind::float32},
                                                    {"microbit", "microbit", replay::ScalarKind::fixed}};
  return boards;
}

std::vector<std::string> emulator_command(const EmulatedBoard& board, const std::filesystem::path& image,
                                          const std::vector<std::string>& semihosting) {
  std::string config = "enable=on,target=native,arg=fw";
  for (const std::string& argument : semihosting) {
    if (argument.find(' ') != std::string::npos)
      throw files::BadInput(argument, 1,
                            "a space in the name, expected a TMPDIR without a space");  // it separates arguments
    config += ",arg=";
    for (const char c : argument) config += c == ',' ? std::string(",,") : std::string(1, c);
  }
  return {"qemu-system-arm", "-M",           board.machine,         "-display", "none", "-monitor", "none",
          "-kernel",         image.string(), "-semihosting-config", config};
}

BoardRun run_on_board(const EmulatedBoard& board, const std::filesystem::path& image,
                      const std::vector<measurement::Sample>& samples,
                      const std::optional<measurement::StartingPoint>& start, const std::vector<std::string>& more,
                      std::size_t states) {
  const files::TemporaryFolder folder;
  const auto in = folder.path() / "samples", out = folder.path() / "estimates", log = folder.path() / "log";
  write_stream(in, samples, start);
  const Pipe pipe(out);
  auto command = emulator_command(board, image, {in.string(), out.string()});
  command.insert(command.end(), {"-serial", "none"});
  command.insert(command.end(), more.begin(), more.end());
  ChildProcess qemu(command, log);

  BoardRun run;
  static_assert(estimator::estimate_words == hal::words_per_estimate);
  const std::size_t row = sizeof(estimator::EstimateWords) + states * sizeof(std::uint32_t);
  std::string bytes(samples.size() * row, '\0');
  std::size_t have = 0, first_block = 0;
  Clock::time_point first_at, last_at;
  auto last_answer = Clock::now();
  for (bool answering = true; answering && have < bytes.size();) {
    pipe.wait(20);
    const bool running = qemu.running();  // before reading: the last output of a finished emulator is read
    const ssize_t n = pipe.read(bytes.data() + have, bytes.size() - have);
    if (n > 0) {
      have += static_cast<std::size_t>(n);
      last_at = last_answer = Clock::now();
      if (first_block == 0) {
        first_block = have;
        first_at = last_at;
      }
    } else {
      answering = running && Clock::now() - last_answer < std::chrono::milliseconds(silence_ms);
      if (n == 0 && running) usleep(1'000);  // no writer yet: poll() returns at once
    }
  }
  if (have == bytes.size()) {
    const int status = qemu.wait();
    if (status != 0)
      throw std::runtime_error("the firmware on " + board.name + " ended with " + std::to_string(status));
  } else {
    throw std::runtime_error("the emulated " + board.name + " stopped after " + std::to_string(have / row) + " of " +
                             std::to_string(samples.size()) + " estimates: " + files::read_file(log));
  }
  run.words.resize(samples.size());
  run.state_words.resize(samples.size() * states);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    std::memcpy(&run.words[k], &bytes[k * row], sizeof(estimator::EstimateWords));
    if (states > 0)
      std::memcpy(&run.state_words[k * states], &bytes[k * row + sizeof(estimator::EstimateWords)],
                  states * sizeof(std::uint32_t));
  }
  const double seconds = std::chrono::duration<double>(last_at - first_at).count();
  if (seconds > 0) run.steps_per_second = static_cast<double>(have - first_block) / static_cast<double>(row) / seconds;
  return run;
}

replay::Track run_on_board(const EmulatedBoard& board, const files::CellFile& cell,
                           const std::vector<measurement::Sample>& samples,
                           const std::optional<measurement::StartingPoint>& start) {
  replay::Track track;
  replay::name_states(track, cell);
  BoardRun run = run_on_board(board, firmware_image(board.name, cell, Image::replay), samples, start, {},
                              track.state_names.size());
  track.scalar = board.scalar;
  track.rows = replay::Estimates(std::move(run.words), board.scalar);
  track.state_words = std::move(run.state_words);
  track.steps_per_second = run.steps_per_second;
  return track;
}

}  // namespace bms::images
