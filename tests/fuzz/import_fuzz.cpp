// Any bytes as a log of a tester, a logger or a CAN bus, also compressed, with any options: the file is rejected with
// one line, or read. What was read is finite, and a recording that is written is read again with the same values.
//
//   byte 0   1: through a file, which may be compressed; 2: with a DBC file; 4: written and read again; 8: keep all
//   byte 1   format, sign, separator and units, see options_of()
//   then     the file. With a DBC file: the DBC file, a line "----", the log
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "files/recording_text.hpp"
#include "measurement/recording.hpp"
#include "tests/fuzz/require.hpp"

namespace {

using namespace bms;

/// A file in memory with a name of its own.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view content) : fd_(memfd_create("fuzz", 0)) {
    require(fd_ >= 0 && write(fd_, content.data(), content.size()) == static_cast<ssize_t>(content.size()));
  }
  ~MemoryFile() { close(fd_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return fmt::format("/proc/self/fd/{}", fd_); }

 private:
  int fd_;
};

files::ReadOptions options_of(std::uint8_t mode, std::uint8_t choice) {
  static constexpr std::array formats = {
      "",    "",     "csv", "bdf", "arbin", "maccor", "neware", "biologic", "pec", "candump", "battery-emulator",
      "asc", "gvret"};
  files::ReadOptions options;
  options.format = formats[choice % formats.size()];
  const int rest = choice / static_cast<int>(formats.size());
  options.sign = static_cast<files::CurrentSign>(rest % 3);
  if (rest / 3 == 1) options.separator = "tab";
  if (rest / 3 == 2) options.unit = {"time_s=ms", "current_a=mA", "voltage_v=mV", "temperature_c=K"};
  if (rest / 3 == 3) options.map = {"time_s=t", "current_a=i", "voltage_v=u"};
  if (rest / 3 == 4) options.cells_in_series = 16;
  options.keep_all = (mode & 8) != 0;
  options.refuse_doubtful = (mode & 16) != 0;
  options.day_first = (mode & 32) != 0;
  options.decimal_comma = (mode & 64) != 0;
  return options;
}

void require_readings(const measurement::Column& column, std::size_t rows) {
  require(column.empty() || column.size() == rows);
  for (const double value : column) require(std::isnan(value) || std::abs(value) <= 1e12);  // 1e9 in kilovolts
}

void require_whole(const measurement::Recording& r) {
  require(r.rows() >= 10 && r.current_a.size() == r.rows());
  for (const auto* column : {&r.current_a, &r.voltage_v, &r.temperature_c, &r.soc_ref, &r.current_ref_a,
                             &r.voltage_ref_v, &r.pack_voltage_v})
    require_readings(*column, r.rows());
  for (const auto* list : {&r.cell_voltage_v, &r.cell_temperature_c}) {
    for (const auto& column : *list) require_readings(column, r.rows());
  }
  for (std::size_t k = 0; k < r.rows(); ++k)
    require(std::isfinite(r.time_s[k]) && (k == 0 || r.time_s[k] >= r.time_s[k - 1]));
  if (!r.voltage_v.empty()) require(measurement::samples(r).size() == r.rows());
  for (std::size_t k = 0; k < r.cell_voltage_v.size(); ++k) require(measurement::cell(r, k).rows() == r.rows());
}

/// `bms import --out` and the file that it has written.
void require_the_same_again(const measurement::Recording& r, bool bdf) {
  static const std::string path =
      (std::filesystem::temp_directory_path() / fmt::format("import_fuzz_{}{}", getpid(), ".csv")).string();
  files::write_recording(r, path, bdf);
  measurement::Recording again;
  try {
    again = files::read_recording(path, files::VoltageColumn::optional);
  } catch (const files::BadInput&) {
    std::filesystem::remove(path);
    require(false);
  }
  std::filesystem::remove(path);
  require(again.rows() == r.rows());
  for (std::size_t k = 0; k < r.rows(); ++k) {
    require(again.time_s[k] == r.time_s[k]);
    require(again.current_a[k] == r.current_a[k] || std::isnan(r.current_a[k]));
  }
}

measurement::Recording read(std::uint8_t mode, std::uint8_t choice, const std::string& text) {
  files::ReadOptions options = options_of(mode, choice);
  const auto voltage = (mode & 128) != 0 ? files::VoltageColumn::optional : files::VoltageColumn::required;
  if ((mode & 2) != 0) {
    const std::size_t end = text.find("\n----\n");
    if (end == std::string::npos) return files::parse_recording(text, "fuzz.csv", voltage, options);
    const MemoryFile dbc(std::string_view(text).substr(0, end + 1)), log(std::string_view(text).substr(end + 6));
    options.dbc = dbc.path();
    options.map = {"current_a=I", "voltage_v=U", "t_2=T"};
    if ((mode & 1) != 0) options.map.pop_back();
    return files::read_recording(log.path(), voltage, options);
  }
  if ((mode & 1) == 0) return files::parse_recording(text, "fuzz.csv", voltage, options);
  return files::read_recording(MemoryFile(text).path(), voltage, options);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  try {
    const measurement::Recording r =
        read(data[0], data[1], std::string(reinterpret_cast<const char*>(data) + 2, size - 2));
    require_whole(r);
    if ((data[0] & 4) != 0) require_the_same_again(r, (data[0] & 8) != 0);
  } catch (const files::BadInput& e) {
    const std::string what = e.what();
    require(!what.empty() && what.find('\n') == std::string::npos);
  }
  return 0;
}
