// bms import: a log of a tester, a logger or a CAN bus as a recording.
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/logs/frame_list.hpp"
#include "files/recording.hpp"
#include "files/recording_text.hpp"
#include "measurement/recording_checks.hpp"
#include "reports/json_replay.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "tool/recording_part.hpp"

namespace bms::tool {

namespace {

class ImportCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "import", "Read a log of a tester, a logger or a CAN bus and write it as a recording (CSV or BDF)");
    c.footer("Example: bms import arbin_export.csv --discharge-positive --out recording.csv");
    c.add_option("file", file_, "log to read; docs/log_formats.md lists what is known")->required();
    c.add_option("--out", out_, "recording to write; in the Battery Data Format if it ends in .bdf or .bdf.csv")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_option("--cell", cell_, cell_help("compare the readings with this cell"));
    c.add_flag("--profile", profile_, "a current profile without a voltage");
    c.add_flag("--list", list_, "list the messages and signals of a CAN log, and what they could be; writes nothing");
    add_part(c, part_);
    add_reading(c, reading_);
    add_json(c, output_);
    return &c;
  }

  int run() override {
    complete_reading(reading_);
    output_.set_own(out_);
    output_.protect({file_, cell_, reading_.dbc});
    if (list_) return list();
    reading_.keep_all = !out_.empty();
    measurement::Recording recording = files::read_recording(
        file_, profile_ ? files::VoltageColumn::optional : files::VoltageColumn::required, reading_);
    print_read_as(output_, recording);
    cut(part_, recording);
    if (!cell_.empty()) {
      measurement::compare_with_cell(recording, files::read_cell(cell_).parameters);
      refuse_contradiction(recording);
    }
    for (const measurement::Warning& w : recording.warnings) warn(file_ + ": " + w.text);
    if (!out_.empty()) files::write_recording(recording, out_, files::is_bdf_name(out_));
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(recording, out_));
    print_summary(output_, summary(recording));
    return 0;
  }

 private:
  int list() const {
    const files::FrameList list = files::list_frames(file_, reading_);
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(list, file_));
    print_summary(output_, files::printable(files::text_of(list), true));
    return 0;
  }

  std::string summary(const measurement::Recording& r) const {
    const auto range = [](const measurement::Column& column, std::string_view unit) {
      double low = std::nan(""), high = low;
      for (const double value : column) {  // of a missing reading the other one
        low = std::fmin(low, value);
        high = std::fmax(high, value);
      }
      return std::isnan(low) ? fmt::format(", no reading in {}", unit)
                             : fmt::format(", {:g} to {:g} {}", low, high, unit);
    };
    std::string text = fmt::format("{} rows, {:.2f} h{}", r.rows(), r.duration_s() / 3'600, range(r.current_a, "A"));
    if (!r.voltage_v.empty()) text += range(r.voltage_v, "V");
    if (!r.cell_voltage_v.empty()) text += fmt::format(", {} cells", r.cell_voltage_v.size());
    return text + (out_.empty() ? ". Nothing was written: name a file with --out." : ": " + out_);
  }

  std::string file_, out_, cell_;
  bool profile_ = false, list_ = false;
  files::ReadOptions reading_;
  RecordingPart part_;
  Output output_;
};

}  // namespace

std::unique_ptr<Command> import_command() { return std::make_unique<ImportCommand>(); }

}  // namespace bms::tool
