#include "images/flash_plan.hpp"

#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

namespace bms::images {

std::optional<AddressRange> storage_of(const ImageFile& image) {
  if (!image.has_symbol("image_storage_begin")) return std::nullopt;
  const AddressRange storage{image.symbol("image_storage_begin"), image.symbol("image_storage_end")};
  if (storage.begin >= storage.end) return std::nullopt;
  return storage;
}

std::vector<LoadedPart> parts_to_write(const std::vector<LoadedPart>& parts,
                                       const std::optional<AddressRange>& storage) {
  std::vector<LoadedPart> joined;
  for (const LoadedPart& part : parts) {
    if (storage && part.address < storage->end && part.address + part.bytes.size() > storage->begin) {
      throw std::runtime_error(
          fmt::format("the image has {} bytes at {:#010x}, where the stored records are ({:#010x} to {:#010x}): "
                      "nothing was written",
                      part.bytes.size(), part.address, storage->begin, storage->end));
    }
    const bool records_between =
        storage && !joined.empty() && joined.back().address < storage->begin && part.address >= storage->end;
    if (joined.empty() || records_between) {
      joined.push_back(part);
      continue;
    }
    LoadedPart& before = joined.back();
    if (part.address < before.address + before.bytes.size())
      throw std::runtime_error(fmt::format("the image has two parts at {:#010x}", part.address));
    before.bytes.resize(part.address - before.address, '\xFF');
    before.bytes += part.bytes;
  }
  if (joined.empty()) throw std::runtime_error("the image has no bytes for the flash");
  return joined;
}

std::vector<std::string> openocd_command(const Probe& probe, const std::vector<PartFile>& parts,
                                         const std::optional<AddressRange>& storage,
                                         const std::filesystem::path& kept) {
  std::vector<std::string> words = {"openocd"};
  const auto add_command = [&](const std::string& command) { words.insert(words.end(), {"-c", command}); };
  words.insert(words.end(), {"-f", "interface/" + probe.interface + ".cfg"});
  if (!probe.serial.empty()) add_command("adapter serial " + probe.serial);
  words.insert(words.end(), {"-f", "target/" + probe.target + ".cfg"});
  for (const char* port : {"gdb_port", "tcl_port", "telnet_port"}) add_command(std::string(port) + " disabled");
  add_command("init");
  add_command("reset halt");
  if (storage)
    add_command(
        fmt::format("dump_image {{{}}} {:#010x} {:#x}", kept.string(), storage->begin, storage->end - storage->begin));
  for (const PartFile& part : parts)
    add_command(fmt::format("flash write_image erase {{{}}} {:#010x} bin", part.path.string(), part.address));
  for (const PartFile& part : parts)
    add_command(fmt::format("verify_image {{{}}} {:#010x} bin", part.path.string(), part.address));
  add_command("echo {image verified}");
  if (storage) add_command(fmt::format("verify_image {{{}}} {:#010x} bin", kept.string(), storage->begin));
  add_command("reset run");
  add_command("shutdown");
  return words;
}

FlashFailure failure_in(const std::string& log, const Probe& probe) {
  const auto contains = [&](const char* words) { return log.find(words) != std::string::npos; };
  if (contains("Can't find"))
    return {fmt::format("OpenOCD has no interface/{}.cfg or target/{}.cfg", probe.interface, probe.target), true};
  if (contains("LIBUSB_ERROR_ACCESS"))
    return {
        "no permission to open the USB device of the probe: install the udev rules of OpenOCD, join the group plugdev",
        true};
  for (const char* words : {"open failed", "unable to find a matching", "No device matches", "No J-Link device found",
                            "no device found", "unable to open"}) {
    if (contains(words))
      return {fmt::format("no {} probe{} found: is it connected? For another kind of probe use --probe",
                          probe.interface, probe.serial.empty() ? "" : " with the serial number " + probe.serial),
              true};
  }
  if (contains("image verified"))
    return {"the image is in the flash, but the stored records have changed; a copy of them is next to the image",
            false};
  for (const char* words : {"checksum mismatch", "verify failed", "Verify Failed", "diff 0 address"}) {
    if (contains(words)) return {"the flash does not contain what was written to it", false};
  }
  for (const char* words : {"init mode failed", "unable to connect to the target", "Cannot read IDR",
                            "Target not examined", "Error connecting DP", "SWD DPIDR", "all ones", "all zeroes"}) {
    if (contains(words))
      return {"the probe is connected, but the chip does not answer: check power, SWDIO, SWCLK, NRST and GND", false};
  }
  std::string last = "OpenOCD failed";
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("Error: ")) last = line.substr(7);
  }
  return {last, false};
}

}  // namespace bms::images
