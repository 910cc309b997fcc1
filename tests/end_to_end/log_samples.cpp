#include "tests/end_to_end/log_samples.hpp"

#include <archive.h>
#include <archive_entry.h>

#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

namespace bms::log_samples {

namespace {

using RowText = std::function<std::string(std::size_t, const Row&)>;

std::string lines(const std::string& header, const RowText& row, const std::string& end = "\n") {
  std::string text = header + end;
  const std::vector<Row> rows = signal();
  for (std::size_t k = 0; k < rows.size(); ++k) text += row(k, rows[k]) + end;
  return text;
}

std::string plain(const std::string& header, const std::string& separator = ",", double time = 1, double current = 1,
                  double voltage = 1) {
  return lines(header, [&](std::size_t, const Row& r) {
    return fmt::format("{}{}{}{}{}", r.time_s * time, separator, r.current_a * current, separator,
                       std::round(1e6 * r.voltage_v * voltage) / 1e6);
  });
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

std::string utf16(const std::string& ascii) {
  std::string out = "\xFF\xFE";
  for (const char c : ascii) {
    out += c;
    out += '\0';
  }
  return out;
}

std::string compressed(const std::string& text, int (*filter)(archive*)) {
  archive* a = archive_write_new();
  filter(a);
  archive_write_set_format_raw(a);
  std::string out(text.size() + 4'096, '\0');
  std::size_t used = 0;
  archive_write_open_memory(a, out.data(), out.size(), &used);
  archive_entry* entry = archive_entry_new();
  archive_entry_set_filetype(entry, AE_IFREG);
  archive_write_header(a, entry);
  archive_write_data(a, text.data(), text.size());
  archive_entry_free(entry);
  archive_write_close(a);
  archive_write_free(a);
  out.resize(used);
  return out;
}

std::string clock_text(double s) {
  return fmt::format("{:02}:{:02}:{:06.3f}", static_cast<int>(s) / 3'600, static_cast<int>(s) / 60 % 60,
                     std::fmod(s, 60));
}

// ---- tables of testers

std::string arbin() {
  return lines(
      "Data_Point,Test_Time(s),Date_Time,Step_Time(s),Step_Index,Cycle_Index,Current(A),Voltage(V),"
      "Charge_Capacity(Ah),Discharge_Capacity(Ah),Internal_Resistance(Ohm),Aux_Temperature(C)_1",
      [](std::size_t k, const Row& r) {
        return fmt::format("{},{:.6f},2026-03-05 06:00:{:02},{:.6f},1,1,{:.6f},{:.6f},0,0,0,{:.3f}", k + 1, r.time_s, k,
                           r.time_s, r.current_a, r.voltage_v, r.temperature_c);
      });
}

std::string arbin_new() {
  return lines("Data Point,Date Time,Test Time (s),Step Time (s),Cycle Index,Step Index,Current (A),Voltage (V)",
               [](std::size_t k, const Row& r) {
                 return fmt::format("{},03/05/2026 06:00:{:02}.000,{:.4f},{:.4f},1,1,{:.6f},{:.6f}", k + 1, k, r.time_s,
                                    r.time_s, r.current_a, r.voltage_v);
               });
}

/// The current has no sign; the state says whether the cell is charged or discharged.
std::string maccor(bool minutes) {
  const std::string header = fmt::format(
      "Rec#\tCyc#\tStep\tTest ({0})\tStep ({0})\tAmp-hr\tWatt-hr\tAmps\tVolts\tState\tES", minutes ? "Min" : "Sec");
  return "Today's Date  03/05/2026\tDate of Test:  03/05/2026\nFilename:  cell7.001\tProcedure: hppc.000\n" +
         lines(header, [&](std::size_t k, const Row& r) {
           const double t = minutes ? r.time_s / 60 : r.time_s;
           char state = 'R';
           if (r.current_a > 0) state = 'C';
           if (r.current_a < 0) state = 'D';
           return fmt::format("{}\t0\t1\t{:.6f}\t{:.6f}\t0\t0\t{:.5f}\t{:.5f}\t{}\t1", k + 1, t, t,
                              std::abs(r.current_a), r.voltage_v, state);
         });
}

std::string neware() {
  return lines(
      "DataPoint,Cycle Index,Step Index,Step Type,Time,Total Time,Current(A),Voltage(V),Capacity(Ah),Date,"
      "T1(\xE2\x84\x83)",
      [](std::size_t k, const Row& r) {
        return fmt::format("{},1,1,Rest,00:00:{:02},{},{:.4f},{:.4f},0,2026-03-05 06:00:{:02},{:.1f}", k + 1, k % 10,
                           clock_text(r.time_s).substr(0, 8), r.current_a, r.voltage_v, k, r.temperature_c);
      },
      "\r\n");
}

std::string neware_old() {
  return lines("Record ID,Realtime,Time(h:min:s.ms),Step ID,Cycle ID,Current(mA),Voltage(V)",
               [](std::size_t k, const Row& r) {
                 return fmt::format("{},2026-03-05 06:00:{:02},0:00:{:02}.000,1,1,{:.1f},{:.4f}", k + 1, k, k % 10,
                                    1e3 * r.current_a, r.voltage_v);
               });
}

std::string biologic(bool comma) {
  std::string text =
      "EC-Lab ASCII FILE\r\nNb header lines : 5                          \r\n\r\nModulo Bat\r\n"
      "mode\tox/red\terror\ttime/s\tcontrol/V/mA\tEcell/V\t<I>/mA\tTemperature/\xB0"
      "C\t\r\n";
  for (const Row& r : signal()) {
    text += fmt::format("1\t1\t0\t{:.12e}\t0.0\t{:.7e}\t{:.7e}\t{:.7e}\t\r\n", r.time_s, r.voltage_v, 1e3 * r.current_a,
                        r.temperature_c);
  }
  if (!comma) return text;
  const std::size_t data = text.find("\r\n1\t");
  return text.substr(0, data) + replaced(text.substr(data), ".", ",");
}

std::string pec(bool clock) {
  return "Test:,4711\nRegime:,HPPC\nCell:,1\n\n" +
         lines(clock ? "Cell,Cycle,Step,Total Time (Hours in hh:mm:ss.xxx),Voltage (mV),Current (mA),Rack"
                     : "Cell,Cycle,Step,Total Time (Seconds),Voltage (mV),Current (mA),Rack",
               [&](std::size_t, const Row& r) {
                 return fmt::format("1,1,1,{},{:.2f},{:.2f},2",
                                    clock ? clock_text(r.time_s) : fmt::format("{:.3f}", r.time_s), 1e3 * r.voltage_v,
                                    1e3 * r.current_a);
               });
}

std::string basytec() {
  return "~Resultfile from Basytec Battery Test System\n~Date: 05.03.2026\n" +
         lines(
             "~Time[s]\tDataSet\tU[V]\tI[A]\tT1[\xB0"
             "C]",
             [](std::size_t k, const Row& r) {
               return fmt::format("{:.3f}\t{}\t{:.5f}\t{:.5f}\t{:.2f}", r.time_s, k, r.voltage_v, r.current_a,
                                  r.temperature_c);
             });
}

std::string bdf(bool machine) {
  return lines(machine ? "test_time_second,voltage_volt,current_ampere,temperature_t1_celsius,cycle_count"
                       : "Test Time / s,Voltage / V,Current / A,Surface Temperature T1 / degC,Cycle Count / 1",
               [](std::size_t, const Row& r) {
                 return fmt::format("{},{},{},{},3", r.time_s, r.voltage_v, r.current_a, r.temperature_c);
               });
}

std::string with_time(const std::string& header, const RowText& time) {
  return lines(header, [&](std::size_t k, const Row& r) {
    return fmt::format("{},{:.4f},{:.4f}", time(k, r), r.current_a, r.voltage_v);
  });
}

std::string pack(const std::string& header, int cells, bool sum) {
  return lines(header, [&](std::size_t, const Row& r) {
    std::string text = fmt::format("{},{}", r.time_s, r.current_a);
    if (sum) return text + fmt::format(",{:.4f}", cells * r.voltage_v);
    for (int c = 0; c < cells; ++c) text += fmt::format(",{:.6f}", r.voltage_v + 0.001 * (c - (cells - 1) / 2.0));
    return text;
  });
}

// ---- logs of CAN frames: 0x123 has the current (little endian, 0.01 A) and the voltage (big endian, 1 mV)

std::array<unsigned, 4> bytes_of(const Row& r) {
  const auto current = static_cast<unsigned>(static_cast<int>(std::lround(r.current_a * 100))) & 0xFFFFU;
  const auto voltage = static_cast<unsigned>(std::lround(r.voltage_v * 1'000));
  return {current & 0xFFU, current >> 8, voltage >> 8, voltage & 0xFFU};
}

std::string frames(const std::function<std::string(double, const std::array<unsigned, 4>&)>& line,
                   const std::string& header = "") {
  std::string text = header;
  for (const Row& r : signal()) text += line(r.time_s, bytes_of(r)) + "\n";
  return text;
}

std::string spaced(const std::array<unsigned, 4>& b) {
  return fmt::format("{:02X} {:02X} {:02X} {:02X}", b[0], b[1], b[2], b[3]);
}

const char* const bus = "--dbc bus.dbc --map current_a=PackCurrent --map voltage_v=CellVoltage";

/// Devices, names and units in a row each; the time only in the first.
std::string victron() {
  return lines("timestamp,Battery Monitor [288],,\nEurope/Amsterdam (+01:00),Voltage,Current,Battery state\n,V,A,",
               [](std::size_t k, const Row& r) {
                 return fmt::format("2025-03-11 08:{:02}:{:02},{:.2f},{:.3f},Idle", k / 60, k % 60, 16 * r.voltage_v,
                                    r.current_a);
               });
}

/// A preamble, names without units, and units next to the numbers.
std::string daly() {
  return lines("BMS Monitor V1.2.9,,,\nSN:16S100A,,,\n\nNo.,DateTime,SumVoltage,Current",
               [](std::size_t k, const Row& r) {
                 return fmt::format("{},2025-03-11 08:{:02}:{:02},{:.1f}V,{:.1f}A", k + 1, k / 60, k % 60,
                                    16 * r.voltage_v, r.current_a);
               });
}

void add_tables(std::vector<Sample>& all) {
  all.push_back({"the project's own CSV", "own.csv", plain("time_s,current_a,voltage_v"), "", Answer::read, ""});
  all.push_back({"own names, ';' and decimal comma", "comma.csv",
                 replaced(plain("time_s;current_a;voltage_v", ";"), ".", ","), "", Answer::read, "decimal comma"});
  all.push_back({"own names, tabs", "tabs.txt", plain("time_s\tcurrent_a\tvoltage_v", "\t"), "", Answer::read, "tab"});
  all.push_back({"German spreadsheet", "excel_de.csv",
                 replaced(plain("Zeit [s];Strom [A];Spannung [V]", ";"), ".", ","), "", Answer::read,
                 "current_a from 'Strom [A]'"});
  all.push_back({"units in the names", "units.csv", plain("Time (ms),Current/mA,Voltage [mV]", ",", 1e3, 1e3, 1e3), "",
                 Answer::read, "current_a from 'Current/mA' in mA"});
  all.push_back({"units as suffixes", "suffix.csv", plain("time_ms,current_ma,voltage_mv", ",", 1e3, 1e3, 1e3), "",
                 Answer::read, "time_s from 'time_ms' in ms"});
  all.push_back({"a row of units", "units_row.csv", plain("Time,Current,Voltage\ns,mA,V", ",", 1, 1e3), "",
                 Answer::read, "current_a from 'Current (mA)' in mA"});
  all.push_back({"a row of units below own names", "units_row2.csv",
                 plain("time_s,current_a,voltage_v\ns,mA,V", ",", 1, 1e3), "", Answer::read,
                 "current_a from 'current_a' in mA"});
  all.push_back({"names without units", "names.csv", plain("t,i_batt,u_cell"), "", Answer::refused,
                 "column 'i_batt' states no unit, expected --unit current_a=UNIT"});
  all.push_back({"the same, named by the user", "mapped.csv", plain("t,i_batt,u_cell", ",", 1e3, 1, 1e3),
                 "--map time_s=t --map current_a=i_batt --map voltage_v=u_cell --unit time_s=ms --unit voltage_v=mV",
                 Answer::read, "current_a from 'i_batt'"});
  all.push_back({"Battery Data Format, labels", "a.bdf.csv", bdf(false), "", Answer::read, "Battery Data Format"});
  all.push_back(
      {"Battery Data Format, machine-readable names", "b.bdf", bdf(true), "", Answer::read, "Battery Data Format"});
  all.push_back({"Battery Data Format, gzip", "c.bdf.gz", compressed(bdf(false), archive_write_add_filter_gzip), "",
                 Answer::read, "Battery Data Format, gzip"});
  all.push_back({"Arbin, MITS Pro", "arbin.csv", arbin(), "", Answer::read, "Arbin"});
  all.push_back({"Arbin, Data Watcher", "arbin_new.csv", arbin_new(), "", Answer::read, "Arbin"});
  all.push_back({"Maccor, seconds", "maccor.001", maccor(false), "", Answer::read, "the sign is that of the state"});
  all.push_back({"Maccor, minutes", "maccor.txt", maccor(true), "", Answer::read, "in min"});
  all.push_back({"Neware, BTSDA 8", "neware.csv", neware(), "", Answer::read, "Neware"});
  all.push_back({"Neware, BTS 7", "neware_old.csv", neware_old(), "", Answer::read, "in mA"});
  all.push_back({"BioLogic .mpt", "biologic.mpt", biologic(false), "", Answer::read, "BioLogic"});
  all.push_back({"BioLogic .mpt, decimal comma", "biologic_fr.mpt", biologic(true), "", Answer::read, "decimal comma"});
  all.push_back({"PEC, seconds", "pec.csv", pec(false), "", Answer::read, "PEC"});
  all.push_back({"PEC, hh:mm:ss", "pec_clock.csv", pec(true), "", Answer::read, "h:mm:ss"});
  all.push_back({"Basytec", "basytec.txt", basytec(), "", Answer::read, "voltage_v from 'U[V]'"});
}

void add_times_and_encodings(std::vector<Sample>& all) {
  const auto at = [](const char* format) {
    return [format](std::size_t k, const Row&) { return fmt::format(fmt::runtime(format), k); };
  };
  all.push_back({"ISO-8601 times", "iso.csv",
                 with_time("timestamp,Current (A),Voltage (V)", at("2026-03-05T06:00:{:02}.000Z")), "", Answer::read,
                 "a date"});
  all.push_back({"US dates, AM and PM", "us.csv",
                 with_time("Date Time,Current (A),Voltage (V)", at("03/05/2026 12:59:{:02} PM")), "", Answer::read,
                 "a date"});
  all.push_back({"epoch in milliseconds", "epoch.csv",
                 with_time("timestamp,current (A),voltage (V)", at("17726904{:02}000")), "", Answer::read, "epoch"});
  all.push_back({"numbers without a unit of time", "no_unit.csv", plain("Time,Current (A),Voltage (V)"), "",
                 Answer::refused, "have no unit"});
  all.push_back({"UTF-16 (PowerShell, Excel)", "utf16.csv", utf16(plain("time_s,current_a,voltage_v")), "",
                 Answer::read, "UTF-16"});
  all.push_back({"UTF-8 with a byte order mark", "bom.csv", "\xEF\xBB\xBF" + plain("time_s,current_a,voltage_v"), "",
                 Answer::read, ""});
  all.push_back({"line ends of old Macs", "cr.csv", replaced(plain("time_s,current_a,voltage_v"), "\n", "\r"), "",
                 Answer::read, ""});
  all.push_back({"gzip", "log.csv.gz", compressed(plain("time_s,current_a,voltage_v"), archive_write_add_filter_gzip),
                 "", Answer::read, "gzip"});
  all.push_back({"Zstandard", "log.csv.zst",
                 compressed(plain("time_s,current_a,voltage_v"), archive_write_add_filter_zstd), "", Answer::read,
                 "zstd"});
  all.push_back({"quotes with a separator inside", "quotes.csv",
                 lines("time_s,note,current_a,voltage_v",
                       [](std::size_t, const Row& r) {
                         return fmt::format("{},\"a, b\",{},{:.5f}", r.time_s, r.current_a, r.voltage_v);
                       }),
                 "", Answer::read, ""});
  all.push_back({"logger lost its power in the last line", "cut.csv", plain("time_s,current_a,voltage_v") + "60,-1", "",
                 Answer::read, ""});
  all.push_back(
      {"a reading is empty", "empty.csv", plain("time_s,current_a,voltage_v") + "60,,\n61,0,\n", "", Answer::read, ""});
  all.push_back({"time goes back", "back.csv", plain("time_s,current_a,voltage_v") + "3,0,3.3\n", "", Answer::refused,
                 "time goes back from 59 s to 3 s"});
}

void add_impossible(std::vector<Sample>& all) {
  const std::string own = "time_s,current_a,voltage_v";
  all.push_back(
      {"discharge is positive", "sign.csv", plain(own, ",", 1, -1), "", Answer::refused, "--discharge-positive"});
  all.push_back({"the same, confirmed", "sign2.csv", plain(own, ",", 1, -1), "--discharge-positive", Answer::read,
                 "a discharge is positive, inverted"});
  all.push_back({"millivolts in voltage_v", "mv.csv", plain(own, ",", 1, 1, 1e3), "", Answer::refused,
                 "look like millivolts, expected volts: --unit voltage_v=mV"});
  all.push_back({"milliamperes in current_a, compared with a cell", "ma.csv", plain(own, ",", 1, 1e3), "--cell table9",
                 Answer::refused, "look like milliamperes, expected amperes: --unit current_a=mA"});
  all.push_back({"milliseconds since 1970 in time_s", "epoch_ms.csv",
                 with_time(own, [](std::size_t k, const Row&) { return fmt::format("17726904{:02}000", k); }), "",
                 Answer::refused, "--unit time_s=ms"});
  all.push_back({"pack voltage as a cell's", "pack.csv", pack(own, 16, true), "", Answer::refused,
                 "a pack of about 16 cells in series"});
  all.push_back({"the same, with the number of cells", "pack2.csv", pack(own, 16, true),
                 "--map pack_voltage_v=voltage_v --series 16", Answer::read, "pack_voltage_v from 'voltage_v'"});
  all.push_back(
      {"four cells, own names", "cells.csv", pack("time_s,current_a,v_1,v_2,v_3,v_4", 4, false), "", Answer::read, ""});
  all.push_back({"four cells, names of a logger", "cells2.csv",
                 pack("Time (s),Pack Current (A),Cell 1 (V),Cell 2 (V),Cell 3 (V),Cell 4 (V)", 4, false), "",
                 Answer::read, "v_4 from 'Cell 4 (V)'"});
  all.push_back({"Victron VRM, three header rows", "vrm.csv", victron(), "--map pack_voltage_v=Voltage --series 16",
                 Answer::read, "time_s from 'timestamp' as h:mm:ss or a date; pack_voltage_v from 'Voltage (V)'",
                 1e-3});
  all.push_back({"Daly, a preamble and names without units", "daly.csv", daly(), "", Answer::refused,
                 "daly.csv:4: column 'Current' states no unit, expected --unit current_a=UNIT"});
  all.push_back(
      {"state of charge in percent", "percent.csv",
       lines("time_s,current_a,voltage_v,soc_ref",
             [](std::size_t, const Row& r) { return fmt::format("{},{},{},85", r.time_s, r.current_a, r.voltage_v); }),
       "", Answer::refused, "--unit soc_ref=%"});
  all.push_back({"kelvin in temperature_c", "kelvin.csv",
                 lines("time_s,current_a,voltage_v,temperature_c",
                       [](std::size_t, const Row& r) {
                         return fmt::format("{},{},{},298.15", r.time_s, r.current_a, r.voltage_v);
                       }),
                 "", Answer::refused, "--unit temperature_c=K"});
  all.push_back(
      {"Excel workbook", "book.xlsx", std::string("PK\x03\x04", 4) + "rest", "", Answer::refused, "save it as CSV"});
  all.push_back({"MDF4", "log.mf4", "MDF     4.10    rest", "", Answer::refused, "asammdf"});
  all.push_back({"Vector BLF", "log.blf", "LOGGrest", "", Answer::refused, "can.logconvert"});
  all.push_back({"BioLogic .mpr", "log.mpr", "BIO-LOGIC MODULAR FILE\x1A", "", Answer::refused, "export it as text"});
}

/// What apps and devices at home and in cars write: no unit in the names, cells next to the pack, rows of their own.
void add_apps(std::vector<Sample>& all) {
  const std::string leaf =
      lines("Date/Time,Gids,SOC,Pack Volts,Pack Amps,Max CP mV,CP1,CP2,VIN", [](std::size_t k, const Row& r) {
        return fmt::format("03/04/2024 07:30:{:02},200,620000,{:.2f},{:.3f},3303,{:.0f},{:.0f},X", k, 2 * r.voltage_v,
                           -r.current_a, 1e3 * r.voltage_v, 1e3 * r.voltage_v);
      });
  all.push_back({"LeafSpy", "leafspy.csv", leaf, "--discharge-positive", Answer::read, "v_2 from 'CP2' in mV", 6e-4});
  all.push_back({"LeafSpy, its SOC in ten thousandths of a percent", "leafspy_soc.csv", leaf,
                 "--discharge-positive --map soc_ref=SOC --unit soc_ref=ppm", Answer::read, "soc_ref from 'SOC' in ppm",
                 6e-4});
  all.push_back({"one unit for all cells", "cells_mv.csv",
                 lines("time_s,current_a,U1,U2",
                       [](std::size_t, const Row& r) {
                         return fmt::format("{},{},{:.1f},{:.1f}", r.time_s, r.current_a, 1e3 * r.voltage_v,
                                            1e3 * r.voltage_v);
                       }),
                 "--map 'v_*=U*' --unit 'v_*=mV'", Answer::read, "v_2 from 'U2' in mV"});
  all.push_back({"Scan My Tesla, cells in rows of their own", "tesla.csv",
                 lines("Time,Battery voltage,Battery current,SOC,Cell temp min,Cell  1 voltage,Cell  2 voltage,",
                       [](std::size_t, const Row& r) {
                         return fmt::format("{:.0f},{:.2f},{:.2f},60,,,,\n{:.0f},,,,21,{:.4f},{:.4f},", 1e3 * r.time_s,
                                            2 * r.voltage_v, r.current_a, 1e3 * r.time_s + 210, r.voltage_v,
                                            r.voltage_v);
                       }),
                 "", Answer::read, "current and voltages are in different rows: 60 of 120"});
  all.push_back({"the pack's voltage as voltage_v next to its cells", "sum.csv",
                 lines("time_s,current_a,voltage_v,v_1,v_2,v_3",
                       [](std::size_t, const Row& r) {
                         return fmt::format("{},{},{},{},{},{}", r.time_s, r.current_a, 3 * r.voltage_v, r.voltage_v,
                                            r.voltage_v, r.voltage_v);
                       }),
                 "", Answer::read, "it is used as pack_voltage_v"});
  all.push_back({"console of ESPHome over midnight", "esphome.log",
                 "[23:58:00][I][app:102]: ESPHome version 2024.6\n" +
                     lines("[23:58:01][C][logger:185]: Logger:",
                           [](std::size_t k, const Row& r) {
                             const double s = k < 30 ? 86'340 + 2.0 * r.time_s : 2.0 * r.time_s - 60;
                             const std::string head = "[" + clock_text(s) + "][D][sensor:125]: '";
                             return fmt::format(
                                 "{0}bms current': Sending state {1:.5f} A with 2 decimals of accuracy\n"
                                 "{0}bms cell voltage 1': Sending state {2:.5f} V with 3 decimals of accuracy",
                                 head, r.current_a, r.voltage_v);
                           }),
                 "", Answer::read, "v_1 from 'bms cell voltage 1'"});
  all.back().time_factor = 2;
}

void add_steps(std::vector<Sample>& all) {
  const auto steps = [](int first) {
    std::string text = "Test_Time(s),Step_Index,Cycle_Index,Current(A),Voltage(V)\n";
    for (int k = 0; k < 20; ++k) text += fmt::format("{},{},1,0,3.3\n", k - 40, first - 1);
    for (const Row& r : signal()) {
      text += fmt::format("{},{},1,{},{:.6f}\n", r.time_s, first + static_cast<int>(r.time_s) / 30, r.current_a,
                          r.voltage_v);
    }
    for (int k = 0; k < 20; ++k) text += fmt::format("{},{},2,0,3.3\n", 100 + k, first + 1);
    return text;
  };
  all.push_back({"two steps of the first cycle of a test", "steps.csv", steps(3), "--steps 3:4 --cycles 1",
                 Answer::read, "only steps 3 to 4 of 'Step_Index'; only cycles 1 to 1"});
  all.push_back({"steps of a table that has none", "no_steps.csv", plain("time_s,current_a,voltage_v"), "--steps 3:4",
                 Answer::refused, "no column with the number of the step"});
}

/// A battery with the frames of Pylontech: 16 cells.
std::string pylontech() {
  std::string text;
  for (const Row& r : signal()) {
    const int v = static_cast<int>(std::lround(1600 * r.voltage_v)),
              a = static_cast<int>(std::lround(10 * r.current_a)),
              c = static_cast<int>(std::lround(10 * r.temperature_c));
    const auto low = [](int x) { return static_cast<unsigned>(x) & 0xFF; };
    const auto high = [](int x) { return static_cast<unsigned>(x) >> 8 & 0xFF; };
    text += fmt::format("({:.6f}) can0 351#1402D007D007BE01\n({:.6f}) can0 355#3C006300\n", r.time_s, r.time_s + 0.01);
    text += fmt::format("({:.6f}) can0 356#{:02X}{:02X}{:02X}{:02X}{:02X}{:02X}\n", r.time_s + 0.02, low(v), high(v),
                        low(a), high(a), low(c), high(c));
  }
  return text;
}

void add_frames(std::vector<Sample>& all) {
  all.push_back({"a battery with the frames of Pylontech or Victron", "pylontech.log", pylontech(),
                 "--dbc pylontech --series 16", Answer::read, "current_a from Measured.Current", 6e-4, 0.051});
  const std::string candump = frames([](double t, const auto& b) {
    return fmt::format("({:.6f}) can0 123#{:02X}{:02X}{:02X}{:02X}", t, b[0], b[1], b[2], b[3]);
  });
  all.push_back({"candump without a DBC file", "bare.log", candump, "", Answer::refused, "expected --dbc"});
  const double step_v = 6e-4;
  all.push_back({"candump", "candump.log", candump, bus, Answer::read, "candump", step_v});
  all.push_back({"Battery-Emulator", "emulator.txt",
                 frames([](double t, const auto& b) { return fmt::format("({:.3f}) RX0 123 [4] {}", t, spaced(b)); }),
                 bus, Answer::read, "battery-emulator", step_v});
  all.push_back(
      {"Vector ASC", "vector.asc",
       frames([](double t, const auto& b) { return fmt::format("{:11.6f} 1  123  Rx   d 4 {}", t, spaced(b)); },
              "date Thu Mar 5 06:00:00 am 2026\nbase hex  timestamps absolute\nno internal events logged\n"),
       bus, Answer::read, "asc", step_v});
  all.push_back({"SavvyCAN, GVRET", "gvret.csv",
                 frames(
                     [](double t, const auto& b) {
                       return fmt::format("{:.0f},00000123,false,Rx,0,4,{},", 1e6 * t, replaced(spaced(b), " ", ","));
                     },
                     "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"),
                 bus, Answer::read, "gvret", step_v});
  all.push_back({"a signal that the DBC file lacks", "other.log", candump, "--dbc bus.dbc --map current_a=Speed",
                 Answer::refused, "no signal 'Speed'"});
}

void add_frames_of_tools(std::vector<Sample>& all) {
  const double step_v = 6e-4;
  const auto trace = [](const char* version, const char* head, const char* columns) {
    std::size_t count = 0;
    return Sample{std::string("PEAK trace ") + version,
                  std::string("trace_") + version[0] + version[2] + ".trc",
                  frames(
                      [&](double t, const auto& b) {
                        return fmt::format("{:6}{} {:11.3f} {} {}", ++count, head[14] == '1' ? ")" : "", 1e3 * t,
                                           columns, spaced(b));
                      },
                      head + std::string("\n;$STARTTIME=44128.5647\n;\n;---+--   ----+----  --+--\n")),
                  bus,
                  Answer::read,
                  "trc",
                  6e-4};
  };
  all.push_back(trace("1.0", ";$FILEVERSION=1.0", "0123  4 "));
  all.push_back(trace("1.1", ";$FILEVERSION=1.1", "Rx         0123  4 "));
  all.push_back(trace("1.3", ";$FILEVERSION=1.3", "1  Rx        0123 -  4   "));
  all.push_back(trace("2.0", ";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D", "DT     0123 Rx 4  "));
  all.push_back(trace("2.1", ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D", "FB 1      0123 Rx -  4    "));
  const auto busmaster = [](const char* modes, double start_s, bool relative, bool decimal) {
    double last_s = relative ? 0 : -start_s;
    return frames(
        [=](double t, const auto& b) mutable {
          const double s = t - last_s;
          if (relative) last_s = t;
          const double of_day = s >= 86'400 ? s - 86'400 : s;
          const std::string bytes = decimal ? fmt::format("{} {} {} {}", b[0], b[1], b[2], b[3]) : spaced(b);
          return fmt::format("{:02}:{:02}:{:02}:{:04} Rx 1 {} s 4 {} ", static_cast<int>(of_day) / 3'600,
                             static_cast<int>(of_day) / 60 % 60, static_cast<int>(of_day) % 60,
                             static_cast<int>(std::lround(std::fmod(of_day, 1.0) * 1e4)), decimal ? "291" : "0x123",
                             bytes);
        },
        std::string("***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n***[START LOGGING SESSION]***\n") + modes);
  };
  all.push_back({"BUSMASTER, system clock over midnight", "busmaster.log",
                 busmaster("***HEX***\n***SYSTEM MODE***\n", 86'370, false, false), bus, Answer::read, "busmaster",
                 step_v});
  all.push_back({"BUSMASTER, decimal, time since the frame above", "relative.log",
                 busmaster("***DEC***\n***RELATIVE MODE***\n", 0, true, true), bus, Answer::read, "busmaster", step_v});
}

}  // namespace

std::vector<Row> signal() {
  std::vector<Row> rows;
  for (int k = 0; k < 60; ++k) {
    double current_a = 0;
    if (k >= 10 && k < 30) current_a = -2.5;
    if (k >= 40) current_a = 1.25;
    rows.push_back({static_cast<double>(k), current_a, 3.3 + 0.02 * current_a - 1e-4 * (k % 7), 25 + 0.1 * (k / 10)});
  }
  return rows;
}

std::string dbc() {
  return "VERSION \"\"\n\nBU_: BMS\n\nBO_ 291 Battery: 4 BMS\n"
         " SG_ PackCurrent : 0|16@1- (0.01,0) [-300|300] \"A\" Vector__XXX\n"
         " SG_ CellVoltage : 23|16@0+ (1,0) [0|5000] \"mV\" Vector__XXX\n";
}

std::vector<Sample> samples() {
  std::vector<Sample> all;
  add_tables(all);
  add_times_and_encodings(all);
  add_impossible(all);
  add_apps(all);
  add_steps(all);
  add_frames(all);
  add_frames_of_tools(all);
  return all;
}

}  // namespace bms::log_samples
