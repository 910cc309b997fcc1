// A recording through the debugger's files, in blocks, as fast as the core computes. Command line: "fw SAMPLES
// ESTIMATES". Formats: hal/stream_format.hpp. Either file may be a named pipe; ESTIMATES is opened first. An incomplete
// sample at the end is ignored. Exit code 3: a file is missing, is not a stream, or cannot be written.
#include <algorithm>
#include <array>

#include "hal/emulated/semihosting.hpp"
#include "hal/estimate_record.hpp"
#include "hal/power.hpp"
#include "hal/samples.hpp"
#include "hal/stream_format.hpp"

namespace bms::hal {

namespace {

constexpr std::size_t block = BMS_STREAM_BLOCK;  // samples per transfer, limited by the board's RAM
constexpr int bad_stream = 3;

template <class T>
std::span<unsigned char> bytes_of(std::span<T> items) {
  return {reinterpret_cast<unsigned char*>(items.data()), items.size_bytes()};
}

// Bytes instead of Samples: the initial values of a Sample are not zero, so the whole block would be stored in flash.
alignas(measurement::Sample) std::array<unsigned char, block * sizeof(measurement::Sample)> samples;
std::size_t sample_count = 0, next = 0;
std::array<std::uint32_t, block * words_per_estimate> estimates;
std::size_t estimate_size = 0;
StreamHeader header;
int in = -1, out = -1;

/// Reads until `into` is full or the stream ends, because a pipe may return less per call. Returns the bytes read.
std::size_t read_fully(std::span<unsigned char> into) {
  std::size_t have = 0;
  while (have < into.size()) {
    const std::size_t n = semihosting::read(in, into.subspan(have));
    if (n == 0) break;
    have += n;
  }
  return have;
}

void open_streams() {
  static std::array<char, 512> text;
  std::array<const char*, 3> words{};
  if (semihosting::arguments(text, words) != words.size()) finish(bad_stream);
  out = semihosting::open(words[2], semihosting::Open::write);
  in = semihosting::open(words[1], semihosting::Open::read);
  const StreamHeader expected;
  if (in < 0 || out < 0 || read_fully(bytes_of(std::span(&header, 1))) != sizeof header) finish(bad_stream);
  if (header.magic != expected.magic || header.version != expected.version) finish(bad_stream);
}

void write_estimates() {
  if (!semihosting::write(out, bytes_of(std::span(estimates.data(), estimate_size)))) finish(bad_stream);
  estimate_size = 0;
}

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  if (next == sample_count) {
    if (in < 0) open_streams();
    if (estimate_size > 0) write_estimates();
    sample_count = read_fully(samples) / sizeof(measurement::Sample);
    next = 0;
    if (sample_count == 0) return nullptr;
  }
  const measurement::Sample& sample = *reinterpret_cast<const measurement::Sample*>(
      &samples[sizeof(measurement::Sample) * next++]);  // read_fully() wrote one there
  static measurement::PackSample<pack_cells> pack;
  pack.time_us = sample.time_us;
  pack.current_ua = sample.current_ua;
  pack.cell_uv.fill(sample.voltage_uv);  // a recording has one cell
  pack.temperature_cdegc[0] = sample.temperature_cdegc;
  return &pack;
}

std::optional<measurement::StartingPoint> starting_point() {
  if (header.has_start == 0) return std::nullopt;
  return measurement::StartingPoint{header.soc_ppb, header.soc_sigma_ppb};
}

void record_estimate(std::span<const std::uint32_t> words) {
  if (estimate_size + words.size() > estimates.size()) write_estimates();
  std::copy(words.begin(), words.end(), &estimates[estimate_size]);
  estimate_size += words.size();
}

std::uint32_t acquisition_us() { return 0; }

}  // namespace bms::hal
